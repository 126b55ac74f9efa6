"""The flights a convergence study varies the time step of."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache

import mujoco
import numpy as np
from numpy.typing import NDArray

from analysis.convergence import Flight, Trajectory
from twin import status
from twin.config import Converge, Fly
from twin.control import AttitudeController
from twin.errors import DivergenceError, TwinError
from twin.experiments.programme import setpoint
from twin.loop.clock import Lockstep
from twin.loop.loop import Seats, run
from twin.loop.seats import Pilot, SimulatedGimbal
from twin.plant.authority import control_config
from twin.plant.model.compose import MJCF
from twin.plant.model.model import ModelConfig, TwinModel, load
from twin.plant.plant import Plant
from twin.plant.steps.adams_bashforth import AdamsBashforth

Array = NDArray[np.float64]

INTERVAL_NS = 200_000_000  # between the instants compared, and between renewals of the mass
STEERED_DT = 0.001  # s, of the flight that leads up to the baseline
COAST = 3.0  # s after burnout that may serve as a smooth stretch
OFF_RAMP = 1.0  # s; after the ramp, whose end is not smooth
# Body rates added at the start [rad/s]: undisturbed, a trimmed vehicle flies an almost straight
# line, which every method gets right. Out of plane, so that no cross flow passes through zero.
DISTURBANCE = (0.3, -0.2, 0.5)

# Second-order steps of unequal length, with coefficients that follow the steps and with fixed ones.
JITTERED = {"ab2, jittered": True, "ab2, jittered, fixed": False}
JITTER = 0.8
GIMBALLESS = MJCF / "examples" / "large_rocket.xml"


class StudyPlant(Plant):
    """A plant whose integrator starts afresh where the command or the propellant's mass jumps.

    Both change between two calls of `advance` only. Slopes remembered from before a jump would
    make every multi-step method first order.
    """

    renewal_ns = INTERVAL_NS
    divides = False

    def advance(self, n: int) -> None:
        """Take `n` physics steps without memory of earlier ones."""
        self._stepper.restart()
        super().advance(n)

    def advance_by(self, steps: Array) -> None:
        """Take steps of the given lengths (n,) [s], which add up to n steps of the plant's own."""
        self._stepper.restart()
        self._propellant.update(self.time_ns * 1e-9)
        for dt in steps:
            self._stepper.step(self.model, self.data, 1, dt=float(dt))
        self.steps += len(steps)

    def jitter(self, *, variable: bool) -> None:
        """Put Adams–Bashforth 2 in place, with variable or fixed coefficients."""
        self._stepper = AdamsBashforth(2, variable=variable)

    def place(self, start: "Start") -> None:
        """Begin from a state with the gimbal at rest in its middle."""
        self.data.qpos[:], self.data.qvel[:] = start.position, start.velocity
        self.gimbal_angle[:] = 0.0
        self.gimbal_rate[:] = 0.0
        self.steps = start.time_ns // self.dt_ns
        self.data.time = self.time_ns * 1e-9
        mujoco.mj_forward(self.model, self.data)


@dataclass(frozen=True)
class Start:
    """State (nq,), (nv,) at an instant of a steered flight."""

    time_ns: int
    position: Array
    velocity: Array


def flight(config: Converge) -> Flight:
    """The flight that a study is about."""
    fly = baseline(config) if config.flight == "baseline" else closed_loop(config)

    def announced(integrator: str, step: float) -> Trajectory | None:
        status.say(f"{config.flight} with {integrator} at {step * 1e3:.4g} ms")
        return fly(integrator, step)

    return announced


def jittered(config: Converge) -> Flight:
    """The baseline of a vehicle without gimbal, which may step at any length.

    A transfer-function gimbal is exact for one step only, so that its vehicle cannot.
    """
    return baseline(replace(config, vehicle=GIMBALLESS, mechanism=None, motor=None, set=()))


def baseline(config: Converge) -> Flight:
    """Free flight from the middle of a steered one on, the gimbal at rest.

    The thesis's baseline (§ Numerical stability: no hardware, no transfer function), kept within
    one straight piece of the thrust curve, so that everything that acts is smooth.

    Raises
    ------
    TwinError : the thrust curve has no straight piece long enough
    """
    config = replace(config, gimbal="transfer-function")
    begin_ns, count = _window(_load(config, STEERED_DT).mj, config.duration_s)
    start = _steered(config, begin_ns)
    load_once = lru_cache(maxsize=None)(lambda dt: _load(config, dt))

    def fly(name: str, dt: float) -> Trajectory | None:
        per = _steps(INTERVAL_NS, dt, "the instants compared")
        plant = StudyPlant(load_once(dt), "ab2" if name in JITTERED else name)
        if name in JITTERED:
            plant.jitter(variable=JITTERED[name])
        plant.place(start)
        rng = np.random.default_rng(config.seed)
        trace = _Trace(plant)
        try:
            for _ in range(count):
                if name in JITTERED:
                    plant.advance_by(_jittered(rng, per, INTERVAL_NS * 1e-9))
                else:
                    plant.advance(per)
                trace.keep(plant.time_ns)
        except DivergenceError:
            return None
        return trace.trajectory()

    return fly


def closed_loop(config: Converge) -> Flight:
    """The steered flight from the launch on, the controller sampled at its own rate."""
    tick_ns = tick_of(config)
    # whole ticks nearest to the interval
    every = max(1, round(INTERVAL_NS / tick_ns)) * tick_ns
    end_ns = round(config.duration_s * 1e9)
    load_once = lru_cache(maxsize=None)(lambda dt: _load(config, dt))

    def fly(name: str, dt: float) -> Trajectory | None:
        loop = Loop(load_once(dt), name, config, tick_ns)
        trace = _Trace(loop.plant)

        def sample(time_ns: int) -> None:
            if time_ns and time_ns % every == 0:
                trace.keep(time_ns)

        try:
            loop.run(end_ns, sample)
        except DivergenceError:
            return None
        return trace.trajectory()

    return fly


class Loop:
    """Vehicle, gimbal and attitude loop, ready to run."""

    def __init__(self, model: TwinModel, integrator: str, config: Converge, tick_ns: int) -> None:
        self.plant = plant = StudyPlant(model, integrator)
        if not plant.has_vehicle:
            raise TwinError("the model has no joint 'vehicle' to fly")
        self.steps = _steps(tick_ns, plant.dt_ns * 1e-9, "the control period")
        programme, _ = setpoint(Fly(vehicle=config.vehicle), plant.model)
        controller = AttitudeController(control_config(plant.model))
        pilot = Pilot(plant, controller, programme, tick_ns * 1e-9)
        self.seats = Seats(plant, SimulatedGimbal(plant), pilot, Lockstep())
        self.command: Array = np.zeros(2)

    def run(self, end_ns: int, each: Callable[[int], None] = lambda _: None) -> None:
        """Fly until `end_ns`, calling `each` before every tick's physics."""
        run(
            self.seats,
            steps_per_tick=self.steps,
            duration_ns=end_ns,
            command=self.command,
            each_tick=(each,),
        )
        each(self.plant.time_ns)


def tick_of(config: Converge) -> int:
    """Control period [ns].

    Raises
    ------
    TwinError : it is not a whole number of nanoseconds
    """
    if not 0 < config.control_hz <= 1e5 or (1e9 / config.control_hz) % 1.0:
        raise TwinError(
            f"--control-hz {config.control_hz:g}: the period must be a whole number of nanoseconds,"
            " for example 250"
        )
    return round(1e9 / config.control_hz)


def load_for(config: Converge) -> Callable[[float], TwinModel]:
    """Models of the study's flight by time step [s]."""
    return lambda dt: _load(config, dt)


def _load(config: Converge, dt: float) -> TwinModel:
    return load(
        ModelConfig(
            gimbal=config.gimbal,
            transfer_function=config.model,
            vehicle=config.vehicle,
            mechanism=config.mechanism,
            motor=config.motor,
            overrides=config.overrides,
            dt=dt,
            seed=config.seed,
        )
    )


def _steered(config: Converge, end_ns: int) -> Start:
    loop = Loop(_load(config, STEERED_DT), "implicitfast", config, tick_of(config))
    loop.run(end_ns)
    plant = loop.plant
    if plant.landed:
        raise TwinError(
            f"the vehicle is on the ground before {end_ns * 1e-9:g} s, where this study begins;"
            " --flight closed-loop begins at the launch: give it, with a --duration-s that ends in"
            " flight"
        )
    plant.rate += DISTURBANCE
    return Start(end_ns, plant.data.qpos.copy(), plant.data.qvel.copy())


def _window(model: mujoco.MjModel, longest: float) -> tuple[int, int]:
    """Begin [ns] and number of intervals within the longest straight piece of the thrust curve."""
    time, thrust = (np.asarray(model.numeric(f"motor_{n}").data) for n in ("time", "thrust"))
    knots = np.unique(time[: int(np.flatnonzero(thrust > 0.0)[-1]) + 2]) if thrust.any() else time
    knots = np.append(knots, knots[-1] + COAST) + model.numeric("motor_ignition").data[0]
    knots = np.maximum(knots, OFF_RAMP)
    k = int(np.argmax(np.diff(knots)))
    first = math.ceil(knots[k] * 1e9 / INTERVAL_NS)
    count = math.floor(min(knots[k + 1] * 1e9 / INTERVAL_NS - first, longest * 1e9 / INTERVAL_NS))
    if count < 2:
        raise TwinError(
            f"no straight piece of the thrust curve holds two intervals of {INTERVAL_NS * 1e-9} s"
            f" within --duration-s {longest:g}; --flight closed-loop needs none"
        )
    return first * INTERVAL_NS, count


def _steps(span_ns: int, dt: float, what: str) -> int:
    dt_ns = round(dt * 1e9)
    if dt_ns <= 0 or span_ns % dt_ns:
        raise TwinError(
            f"--dt-ms {dt * 1e3:g}: {what}, {span_ns * 1e-6:g} ms, must be a whole multiple of it"
        )
    return span_ns // dt_ns


def _jittered(rng: np.random.Generator, n: int, span: float) -> Array:
    lengths = 1.0 + rng.uniform(-JITTER, JITTER, n)
    return np.asarray(lengths * (span / lengths.sum()))


class _Trace:
    """Copies of the vehicle's state at the instants compared."""

    def __init__(self, plant: Plant) -> None:
        self._plant = plant
        self._kept: list[tuple[float, Array, Array]] = []

    def keep(self, time_ns: int) -> None:
        plant = self._plant
        if not plant.position @ plant.position < 1e12:
            raise DivergenceError("the vehicle is more than 1000 km away")
        self._kept.append((time_ns * 1e-9, plant.position.copy(), plant.attitude.copy()))

    def trajectory(self) -> Trajectory:
        time, position, attitude = (np.array(c) for c in zip(*self._kept, strict=True))
        return Trajectory(time, position, attitude)
