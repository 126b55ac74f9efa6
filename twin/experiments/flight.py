"""One flight: when it is over, and its result."""

import math
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import mujoco
import numpy as np
from numpy.typing import NDArray

from twin.config.result import Result, Rows
from twin.errors import TwinError
from twin.experiments.programme import Vector, start_of
from twin.experiments.summary import computing_row, recording_rows, timing_rows, trouble_rows
from twin.experiments.track import POSITION, Figures, Track
from twin.loop.loop import Outcome
from twin.physics.aerodynamics.stability import margins
from twin.plant.plant import Plant

if TYPE_CHECKING:
    from analysis.timing import Verdict

Array = NDArray[np.float64]
PASSED = "passed the point"
PASSED_NS = 1_000_000_000  # a point counts as passed when it has been receding this long
STUCK_NS = 1_000_000_000  # a vehicle at rest on its ramp for so long after burnout stays there
AT_REST = 0.1  # m/s


@dataclass(frozen=True)
class FlightResult(Result):
    """A flight in numbers; None where a number has no meaning for it.

    Attributes
    ----------
    recording : file written; empty without one
    ended : why the flight ended
    mass_kg : at launch
    flight_time_s : from time zero to the end
    max_speed_m_s : of the gimbal pivot
    powered_slant_range_m : distance from the launch point when the motor burned out
    max_height_m : above the launch point
    target_m : point steered to, east north up from the launch point
    closest_approach_m : to that point
    attitude_error_rms_deg : angle between nose and setpoint while the motor burned
    physics_steps, physics_s : steps taken, and the processor time they took
    cpu_s : processor time of the whole command in this process
    wall_s : time of the whole command
    figures : the flight in the terms of rocketry; `as_dict` has them beside the others
    warnings : MuJoCo's warnings with their counts
    notes : what is worth knowing about the model, one line each
    static_margin : distance of the centre of mass ahead of the centre of pressure at launch and
        after burnout, in diameters; positive is stable; None where the model does not carry it
    within_m : largest distance that counts as reaching the point; None where none was asked for
    missed : why the point was missed, one text each; empty where it was not
    fault : what went wrong with the rig first; None where nothing did
    turntable_rms_deg : of the difference between the vehicle's turn and what the base's IMU
        measured, while the motor burned; None without a turntable
    timing : whether real time left the flight valid; None in lockstep
    """

    recording: str
    ended: str
    mass_kg: float
    flight_time_s: float
    max_speed_m_s: float
    powered_slant_range_m: float | None
    max_height_m: float
    target_m: tuple[float, float, float] | None
    closest_approach_m: float | None
    attitude_error_rms_deg: float | None
    loop_closure_max_um: float | None
    physics_steps: int
    physics_s: float
    cpu_s: float
    wall_s: float
    figures: Figures
    warnings: dict[str, int]
    notes: tuple[str, ...] = ()
    static_margin: tuple[float, float] | None = None
    within_m: float | None = None
    missed: tuple[str, ...] = ()
    fault: str | None = None
    turntable_rms_deg: float | None = None
    timing: "Verdict | None" = None

    @property
    def passed(self) -> bool:
        """Whether nothing was wrong with the rig, and a point was reached that had to be."""
        return self.fault is None and self.reached

    @property
    def reached(self) -> bool:
        """Whether the point was passed within the distance that was asked for."""
        if self.within_m is None or self.closest_approach_m is None:
            return True
        return self.closest_approach_m <= self.within_m

    def as_dict(self) -> dict[str, object]:
        """JSON values, in SI units unless the name gives another."""
        timing = None if self.timing is None else self.timing.as_dict()
        values = asdict(replace(self, timing=None))
        return {**values, **values.pop("figures"), "timing": timing}

    def rows(self) -> Rows:
        """The flight as a table."""
        rows = [
            ("ended", f"{self.ended}, after {self.flight_time_s:.2f} s"),
            ("launch mass", f"{self.mass_kg:.3f} kg"),
        ]
        if self.static_margin is not None:
            full, empty = self.static_margin
            rows.append(("static margin", f"{full:+.2f} at launch, {empty:+.2f} empty [calibres]"))
        rows += self.figures.rows(self.powered_slant_range_m)
        if self.closest_approach_m is not None and self.target_m is not None:
            place = ", ".join(f"{c:.0f}" for c in self.target_m)
            rows.append(("closest approach", f"{self.closest_approach_m:.2f} m to ({place}) m"))
            verdict = "missed because" if self.reached else "MISSED"
            titles = [verdict, *[""] * len(self.missed)]
            rows += zip(titles, self.missed, strict=False)
        if self.attitude_error_rms_deg is not None:
            rows.append(("attitude error", f"{self.attitude_error_rms_deg:.2f}° rms under power"))
        if self.turntable_rms_deg is not None:
            error = f"{self.turntable_rms_deg:.2f}° rms under power, by the base IMU"
            rows.append(("attitude estimate", error))
        if self.loop_closure_max_um is not None:
            rows.append(("rod closure", f"{self.loop_closure_max_um:.0f} µm at most"))
        rows.append(computing_row(self.wall_s, self.cpu_s, self.physics_steps, self.physics_s))
        rows += timing_rows(self.timing) + trouble_rows(self.fault, self.warnings)
        rows += [("note", note) for note in self.notes]
        return rows + recording_rows(self.recording)


def _numeric(model: mujoco.MjModel, name: str) -> Array:
    return np.asarray(model.numeric(name).data)


class Flight:
    """Watches a flight tick by tick, decides when it is over, and gives its result.

    Parameters
    ----------
    error : (2,) attitude error, as the controller writes it [rad]
    target : point steered to, in the world [m]

    Attributes
    ----------
    announce : called with time [ns] and text of every event
    burnout_ns : time of burnout [ns]
    """

    def __init__(self, plant: Plant, error: Array, target: Vector | None) -> None:
        self._plant, self._error = plant, error
        self._start = start_of(plant.model)
        self._target = None if target is None else np.array(target)
        self.burnout_ns = round(_burnout(plant.model) * 1e9)
        self._ignition_ns = round(float(_numeric(plant.model, "motor_ignition")[0]) * 1e9)
        self._ramp = float(_numeric(plant.model, "ramp_length")[0])
        self._mass = float(plant.model.body_subtreemass[plant.model.body("vehicle").id])
        self._speed = 0.0
        self._errors: list[float] = []
        self._closure = 0.0
        self._closest = math.inf
        self._closest_ns: int | None = None  # when last nearer the point than ever since the launch
        self._moved_ns = self.burnout_ns
        self._burnout_range: float | None = None
        self._on_ramp, self._rising = True, False
        self.announce: Callable[[int, str], None] = lambda *_: None

    def watch(self, time_ns: int) -> None:
        """Record what the result needs of this tick."""
        plant = self._plant
        x, y, z = plant.position.tolist()
        vx, vy, vz = plant.velocity.tolist()
        speed = vx * vx + vy * vy + vz * vz
        self._speed = max(self._speed, speed)
        if plant.closure[0] > self._closure or plant.closure[1] > self._closure:
            self._closure = float(plant.closure.max())
        if time_ns <= self.burnout_ns:
            ex, ey = self._error.tolist()
            self._errors.append(ex * ex + ey * ey)
        elif self._burnout_range is None:
            self._burnout_range = math.dist((x, y, z), self._start)
            self._report(time_ns, "burnout", self._burnout_range, vx, vy, vz)
        if self._rising and vz < 0.0 and not self._on_ramp:
            self.announce(time_ns, f"apogee, {z - self._start[2]:.1f} m above the launch point")
        self._rising = vz > 0.0
        away = math.dist((x, y, z), self._start)
        if self._on_ramp and away > self._ramp and time_ns >= self._ignition_ns:
            self._on_ramp = False
            self._report(time_ns, "left the ramp", self._ramp, vx, vy, vz)
        if self._on_ramp and speed > AT_REST**2:
            self._moved_ns = max(time_ns, self.burnout_ns)
        if self._target is not None:
            distance = math.dist((x, y, z), self._target)
            if self._on_ramp:
                self._closest = distance
            elif distance < self._closest:
                self._closest, self._closest_ns = distance, time_ns

    def _report(self, time_ns: int, what: str, distance: float, *velocity: float) -> None:
        speed = math.hypot(*velocity)
        self.announce(time_ns, f"{what} at {speed:.1f} m/s, {distance:.1f} m from the launch point")

    def over(self) -> str | None:
        """Why the flight is over, or None while it is not."""
        plant = self._plant
        if plant.landed:
            return "reached the ground"
        if self._closest_ns is not None and plant.time_ns > self._closest_ns + PASSED_NS:
            return PASSED
        held = self._ramp > 0.0 and self._on_ramp
        if held and plant.time_ns > self._moved_ns + STUCK_NS:
            return "never left the ramp"
        return None

    def result(
        self, recording: Path | None, outcome: Outcome, track: Track, cpu_s: float, wall_s: float
    ) -> FlightResult:
        """The flight in numbers."""
        plant = self._plant
        path = track.ticks[:, POSITION]
        target = None if self._target is None else self._target - self._start
        closest = None if self._target is None else _closest(path, self._target)
        return FlightResult(
            recording=str(recording or ""),
            ended=outcome.ended,
            mass_kg=self._mass,
            flight_time_s=plant.time_ns * 1e-9,
            max_speed_m_s=math.sqrt(self._speed),
            powered_slant_range_m=self._burnout_range,
            max_height_m=float((path[:, 2] - self._start[2]).max()),
            target_m=None
            if target is None
            else (float(target[0]), float(target[1]), float(target[2])),
            closest_approach_m=closest,
            attitude_error_rms_deg=math.degrees(math.sqrt(float(np.mean(self._errors)))),
            loop_closure_max_um=self._closure * 1e6 or None,
            physics_steps=plant.steps,
            physics_s=plant.computing_s,
            cpu_s=cpu_s,
            wall_s=wall_s,
            figures=track.figures(self.burnout_ns * 1e-9, landed=plant.landed),
            warnings=plant.warnings(),
            notes=plant.twin.notes,
            static_margin=_static_margin(plant.model),
        )


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
