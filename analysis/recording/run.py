"""One recording as the report sees it: a label, and per axis what was commanded and what moved."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from analysis.identify import Record
from analysis.recording.reader import Recording, TimeSeries
from analysis.schema import AnalysisError

Array = NDArray[np.float64]

LONGEST_LABEL = 60  # characters


class ReportError(AnalysisError):
    """Something no report can be made of, told in one line."""


@dataclass(frozen=True, slots=True)
class AxisRecord:
    """One axis of a run; arrays are read-only.

    Attributes
    ----------
    name : of the axis
    time, command : stamps [s] (n,) and commanded angles [rad] (n,)
    angle_time, angle : stamps [s] (m,) and angles [rad] (m,), gaps left out
    """

    name: str
    time: Array
    command: Array
    angle_time: Array
    angle: Array

    def active(self) -> "AxisRecord":
        """The part in which this axis is commanded, and as long a rest after it as before.

        Both axes are usually excited in turn; what the other one does is no part of the answer.
        """
        rows = np.flatnonzero(np.diff(self.command) != 0.0) + 1
        if len(rows) == 0:
            return self
        rest = float(np.diff(self.time[rows]).max(initial=0.2))
        low, high = self.time[rows[0]] - min(rest, 1.0), self.time[rows[-1]] + min(rest, 1.0)
        # the command in force at the beginning may have been given long before
        first = max(int(np.searchsorted(self.time, low, side="right")) - 1, 0)
        a = (self.time >= self.time[first]) & (self.time <= high)
        b = (self.angle_time >= low) & (self.angle_time <= high)
        return AxisRecord(
            self.name, self.time[a], self.command[a], self.angle_time[b], self.angle[b]
        )


@dataclass(frozen=True, slots=True)
class Run:
    """One recording.

    Attributes
    ----------
    label : what it is called throughout the report; no two runs share one
    recording : where it comes from
    motion : `measured`, or `simulated` where nothing was measured
    axes : those that were commanded and seen
    shift : added to the recording's stamps, to lay the run over the first one [s]
    """

    label: str
    recording: Recording
    motion: str
    axes: tuple[AxisRecord, ...]
    shift: float = 0.0

    def axis(self, name: str) -> AxisRecord | None:
        """Return the axis of that name, if the run has it."""
        return next((a for a in self.axes if a.name == name), None)


def run_of(recording: Recording, label: str | None = None) -> Run:
    """Take a recording apart into axes.

    Raises
    ------
    ReportError
        if it holds no gimbal command, or no gimbal angle.
    """
    series = recording.series
    motion = "measured" if "gimbal/measured" in series else "simulated"
    for name in ("gimbal/command", f"gimbal/{motion}"):
        if name not in series:
            held = ", ".join(series) or "nothing"
            raise ReportError(f"{label or 'the recording'} has no {name}; it holds {held}")
    command, angle = series["gimbal/command"], series[f"gimbal/{motion}"]
    axes = []
    for name in command.components:
        if name not in angle.components:
            continue
        u, y = command.column(name), angle.column(name)
        asked, seen = np.isfinite(u), np.isfinite(y)
        if asked.sum() < 2 or seen.sum() < 16:
            continue
        axes.append(AxisRecord(name, command.time[asked], u[asked], angle.time[seen], y[seen]))
    if not axes:
        raise ReportError(f"{label or 'the recording'} has no axis with command and readings")
    return Run(label or _label(recording), recording, motion, tuple(axes))


def recording_of(record: Record) -> Recording:
    """A table's measurement as a recording, so that anybody's CSV makes a report.

    Raises
    ------
    ReportError
        if it has no angles, or not one command for every angle.
    """
    if record.angle is None or record.angle.shape[1] != record.input.shape[1]:
        seen = 0 if record.angle is None else record.angle.shape[1]
        raise ReportError(
            f"{record.name}: {seen} angles for {record.input.shape[1]} commands; a report needs one"
            " angle for every command"
        )
    # the last command holds to the end of the record
    last = record.input_time[-1:] < record.time[-1]
    time = np.append(record.input_time, record.time[-1:][last])
    command = np.concatenate([record.input, record.input[-1:][last]])
    series = {
        "gimbal/command": TimeSeries("gimbal/command", time, command, "rad", record.outputs),
        "gimbal/measured": TimeSeries(
            "gimbal/measured", record.time, record.angle, "rad", record.outputs
        ),
    }
    return Recording({"configuration": {"gimbal": record.name}}, series)


def runs_of(
    recordings: Sequence[Recording], labels: Sequence[str] | None = None
) -> tuple[Run, ...]:
    """Take recordings apart; equal labels are numbered.

    Raises
    ------
    ReportError
        for no recording at all, or one that no report can be made of.
    """
    if not recordings:
        raise ReportError("no recording to report on")
    if labels is not None and len(labels) != len(recordings):
        raise ReportError(f"{len(labels)} labels for {len(recordings)} recordings")
    asked = list(labels) if labels is not None else [_label(r) for r in recordings]
    names = [
        f"{name} {asked[: k + 1].count(name)}" if asked.count(name) > 1 else name
        for k, name in enumerate(asked)
    ]
    return tuple(run_of(r, name) for r, name in zip(recordings, names, strict=True))


def aligned(runs: Sequence[Run]) -> tuple[Run, ...]:
    """Lay every run over the first one by the first change of its command, never by its answer.

    Flights stay as they are: they begin with the ignition, and their commands are answers too.
    """
    begins = [_begin(run) for run in runs]
    first = begins[0]
    return tuple(
        run if first is None or begin is None else _shifted(run, first - begin)
        for run, begin in zip(runs, begins, strict=True)
    )


def _begin(run: Run) -> float | None:
    if in_flight(run):
        return None
    rows = [(a.time, np.flatnonzero(np.diff(a.command) != 0.0)) for a in run.axes]
    return min((float(t[r[0] + 1]) for t, r in rows if len(r)), default=None)


def _shifted(run: Run, shift: float) -> Run:
    if abs(shift) < 1e-6:
        return run
    axes = tuple(replace(a, time=a.time + shift, angle_time=a.angle_time + shift) for a in run.axes)
    return replace(run, axes=axes, shift=shift)


def in_flight(run: Run) -> bool:
    """Whether a controller that saw the gimbal's answers gave the commands."""
    return run.recording.properties.get("command") == "fly"


def _label(recording: Recording) -> str:
    gimbal = recording.setting("gimbal")
    return gimbal[:LONGEST_LABEL] if isinstance(gimbal, str) and gimbal.strip() else "run"
