"""Did real time spoil this run? Lateness, ages and round trips, and how far they moved the path.

What a run would have been without its delays is asked of a flight that is handed in; nothing here
knows what flies.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Literal

import numpy as np

from analysis.array import Array
from analysis.convergence import Distance, Trajectory, distance
from analysis.delays import (
    Delays,
    Percentiles,
    loop_delay,
    percentiles,
    recorded_percentiles,
    recorded_values,
)
from analysis.plain import Plain
from analysis.recording.series import Recording
from analysis.schema import AnalysisError

GRANTED = "granted"  # the word for a right that a loop had
FEWEST = 100  # ticks: of fewer, one alone is above the 99th percentile
REFINED = 4  # times finer than it was flown, for the error of the time step


# Flies a recorded run again: with delays or on time, and with time steps finer by a whole factor.
Rerun = Callable[[Delays | None, int], Trajectory]


@dataclass(frozen=True, slots=True)
class Split(Plain):
    """Where a command's way to the gimbal and the answer's way back spend their time, medians [s].

    Attributes
    ----------
    host : from the deadline of a tick to its beginning
    wire : bytes on the line, both ways, by its speed
    device : the rest of a round trip: handling, waiting for the next telemetry frame
    frame : waiting for the next pulse; not part of a round trip, and part of the gimbal's own
        identified delay
    """

    host: float
    wire: float
    device: float
    frame: float


@dataclass(frozen=True, slots=True)
class Moved(Plain):
    """How far the path was moved, by flights that differ in one thing only.

    Attributes
    ----------
    timing : by the delays that were measured
    step : by the time step, against one four times finer
    unexplained : from the recorded path to the flight with the same delays: what the re-run's
        model does not know; None where nothing of the vehicle was recorded
    path : length flown [m]
    """

    timing: Distance
    step: Distance
    unexplained: Distance | None
    path: float


@dataclass(frozen=True, slots=True)
class Limits:
    """What a valid run may have.

    Attributes
    ----------
    overruns : share of the ticks that began after the next had been due to begin
    lateness : 99th percentile, in control periods
    delay : 99th percentile of the loop's delay, in control periods: the sampling itself costs one
    moved : of the length flown
    """

    overruns: float = 1e-3
    lateness: float = 0.25
    delay: float = 2.0
    moved: float = 0.005


@dataclass(frozen=True, slots=True)
class Verdict(Plain):
    """One word, and why.

    Attributes
    ----------
    word : whether timing left the run what it was meant to be; a run of fewer than 100 ticks that
        breaks no limit is not judged
    reasons : every limit that was broken, and what the machine denied where ticks were late
    overruns : ticks that were not begun in time because the loop was busy
    stolen : time that the host withheld from a virtual machine meanwhile [s]
    lateness, sensor_age, round_trip, delay : None where not recorded; `delay` is the loop's
    """

    word: Literal["valid", "invalid", "not judged"]
    reasons: tuple[str, ...]
    ticks: int
    period: float
    overruns: int
    lateness: Percentiles | None
    sensor_age: Percentiles | None
    round_trip: Percentiles | None
    delay: Percentiles | None
    split: Split | None
    moved: Moved | None
    rights: Mapping[str, str] = field(default_factory=lambda: MappingProxyType({}))
    stolen: float = 0.0

    def as_dict(self) -> dict[str, object]:
        """JSON values in SI; None where unknown."""
        content = Plain.to_dict(self)
        renamed = {"word": "verdict", "period": "period_s", "stolen": "stolen_s"}
        return {renamed.get(name, name): value for name, value in content.items()}

    def text(self) -> str:
        """One line: the word and why."""
        return f"{self.word}: {'; '.join(self.reasons)}" if self.reasons else self.word


def assess(
    recording: Recording,
    period: float,
    *,
    rerun: Rerun | None = None,
    overruns: int | None = None,
    wire: float = 0.0,
    frame: float = 0.0,
    limits: Limits | None = None,
    rights: Mapping[str, str] = MappingProxyType({}),
    stolen: float = 0.0,
) -> Verdict:
    """Judge one recording.

    Parameters
    ----------
    period : of the control ticks [s]
    rerun : flies the run again; without it nothing is said about the path
    overruns : as the clock counted them; else the ticks a whole period late or more
    wire : time of a round trip's bytes on the line [s]
    frame : mean wait for the next pulse [s]
    rights : what the loop asked the system for, and "granted" or why not
    stolen : time that the host withheld from this virtual machine, all processors together [s]

    Raises
    ------
    AnalysisError : the recording says nothing about timing, or the period is not positive
    """
    if not period > 0.0:
        raise AnalysisError(f"a control period of {period} s; it must be greater than zero")
    late, delays = recorded_values(recording, "timing/lateness"), loop_delay(recording)
    if late is None and delays is None:
        raise AnalysisError("the recording holds no timing: it was not flown on the wall clock")
    lateness = None if late is None else late[1]
    ticks = len(lateness) if lateness is not None else 0
    if overruns is None:
        overruns = 0 if lateness is None else int((lateness >= period).sum())
    found = Verdict(
        word="valid",
        reasons=(),
        ticks=ticks,
        period=period,
        overruns=overruns,
        lateness=None if lateness is None else percentiles(lateness),
        sensor_age=recorded_percentiles(recording, "timing/sensor_age"),
        round_trip=recorded_percentiles(recording, "timing/round_trip"),
        delay=None if delays is None else percentiles(delays.value),
        split=None,
        moved=None if rerun is None else moved(recording, delays, rerun),
        rights=rights,
        stolen=stolen,
    )
    return _judged(found, limits or Limits(), wire, frame)


def moved(recording: Recording, delays: Delays | None, rerun: Rerun) -> Moved:
    """How far the recorded delays and the time step moved the path."""
    on_time, finer = rerun(None, 1), rerun(None, REFINED)
    delayed = on_time if delays is None else rerun(delays, 1)
    length = float(np.linalg.norm(np.diff(delayed.position, axis=0), axis=1).sum())
    flown = _flown(recording, delayed.time)
    return Moved(
        _apart(delayed, on_time),
        _apart(on_time, finer),
        None if flown is None else _apart(flown, delayed),
        length,
    )


def _blamed(v: Verdict, limits: Limits) -> list[str]:
    """What the machine denied the loop, where ticks were late."""
    late = v.lateness is not None and v.lateness.p99 > limits.lateness * v.period
    if not late and v.overruns <= limits.overruns * v.ticks:
        return []
    refused = [name for name, label in v.rights.items() if label != GRANTED]
    blamed = [f"it ran without {' and '.join(refused)}"] if refused else []
    if v.stolen > v.period:
        blamed.append(f"the host withheld {v.stolen * 1e3:.0f} ms from this virtual machine")
    return blamed


def _judged(v: Verdict, limits: Limits, wire: float, frame: float) -> Verdict:
    reasons = []
    if v.ticks and v.overruns > limits.overruns * v.ticks:
        reasons.append(f"{v.overruns} of {v.ticks} ticks overran")
    for label, found, limit in (
        ("ticks began late by", v.lateness, limits.lateness),
        ("the loop was delayed by", v.delay, limits.delay),
    ):
        if found is not None and found.p99 > limit * v.period:
            worst, most = found.p99 * 1e3, limit * v.period * 1e3
            reasons.append(f"{label} {worst:.3g} ms (99 %), {most:.3g} ms is the limit")
    if v.moved is not None:
        most = limits.moved * v.moved.path
        for cause, by in (("timing", v.moved.timing), ("the time step", v.moved.step)):
            if not by.position <= most:
                reasons.append(
                    f"{cause} moved the path by {by.position:.3g} m, {most:.3g} m is the limit"
                )
    reasons += _blamed(v, limits)
    word: Literal["valid", "invalid", "not judged"] = "invalid" if reasons else "valid"
    seen = v.ticks or (v.delay.n if v.delay is not None else 0)
    if not reasons and seen < FEWEST:
        word, reasons = "not judged", [f"{seen} of at least {FEWEST} ticks"]
    split = None
    if v.round_trip is not None:
        host = v.lateness.p50 if v.lateness is not None else 0.0
        split = Split(host, wire, max(0.0, v.round_trip.p50 - wire), frame)
    kept = {name: getattr(v, name) for name in Verdict.__slots__}
    return Verdict(**{**kept, "word": word, "reasons": tuple(reasons), "split": split})


def _flown(recording: Recording, time: Array) -> Trajectory | None:
    """The recorded path at the instants of a re-run that it reaches."""
    series = recording.series
    if "vehicle/position" not in series or "vehicle/attitude" not in series:
        return None
    position, attitude = series["vehicle/position"], series["vehicle/attitude"]
    # control periods of either differ by less than a millionth: whole steps of whole nanoseconds
    late = 1e-9 + 1e-6 * time
    rows = np.searchsorted(position.time, time - late)
    rows = rows[rows < len(position.time)]
    if not rows.size or (np.abs(position.time[rows] - time[: rows.size]) > late[: rows.size]).any():
        return None
    return Trajectory(
        time[: rows.size].copy(), position.values[rows].copy(), attitude.values[rows].copy()
    )


def _apart(a: Trajectory, b: Trajectory) -> Distance:
    """Distance over the time both flew; one may have met the ground earlier."""
    n = min(len(a.time), len(b.time))
    if not n:
        return Distance(math.nan, math.nan)
    return distance(_cut(a, n), _cut(b, n))


def _cut(t: Trajectory, n: int) -> Trajectory:
    return t if len(t.time) == n else Trajectory(t.time[:n], t.position[:n], t.attitude[:n])
