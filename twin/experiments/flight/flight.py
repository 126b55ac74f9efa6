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
from twin.experiments.flight.burnout import at_burnout
from twin.experiments.flight.result import FlightResult, Opening
from twin.experiments.flight.rocketry import figures, notes
from twin.experiments.flight.track import POSITION, VELOCITY, Track
from twin.experiments.flight.wind import wind_text
from twin.experiments.programme import Vector, start_of
from twin.loop.loop import Outcome
from twin.physics.aerodynamics.stability import margins
from twin.physics.native.ramp import ASIDE, rail
from twin.physics.native.recovery import is_open
from twin.plant.authority import numeric
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
    times : (3,) of burnout, of ignition and from which on parachutes may open [ns]
    most : (6,) largest closure, closest distance, place of the burnout, speed there
    marks : (6,) `ON_RAMP` to `BURNT`
    last : (2, 7) the two ticks before: time [s], position, velocity; NaN where there is none
    chutes : (k, 5) of each parachute `chute_delay` and `chute_height`; when it opened [s], height
        above the launch point and speed just before, NaN where it is closed
    """

    position: Array
    velocity: Array
    closure: Array
    fixed: Array
    times: Integers
    most: Array
    marks: Integers
    last: Array
    chutes: Array


ON_RAMP, RISING, CLOSEST_NS, MOVED_NS, POWERED, BURNT = range(6)
"""Places in `Watch.marks`: on the ramp; rising; when last nearer the point than ever since the
launch; when last moved on the ramp [ns]; ticks under power; whether burnout is past."""
BURNED_OUT, LEFT_RAMP, TOPPED, OPENED = 1, 2, 4, 8
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
            np.array([self.burnout_ns, ignition_ns, self._over_ns(ignition_ns)]),
            np.array([0.0, math.inf, 0.0, 0.0, 0.0, 0.0]),
            np.array([1, 0, -1, self.burnout_ns, 0, 0]),
            np.full((2, 7), math.nan), _chutes(plant.model),
        )  # fmt: skip
        self.announce: Callable[[int, str], None] = lambda *_: None

    def _over_ns(self, ignition_ns: int) -> int:
        """Time from which on parachutes may open: the end of the thrust curve, zeros included."""
        return ignition_ns + round(float(_numeric(self._plant.model, "motor_time")[-1]) * 1e9)

    def watch(self, time_ns: int) -> None:
        """Record what the result needs of this tick."""
        if events := watch(time_ns, self.memory):
            self.report(time_ns, events, self._plant.position)

    def report(self, time_ns: int, events: int, position: Array) -> None:
        """Announce events that `watch` gave at a position (3,)."""
        if events & BURNED_OUT:
            away = f"{self._burnout_range:.1f} m from the launch point"
            self.announce(time_ns, f"burnout at {self.memory.most[5]:.1f} m/s, {away}")
        if events & OPENED:
            for k, opening in self._openings:
                if opening.time_s == time_ns * 1e-9:
                    self.announce(time_ns, f"{self._chute(k)} opens at {opening.text()}")
        if events & TOPPED:
            height = float(position[2]) - self._start[2]
            self.announce(time_ns, f"apogee, {height:.1f} m above the launch point")
        if events & LEFT_RAMP:
            self.announce(time_ns, f"left the ramp after {self.memory.fixed[6]:.1f} m")

    @property
    def _openings(self) -> list[tuple[int, Opening]]:
        """Parachutes that have opened, by their number."""
        found = [(k, c[2:]) for k, c in enumerate(self.memory.chutes.tolist())]
        return [(k, Opening(*c)) for k, c in found if not math.isnan(c[0])]

    def _chute(self, k: int) -> str:
        several = len(self.memory.chutes) > 1
        return f"parachute {k + 1}" if several else "parachute"

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
            parachutes={self._chute(k): opening for k, opening in self._openings},
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
    burnout_ns, ignition_ns, over_ns = w.times
    events, now = 0, time_ns * 1e-9
    speed = vx * vx + vy * vy + vz * vz
    most[0] = max(most[0], w.closure[0], w.closure[1])
    if time_ns <= burnout_ns:
        marks[POWERED] += 1
    elif not marks[BURNT]:
        marks[BURNT] = 1
        most[2:5], most[5] = w.position, math.sqrt(speed)
        if not math.isnan(w.last[1, 0]):
            place, velocity = at_burnout(w.last, burnout_ns * 1e-9)
            most[2:5], most[5] = place, math.sqrt(np.sum(velocity**2))
        events |= BURNED_OUT
    for k in range(len(w.chutes)):
        chute = w.chutes[k]
        after = (time_ns - over_ns) * 1e-9
        if math.isnan(chute[2]) and is_open(after, vz, z, chute[0], chute[1]):
            chute[2], chute[3], chute[4] = now, z - fixed[2], math.sqrt(speed)
            if not math.isnan(w.last[1, 0]):  # it brakes within this tick
                chute[3] = w.last[1, 3] - fixed[2]
                chute[4] = math.sqrt(np.sum(w.last[1, 4:7] ** 2))
            events |= OPENED
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
    w.last[0] = w.last[1]
    w.last[1, 0], w.last[1, 1:4], w.last[1, 4:7] = now, w.position, w.velocity
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


def _chutes(model: mujoco.MjModel) -> Array:
    """Parachutes that pull as `Watch.chutes` (k, 5), all closed."""
    parts = [numeric(model, f"chute_{n}") for n in ("drag_area", "delay", "height")]
    if any(p is None for p in parts):
        return np.empty((0, 5))
    area, delay, height = (np.asarray(p) for p in parts)
    closed = np.full((len(area), 3), math.nan)
    return np.ascontiguousarray(np.column_stack([delay, height, closed])[area > 0.0])


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
