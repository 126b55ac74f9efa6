"""From a run's settings to its plant and its rig."""

import math
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, TypeGuard

import mujoco

from twin.config import TURNTABLE, Fly, Run
from twin.config.seats import MODELS, OF_SERVOS, is_rig
from twin.errors import TwinError
from twin.plant.model.model import ModelConfig, Seat, load
from twin.plant.plant import Plant
from twin.plant.release import Release
from twin.plant.steps import integrators
from twin.plant.steps.smooth import MOVING, applies, longest_step, on_elastic_rail

if TYPE_CHECKING:
    from hardware.calibration import Calibration
    from twin.hil import RigOptions
    from twin.hil.shadow import ShadowOptions

HAND_HEIGHT = 1.7  # m above the ground, of the lower lug in the hand
FINEST = 0.001  # s; where Runge-Kutta needs shorter steps, implicit ones of this length are cheaper
STAND = 0.02  # m that a vehicle lifts off its stand before it is free


def make_plant(config: Run, motor: Path | None = None, *, recorded: bool = True) -> Plant:
    """The simulated side of a run; its gimbal follows where a rig has the gimbal seat.

    Parameters
    ----------
    motor : motor file in place of the vehicle's own
    recorded : whether the model's digest is needed

    Raises
    ------
    TwinError : a file, name or number that cannot be used, or a step too long for the integrator
    """
    overrides = {**_of_the_launch(config), **_of_the_plant(config)}
    kind: Seat = "follow"
    if config.gimbal in MODELS:
        kind = "linkage" if config.gimbal == "linkage" else "transfer-function"
    if kind == "transfer-function":
        _refuse_servos(overrides)
    model = ModelConfig(
        scene=config.plant_scene,
        gimbal=kind,
        transfer_function=config.model,
        vehicle=config.vehicle,
        mechanism=config.mechanism,
        motor=motor,
        overrides=overrides,
        dt=config.dt,
        seed=config.seed,
    )
    first = model
    if kind == "transfer-function" and _chooses(config) and config.dt is None:
        first = replace(model, dt=_whole(config, MOVING))  # its matrices belong to one step
    twin = load(first, lambda mj: _settle(config, mj), digested=recorded)
    integrator = config.integrator or ("rk4" if _divided(config, twin.mj) else "implicitfast")
    if first is not model:
        dt = float(twin.mj.opt.timestep) if _divided(config, twin.mj) else None
        if dt != first.dt:
            twin = load(replace(model, dt=dt), digested=recorded)
    integrators.check_step(
        integrator, twin.mj.opt.timestep, ramp=on_elastic_rail(twin.mj), rods=twin.mj.neq > 0
    )
    return Plant(twin, integrator, _release(config))


def _chooses(config: Run) -> TypeGuard[Fly]:
    """Whether a run may take Runge-Kutta steps of its own choice; those beside a rig are fixed."""
    return (
        isinstance(config, Fly) and config.gimbal in MODELS and config.integrator in (None, "rk4")
    )


def _divided(config: Run, model: mujoco.MjModel) -> TypeGuard[Fly]:
    """Whether a run takes the Runge-Kutta steps of `twin.plant.steps.smooth` by default."""
    if applies(model):
        return isinstance(config, Fly)
    return _chooses(config) and longest_step(model) >= max(FINEST, config.dt or 0.0)


def _whole(config: Fly, longest: float) -> float:
    """Longest step of a whole fraction of the control period [s]."""
    tick = 1.0 / config.control_hz
    return round(1e9 * tick / math.ceil(tick / longest - 1e-9)) * 1e-9


def _settle(config: Run, model: mujoco.MjModel) -> None:
    """Give a model the step that belongs to its method; docs/convergence.md has the errors."""
    if config.dt is None and config.integrator in (None, "rk4") and _divided(config, model):
        model.opt.timestep = _whole(config, longest_step(model))


def _of_the_launch(config: Run) -> dict[str, float]:
    """Numerics of the kind of launch, which `--set` takes precedence over."""
    if not isinstance(config, Fly) or config.launch == "ramp":
        return {}
    if config.launch == "stand":
        return {"ramp_length": STAND, "ramp_elevation": math.pi / 2}
    return {"ramp_length": 0.0, "ramp_position[2]": HAND_HEIGHT}


def _release(config: Run) -> Release | None:
    if not isinstance(config, Fly) or config.launch != "hand":
        return None
    attitude, rate = math.radians(config.hand_attitude_deg), math.radians(config.hand_rate_deg_s)
    return Release.thrown(config.seed, config.hand_speed_m_s, attitude, rate)


def _refuse_servos(
    names: Iterable[str], flag: str = "--set", needed: str = "--gimbal linkage"
) -> None:
    for name in names:
        if name.startswith(OF_SERVOS):
            raise TwinError(
                f"{flag} {name} needs {needed}: an identified model has no servos, rods or"
                " backlash, so the parameter would have no effect"
            )


def _of_the_plant(config: Run) -> dict[str, float]:
    """Overrides without those of servos, rods and turntable, where these belong to a rig."""
    if not is_rig(config.gimbal):
        return config.overrides
    rigs = (*OF_SERVOS, TURNTABLE) if config.rig_scene == TURNTABLE else OF_SERVOS
    return {k: v for k, v in config.overrides.items() if not k.startswith(rigs)}


def rig_options(config: Run, *, watch: bool = False) -> "RigOptions":
    """How the rig of a run is to be opened; `watch` sends it no commands."""
    from twin.hil import RigOptions

    return RigOptions(
        seat=config.gimbal,
        calibration=config.calibration,
        unit=config.unit,
        faults=config.fault,
        seed=config.seed,
        mechanism=config.mechanism,
        overrides=config.overrides,
        scene=config.rig_scene,
        watch=watch,
        check=not config.no_check,
    )


def rig_calibration(config: Run) -> "Calibration":
    """Map from pulses to angles of a run's gimbal: of its calibration file, or nominal.

    Raises
    ------
    TwinError, HardwareError : a file that cannot be used
    """
    from twin.hil.connect import calibration_of

    return calibration_of(rig_options(config))


def shadow_options(config: Run, *, watch: bool = False) -> "ShadowOptions | None":
    """Model beside the rig of a run; None without one.

    Parameters
    ----------
    watch : whether the commands are those of the pulses in force

    Raises
    ------
    TwinError : parameters that it does not have
    """
    from twin.hil.shadow import ShadowOptions

    kind = config.shadow or "linkage"
    if kind == "none":
        return None
    parameters, model = config.shadow_parameters, None
    if kind == "transfer-function":
        _refuse_servos(dict(config.shadow_set), "--shadow-set", "--shadow linkage")
        parameters = {k: v for k, v in parameters.items() if not k.startswith(OF_SERVOS)}
        model = config.model
    return ShadowOptions(kind, model, config.mechanism, parameters, at_once=watch)


def steps_per_tick(control_hz: float, plant: Plant) -> int:
    """Physics steps between two commands.

    Raises
    ------
    TwinError : the control period is not a whole number of physics steps
    """
    steps = 1e9 / control_hz / plant.dt_ns
    if steps < 0.999 or abs(steps - round(steps)) > 1e-3:  # 333.333 Hz means a third of 1 kHz
        raise TwinError(
            f"--control-hz {control_hz:g}: the period must be a whole number of physics steps of"
            f" {plant.dt_ns * 1e-6:g} ms, for example"
            f" {1e9 / plant.dt_ns / max(1, round(steps)):g} Hz"
        )
    return round(steps)
