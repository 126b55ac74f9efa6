"""What a run amounts to: numbers for machines, one screen for people."""

from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from analysis.report.figures import AxisFigures
    from analysis.timing import Verdict


@dataclass(frozen=True)
class FlightResult:
    """A flight in numbers; None where a number has no meaning for it.

    Attributes
    ----------
    recording : file written
    ended : why the flight ended
    mass_kg : at launch
    flight_time_s : from time zero to the end
    max_speed_m_s : of the gimbal pivot
    powered_slant_range_m : distance from the launch point when the motor burned out
    max_height_m : above the launch point
    target_m : point steered to, east north up from the launch point
    closest_approach_m : to that point
    attitude_error_rms_deg : angle between nose and setpoint while the motor burned
    physics_steps, physics_s : steps taken, and the time they took
    wall_s : time of the whole command
    warnings : MuJoCo's warnings with their counts
    fault : what went wrong with the rig first; None where nothing did
    turntable_rms_deg : of the difference between the vehicle's turn and what the base's IMU told
        of it, while the motor burned; None without a turntable
    timing : whether real time left the flight what it was meant to be; None in lockstep
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
    wall_s: float
    warnings: dict[str, int]
    fault: str | None = None
    turntable_rms_deg: float | None = None
    timing: "Verdict | None" = None

    @property
    def passed(self) -> bool:
        """Whether nothing was wrong with the rig."""
        return self.fault is None

    def as_dict(self) -> dict[str, object]:
        """JSON values, in SI but where the name says otherwise."""
        timing = None if self.timing is None else self.timing.as_dict()
        return {**asdict(replace(self, timing=None)), "timing": timing}

    def text(self) -> str:
        """One screen."""
        rows = [
            ("ended", f"{self.ended}, after {self.flight_time_s:.2f} s"),
            ("launch mass", f"{self.mass_kg:.3f} kg"),
            ("top speed", f"{self.max_speed_m_s:.1f} m/s"),
            ("height", f"{self.max_height_m:.0f} m"),
        ]
        if self.powered_slant_range_m is not None:
            rows.append(("range at burnout", f"{self.powered_slant_range_m:.0f} m"))
        if self.closest_approach_m is not None and self.target_m is not None:
            place = ", ".join(f"{c:.0f}" for c in self.target_m)
            rows.append(("closest approach", f"{self.closest_approach_m:.2f} m to ({place}) m"))
        if self.attitude_error_rms_deg is not None:
            rows.append(("attitude error", f"{self.attitude_error_rms_deg:.2f}° rms under power"))
        if self.turntable_rms_deg is not None:
            rows.append(
                (
                    "attitude seen",
                    f"{self.turntable_rms_deg:.2f}° rms off under power, by the base IMU",
                )
            )
        if self.loop_closure_max_um is not None:
            rows.append(("rod closure", f"{self.loop_closure_max_um:.0f} µm at most"))
        steps = f"{self.wall_s:.2f} s for {self.physics_steps} steps"
        rows.append(("computing", f"{steps} ({self.physics_s:.2f} s of physics)"))
        rows += timing_rows(self.timing)
        rows += _trouble(self.fault, self.warnings)
        return _lines(rows, self.recording)


@dataclass(frozen=True)
class StepResult:
    """Response of a gimbal to what it was told.

    Attributes
    ----------
    signal : what that was
    figures : per axis, what the signal allows to tell, and notes on what could not be told
    excitation_s : experiment time commanded
    fault : what went wrong with the rig first; None where nothing did
    timing : whether real time left the run what it was meant to be; None in lockstep
    """

    recording: str
    gimbal: str
    signal: str
    figures: "tuple[AxisFigures, ...]"
    excitation_s: float
    physics_steps: int
    physics_s: float
    wall_s: float
    warnings: dict[str, int]
    fault: str | None = None
    timing: "Verdict | None" = None

    @property
    def passed(self) -> bool:
        """Whether nothing was wrong with the rig."""
        return self.fault is None

    def as_dict(self) -> dict[str, object]:
        """JSON values; `figures` has one row per axis and figure, null where not measurable."""
        rows = [{"axis": a.axis, **f.to_dict()} for a in self.figures for f in a.figures]
        notes = [f"{a.axis}: {note}" for a in self.figures for note in a.notes]
        others = {k: v for k, v in vars(self).items() if k not in ("figures", "timing")}
        others["timing"] = None if self.timing is None else self.timing.as_dict()
        return {**others, "figures": rows, "notes": notes}

    def text(self) -> str:
        """One screen."""
        from twin.experiments.step import lines

        rows = [("gimbal", self.gimbal), ("signal", f"{self.signal}, {self.excitation_s:.1f} s")]
        rows += lines(self.figures)
        steps = f"{self.wall_s:.2f} s for {self.physics_steps} steps"
        rows.append(("computing", f"{steps} ({self.physics_s:.2f} s of physics)"))
        rows += timing_rows(self.timing)
        rows += _trouble(self.fault, self.warnings)
        return _lines(rows, self.recording)


def timing_rows(timing: "Verdict | None") -> list[tuple[str, str]]:
    """Lines of a summary about a run in real time."""
    if timing is None:
        return []
    rows = [("timing", timing.text())]
    for name, found in (
        ("lateness", timing.lateness),
        ("sensor age", timing.sensor_age),
        ("round trip", timing.round_trip),
    ):
        if found is not None:
            median, rare, worst = (t * 1e3 for t in (found.p50, found.p99, found.worst))
            rows.append((name, f"{median:.3f} ms median, {rare:.3f} ms 99 %, {worst:.3f} ms worst"))
    if timing.lateness is not None:
        rows.append(("overruns", f"{timing.overruns} of {timing.ticks} ticks"))
    if timing.moved is not None:
        by, step = timing.moved.timing.position, timing.moved.step.position
        rows.append(("path moved", f"{by:.3g} m by timing, {step:.3g} m by the time step"))
    return rows + [("", f"without {k}: {v}") for k, v in timing.rights.items() if v != "granted"]


def _lines(rows: list[tuple[str, str]], recording: str) -> str:
    lines = [f"{name:<18}{value}" for name, value in rows]
    return "\n".join([*lines, f"{'recording':<18}{recording}", f"{'':<18}twin view {recording}"])


def _trouble(fault: str | None, warnings: dict[str, int]) -> list[tuple[str, str]]:
    rows = [] if fault is None else [("FAULT", fault)]
    return rows + [("WARNING", f"MuJoCo: {name} ×{n}") for name, n in warnings.items()]
