"""One flight: what is watched of it, and when it is over."""

import math
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from analysis.compiled import njit
from analysis.flown import GROUND
from twin.errors import TwinError
from twin.experiments.flight.result import FlightResult
from twin.experiments.flight.rocketry import figures, notes
from twin.experiments.flight.track import POSITION, VELOCITY, Track
from twin.experiments.flight.wind import wind_text
from twin.experiments.programme import Vector, start_of
from twin.loop.loop import Outcome
from twin.physics.aerodynamics.stability import margins
from twin.physics.native.ramp import ASIDE, rail
from twin.plant.plant import Plant

Array = NDArray[np.float64]
Integers = NDArray[np.int64]
PASSED = "passed the point"
PASSED_NS = 1_000_000_000  # a point counts as passed when it has been receding this long
STUCK_NS = 1_000_000_000  # a vehicle at rest on its ramp for so long after burnout stays there
AT_REST = 0.1  # m/s


def _numeric(model: mujoco.MjModel, name: str) -> Array:
    return np.asarray(model.numeric(name).data)


class Watch(NamedTuple):
    """What `watch` reads of a flight and the memory that it writes.

    Attributes
    ----------
    position, velocity, closure : views of the plant's state
    fixed : (10,) launch point, point steered to (NaN without), ramp: length [m] and direction
    times : (2,) of burnout and ignition [ns]
    most : (5,) largest closure, closest distance, place of the burnout
    marks : (6,) `ON_RAMP` to `BURNT`
    """

    position: Array
    velocity: Array
    closure: Array
    fixed: Array
    times: Integers
    most: Array
    marks: Integers


ON_RAMP, RISING, CLOSEST_NS, MOVED_NS, POWERED, BURNT = range(6)
"""Places in `Watch.marks`: on the ramp; rising; when last nearer the point than ever since the
launch; when last moved on the ramp [ns]; ticks under power; whether burnout is past."""
BURNED_OUT, LEFT_RAMP, TOPPED = 1, 2, 4
"""What `watch` reports of a tick."""
ENDS = (None, GROUND, PASSED, "never left the ramp")
"""Why a flight is over, by the number that `over` gives."""


class Flight:
    """Watches a flight tick by tick, decides when it is over, and gives its result.

    Parameters
    ----------
    target : point steered to, in the world [m]

    Attributes
    ----------
    announce : called with time [ns] and text of every event
    burnout_ns : time of burnout [ns]
    memory : for compiled code, which calls `watch` and `over`
    """

    def __init__(self, plant: Plant, target: Vector | None) -> None:
        self._plant = plant
        self._start = start_of(plant.model)
        self._target = None if target is None else np.array(target)
        self.burnout_ns = round(_burnout(plant.model) * 1e9)
        ignition_ns = round(float(_numeric(plant.model, "motor_ignition")[0]) * 1e9)
        ramp = float(_numeric(plant.model, "ramp_length")[0])
        elevation, azimuth = (
            float(_numeric(plant.model, f"ramp_{n}")[0]) for n in ("elevation", "azimuth")
        )
        self._mass = float(plant.model.body_subtreemass[plant.model.body("vehicle").id])
        aim = (math.nan,) * 3 if target is None else target
        self.memory = Watch(
            plant.position, plant.velocity, plant.closure,
            np.array([*self._start, *aim, ramp, *rail(elevation, azimuth)]),
            np.array([self.burnout_ns, ignition_ns]), np.array([0.0, math.inf, 0.0, 0.0, 0.0]),
            np.array([1, 0, -1, self.burnout_ns, 0, 0]),
        )  # fmt: skip
        self.announce: Callable[[int, str], None] = lambda *_: None

    def watch(self, time_ns: int) -> None:
        """Record what the result needs of this tick."""
        if events := watch(time_ns, self.memory):
            self.report(time_ns, events, self._plant.position, self._plant.velocity)

    def report(self, time_ns: int, events: int, position: Array, velocity: Array) -> None:
        """Announce events that `watch` gave at a position and velocity (3,)."""
        speed = math.hypot(*velocity.tolist())
        if events & BURNED_OUT:
            away = f"{self._burnout_range:.1f} m from the launch point"
            self.announce(time_ns, f"burnout at {speed:.1f} m/s, {away}")
        if events & TOPPED:
            height = float(position[2]) - self._start[2]
            self.announce(time_ns, f"apogee, {height:.1f} m above the launch point")
        if events & LEFT_RAMP:
            self.announce(time_ns, f"left the ramp after {self.memory.fixed[6]:.1f} m")

    @property
    def _burnout_range(self) -> float | None:
        """Distance from the launch point when the motor burned out [m]; None before."""
        memory = self.memory
        return math.dist(memory.most[2:5], self._start) if memory.marks[BURNT] else None

    @property
    def powered_ticks(self) -> int:
        """Ticks up to burnout."""
        return int(self.memory.marks[POWERED])

    def over(self) -> str | None:
        """Why the flight is over, or None while it is not."""
        return ENDS[over(self._plant.time_ns, self._plant.landed, self.memory)]

    def result(self, recording: Path | None, outcome: Outcome, track: Track) -> FlightResult:
        """The flight in numbers; the time of the whole command is not known yet."""
        plant, memory, landed = self._plant, self.memory, outcome.ended == GROUND
        ticks = track.ticks
        path, speed = ticks[:, POSITION], np.linalg.norm(ticks[:, VELOCITY], axis=1)
        target = None if self._target is None else self._target - self._start
        closest = None if self._target is None else _closest(path, self._target)
        return FlightResult(
            recording=str(recording or ""),
            ended=outcome.ended,
            mass_kg=self._mass,
            flight_time_s=plant.time_ns * 1e-9,
            max_speed_m_s=float(speed[: max(1, len(speed) - landed)].max()),
            powered_slant_range_m=self._burnout_range,
            max_height_m=float((path[:, 2] - self._start[2]).max()),
            target_m=None
            if target is None
            else (float(target[0]), float(target[1]), float(target[2])),
            closest_approach_m=closest,
            attitude_error_rms_deg=None
            if plant.twin.gimbal == "fixed"
            else track.error_rms_deg(self.powered_ticks),
            loop_closure_max_um=float(memory.most[0]) * 1e6 or None,
            physics_steps=plant.steps,
            physics_s=plant.computing_s,
            cpu_s=0.0,
            wall_s=0.0,
            figures=figures(track, self.burnout_ns * 1e-9, landed=landed),
            warnings=plant.warnings(),
            notes=plant.twin.notes + notes(track, landed=landed),
            wind=wind_text(plant.model),
            static_margin=_static_margin(plant.model),
        )


@njit(nogil=True)
def _away(x: float, y: float, z: float, point: Array) -> float:
    return math.sqrt((x - point[0]) ** 2 + (y - point[1]) ** 2 + (z - point[2]) ** 2)


@njit(nogil=True)
def _back_on_ramp(w: Watch) -> bool:
    """Whether a vehicle came down on its own rail, which would guide it to its foot again."""
    if w.marks[ON_RAMP] or w.marks[RISING] or w.fixed[6] <= 0.0:
        return False
    x, y, z = w.position[0] - w.fixed[0], w.position[1] - w.fixed[1], w.position[2] - w.fixed[2]
    ux, uy, uz = w.fixed[7:10]
    travel = x * ux + y * uy + z * uz
    if travel < 0.0 or x * x + y * y + z * z > w.fixed[6] ** 2:
        return False
    return _away(x, y, z, travel * w.fixed[7:10]) < 2.0 * ASIDE


@njit(nogil=True)
def watch(time_ns: int, w: Watch) -> int:
    """Record what the result needs of a tick; gives its events."""
    x, y, z = w.position
    vx, vy, vz = w.velocity
    fixed, most, marks = w.fixed, w.most, w.marks
    burnout_ns, ignition_ns = w.times
    events = 0
    speed = vx * vx + vy * vy + vz * vz
    most[0] = max(most[0], w.closure[0], w.closure[1])
    if time_ns <= burnout_ns:
        marks[POWERED] += 1
    elif not marks[BURNT]:
        marks[BURNT] = 1
        most[2], most[3], most[4] = x, y, z
        events |= BURNED_OUT
    if marks[RISING] and vz < 0.0 and not marks[ON_RAMP]:
        events |= TOPPED
    marks[RISING] = vz > 0.0
    if marks[ON_RAMP] and _away(x, y, z, fixed[0:3]) > fixed[6] and time_ns >= ignition_ns:
        marks[ON_RAMP] = 0
        events |= LEFT_RAMP
    if marks[ON_RAMP] and speed > AT_REST**2:
        marks[MOVED_NS] = max(time_ns, burnout_ns)
    if not math.isnan(fixed[3]):
        distance = _away(x, y, z, fixed[3:6])
        if marks[ON_RAMP]:
            most[1] = distance
        elif distance < most[1]:
            most[1], marks[CLOSEST_NS] = distance, time_ns
    return events


@njit(nogil=True)
def over(time_ns: int, landed: bool, w: Watch) -> int:
    """Which of the ends a flight has come to; 0 while it goes on."""
    marks = w.marks
    if landed or _back_on_ramp(w):
        return 1
    if marks[CLOSEST_NS] >= 0 and time_ns > marks[CLOSEST_NS] + PASSED_NS:
        return 2
    if w.fixed[6] > 0.0 and marks[ON_RAMP] and time_ns > marks[MOVED_NS] + STUCK_NS:
        return 3
    return 0


def _static_margin(model: mujoco.MjModel) -> tuple[float, float] | None:
    try:
        return margins(model)
    except TwinError:
        return None


def _burnout(model: mujoco.MjModel) -> float:
    """Time of burnout [s]: the last point of the thrust curve with thrust before it."""
    time, thrust = _numeric(model, "motor_time"), _numeric(model, "motor_thrust")
    last = int(np.flatnonzero(thrust > 0)[-1]) + 1 if (thrust > 0).any() else 0
    return float(time[min(last, time.size - 1)] + _numeric(model, "motor_ignition")[0])


def _closest(track: Array, point: Array) -> float:
    """Distance of a point (3,) from the polyline through `track` (n, 3) [m]."""
    if len(track) == 1:
        return float(np.linalg.norm(track[0] - point))
    a, b = track[:-1], track[1:]
    along = b - a
    length = np.maximum(np.einsum("ij,ij->i", along, along), 1e-30)
    share = np.clip(np.einsum("ij,ij->i", point - a, along) / length, 0.0, 1.0)
    nearest = a + share[:, None] * along
    return float(np.linalg.norm(nearest - point, axis=1).min())
