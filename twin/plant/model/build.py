"""Compose and compile the model of a run, and check the names that the loop needs."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import mujoco

from analysis.transfer_function import Channel, TransferFunctionModel
from hardware.frames import AXES
from hardware.protocol import constants
from twin.errors import TwinError
from twin.physics import motor
from twin.physics.aerodynamics.fit import misfits
from twin.physics.mechanism import check_frame, check_response
from twin.physics.mechanism.servo import insert_backlash
from twin.plant.authority import insert_control
from twin.plant.model import overrides as override
from twin.plant.model.compose import MJCF, NOTE, SCENES, compose, is_description, one_line
from twin.plant.model.plausible import check_mechanism, check_motor

Seat = Literal["linkage", "transfer-function", "follow"]
Moved = Literal[Seat, "fixed"]
REFERENCE_GIMBAL = MJCF / "gimbal.json"
HIDDEN = 4  # geom group that neither MuJoCo's viewer nor a recording shows
# s; the frame of a hobby servo, above which no gimbal motion is resolved; runs allow less
LARGEST_MODEL_DT = constants.PWM_PERIOD

# What the loop reads and writes by name; docs/vehicles.md explains each.
NEEDED: Mapping[str, tuple[tuple[str, str], ...]] = {
    "vehicle": (("body", "vehicle"), ("joint", "vehicle"), ("site", "gimbal_nozzle")),
    "gimbal": (("joint", "gimbal_x"), ("joint", "gimbal_y"), ("body", "gimbal_holder")),
    "linkage": (("actuator", "gimbal_servo_x"), ("actuator", "gimbal_servo_y")),
}


@dataclass(frozen=True)
class ModelConfig:
    """Sources of the model of a run; all of it is recorded.

    Attributes
    ----------
    scene : a shipped scene's name or an MJCF file
    gimbal : what moves the gimbal joints: servos and rods, an identified model, or measured angles,
        which the joints follow at the measured rate
    transfer_function : file of the identified model; the shipped reference where None
    vehicle : MJCF, TOML or OpenRocket file in place of the scene's own
    mechanism : MJCF file in place of the scene's own
    motor : motor file, or FILE:NAME, in place of the vehicle's own motor
    overrides : named parameters, see `twin.plant.model.overrides`
    dt : physics step [s]; the scene's own where None
    seed : of the gusts, where no override names `wind_seed`
    """

    scene: str = "flight"
    gimbal: Seat = "linkage"
    transfer_function: Path | None = None
    vehicle: Path | None = None
    mechanism: Path | None = None
    motor: Path | None = None
    overrides: Mapping[str, float] = field(default_factory=dict)
    dt: float | None = None
    seed: int = 0


@dataclass(frozen=True)
class Built:
    """A compiled model with the parameters of its files.

    Attributes
    ----------
    mj : the compiled model
    gimbal : what moves the gimbal; `fixed` where the vehicle has no gimbal
    notes : for the user, one line each
    traced : as of `Composed`
    """

    mj: mujoco.MjModel
    gimbal: Moved
    notes: tuple[str, ...]
    traced: bool


def build(config: ModelConfig) -> Built:
    """Compile a model; of the overrides those of the backlash are applied.

    Raises
    ------
    TwinError : a file, name or number that cannot be used, in one line
    """
    composed = compose(config.scene, config.vehicle, config.mechanism, config.motor)
    spec, notes = composed.spec, composed.left_out
    if config.dt is not None:
        spec.option.timestep = _checked_dt(config.dt)
    elif not 0 < spec.option.timestep <= LARGEST_MODEL_DT:
        raise TwinError(
            f"the model's timestep of {spec.option.timestep:g} s must lie in 0 < timestep ≤"
            f" {LARGEST_MODEL_DT:g} s; correct it in the MJCF file, or give --dt"
        )
    seat = _seat(spec, config)
    vehicle = config.vehicle is not None or spec.body("vehicle") is not None
    _require(spec, seat, vehicle=vehicle)
    if seat == "follow":
        _exchange_actuation(spec, _VELOCITY)
    elif seat == "transfer-function":
        file = config.transfer_function or REFERENCE_GIMBAL
        _exchange_actuation(spec, TransferFunctionModel.read(file))
    motor.fit_stated_motor(spec)
    notes += tuple(text.data for text in spec.texts if text.name.startswith(NOTE))
    if not is_description(config.vehicle):
        if config.vehicle is not None:  # before another motor, which changes the shape
            notes += misfits(_compiled(spec))
        if config.motor is not None:
            motor.apply_motor(spec, motor.load(config.motor, like=motor.figures_of(spec)))
    notes += motor.adapter_note(spec)
    insert_control(spec)
    if seat == "linkage":
        _set_backlash(spec, config.overrides)
        insert_backlash(spec)
    model = _compiled(spec)
    if config.vehicle or config.mechanism or config.scene not in SCENES:
        _check_meshes(model)
        _check_meaning(model, seat)
    return Built(model, seat, notes, composed.traced)


def _checked_dt(dt: float) -> float:
    if not 0 < dt <= LARGEST_MODEL_DT:
        raise TwinError(f"--dt {dt}: the physics step must lie in 0 < dt ≤ {LARGEST_MODEL_DT} s")
    return dt


def _seat(spec: mujoco.MjSpec, config: ModelConfig) -> Moved:
    joints = {joint.name for joint in spec.joints}
    if joints.isdisjoint({"gimbal_x", "gimbal_y"}):
        return "fixed"
    return config.gimbal


# A joint that follows is commanded a rate, so that its angle has no jumps within a tick.
_INTEGRATOR, _NONE = Channel((1.0,), (1.0, 0.0)), Channel((0.0,), (1.0,))
_VELOCITY = TransferFunctionModel(((_INTEGRATOR, _NONE), (_NONE, _INTEGRATOR)))


def _exchange_actuation(spec: mujoco.MjSpec, motion: TransferFunctionModel) -> None:
    """Take servos and rods out of the mechanism and let a transfer function move the joints.

    Horns and rods stay as fixed masses, so that a vehicle weighs the same; the rods are hidden,
    since they no longer end at the holder.
    """
    from twin.physics.native import actuator

    for equality in list(spec.equalities):
        if equality.name.startswith("gimbal_"):
            spec.delete(equality)
    for sensor in list(spec.sensors):
        if sensor.objname.startswith(("gimbal_servo_", "gimbal_rod_")):
            spec.delete(sensor)
    for servo in list(spec.actuators):
        if servo.name.startswith("gimbal_"):
            spec.delete(servo)
    for joint in list(spec.joints):
        if joint.name.startswith(("gimbal_servo_", "gimbal_rod_")):
            spec.delete(joint)
    for axis in AXES:
        # part of the identified motion: on top of it, it would hold the joint behind the output
        spec.joint(f"gimbal_{axis}").frictionloss = 0.0
        rod = spec.body(f"gimbal_rod_{axis}")
        for geom in () if rod is None else rod.geoms:
            geom.group = HIDDEN
        end = spec.site(f"gimbal_rod_{axis}_end")
        if end is not None:  # a plant with these sites has loops
            spec.delete(end)
    actuator.attach(spec, motion, spec.option.timestep)


def of_backlash(overrides: Mapping[str, float]) -> dict[str, float]:
    """Overrides of the backlash, which needs further joints and so decides what is compiled."""
    found = {name: override.NAME.fullmatch(name) for name in overrides}
    return {
        name: overrides[name]
        for name, match in found.items()
        if match and match["owner"] == "gimbal_backlash" and not match["attribute"]
    }


def _set_backlash(spec: mujoco.MjSpec, overrides: Mapping[str, float]) -> None:
    """Apply overrides of the backlash before compilation."""
    numeric = spec.numeric("gimbal_backlash")
    if numeric is None:
        return
    data = [*numeric.data, *[0.0] * (numeric.size - len(numeric.data))]
    for name, value in of_backlash(overrides).items():
        place = int(name.partition("[")[2].rstrip("]") or 0)
        if place < len(data):  # an index that is too large is refused with all other overrides
            data[place] = value
    numeric.data = data


def _check_meshes(model: mujoco.MjModel) -> None:
    """Refuse meshes that give mass and are not closed; tests check the shipped ones."""
    from meshes import MeshError, check_model

    try:
        check_model(model)
    except MeshError as error:
        raise TwinError(str(error)) from error


def _check_meaning(model: mujoco.MjModel, seat: str) -> None:
    """Refuse a file whose sizes, masses or commands are not what the names promise."""
    check_motor(model)
    if seat != "fixed":
        check_frame(model)
        check_mechanism(model)
    if seat == "linkage":
        check_response(model)


def _compiled(spec: mujoco.MjSpec) -> mujoco.MjModel:
    try:
        return spec.compile()
    except ValueError as error:
        raise TwinError(f"the model does not compile: {one_line(error)}") from error


def _require(spec: mujoco.MjSpec, seat: str, *, vehicle: bool) -> None:
    """Refuse a model without a name that the loop needs; the message lists all missing ones."""
    groups = {"vehicle": vehicle, "gimbal": seat != "fixed", "linkage": seat == "linkage"}
    missing = [
        f"{kind} {name!r}"
        for group, needed in groups.items()
        if needed
        for kind, name in NEEDED[group]
        if getattr(spec, kind)(name) is None
    ]
    if missing:
        raise TwinError(f"the model lacks {', '.join(missing)}; docs/vehicles.md describes them")
