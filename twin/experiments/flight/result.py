"""A flight in numbers."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from typing import TYPE_CHECKING

from twin.config.result import Result, Rows
from twin.experiments.flight.figures import Figures
from twin.experiments.summary import computing_row, recording_rows, timing_rows, trouble_rows

if TYPE_CHECKING:
    from analysis.timing import Verdict

OF_MACHINE = ("recording", "physics_steps", "physics_s", "cpu_s", "wall_s", "timing", "warnings")


@dataclass(frozen=True)
class Opening:
    """When a parachute opened [s]; height above the launch point [m], speed [m/s] just before."""

    time_s: float
    height_m: float
    speed_m_s: float

    def text(self) -> str:
        """Speed and height."""
        return f"{self.speed_m_s:.1f} m/s, {self.height_m:.1f} m above the launch point"


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
    attitude_error_rms_deg : angle between nose and setpoint while the motor burned; None without
        a gimbal
    physics_steps, physics_s : steps taken, however each was divided, and the processor time of
        stepping, in compiled flights that of whole ticks
    cpu_s : processor time of the whole command in this process
    wall_s : time of the whole command
    figures : the flight in the terms of rocketry; `as_dict` has them beside the others
    warnings : MuJoCo's warnings with their counts
    notes : what is worth knowing about the model and the launch, one line each
    wind : mean and gusts in words; empty without wind
    static_margin : distance of the centre of mass ahead of the centre of pressure at launch and
        after burnout, in diameters; positive is stable; None where the model does not carry it
    within_m : largest distance that counts as reaching the point; None where none was asked for
    missed : why the point was missed, one text each; empty where it was not
    fault : what went wrong with the rig first; None where nothing did
    turntable_rms_deg : of the difference between the vehicle's turn and what the base's IMU
        measured, while the motor burned; None without a turntable
    parachutes : those that opened, by name
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
    wind: str = ""
    static_margin: tuple[float, float] | None = None
    within_m: float | None = None
    missed: tuple[str, ...] = ()
    fault: str | None = None
    turntable_rms_deg: float | None = None
    timing: "Verdict | None" = None
    parachutes: Mapping[str, Opening] = field(default_factory=dict)

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

    def kept(self) -> dict[str, object]:
        """The figures that a recording keeps: those of the flight, not of this machine."""
        return {k: v for k, v in self.as_dict().items() if k not in OF_MACHINE}

    def rows(self) -> Rows:
        """The flight as a table."""
        rows = [
            ("ended", f"{self.ended}, after {self.flight_time_s:.2f} s"),
            ("launch mass", f"{self.mass_kg:.3f} kg"),
        ]
        if self.wind:
            rows.append(("wind", self.wind))
        if self.static_margin is not None:
            full, empty = self.static_margin
            rows.append(("static margin", f"{full:+.2f} at launch, {empty:+.2f} empty [calibres]"))
        rows += self.figures.rows(self.powered_slant_range_m)
        rows += [(k, f"opens at {o.time_s:.2f} s, {o.text()}") for k, o in self.parachutes.items()]
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
