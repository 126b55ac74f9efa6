"""A board's recordings over time: estimates, what left its interval, when a calibration is due."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from analysis.estimate import AxisDrift
from hardware.frames import AXES
from twin.config.result import Result, Rows
from twin.evaluation.drift import RunDrift

OF_CALIBRATION = ("gain", "zero")
LIMIT = 3.0  # standard deviations, as of a control chart (Shewhart, 1931)
DAY = 86400.0  # s
FEWEST = "twin compare FILE --explain names the fewest of more effects that explain the difference"


@dataclass(frozen=True)
class Entry:
    """One recording of the board.

    Attributes
    ----------
    date : when it was made [s since 1970]; of the file where the run did not keep real time
    fit : of each axis to the model [%]
    """

    file: Path
    date: float
    drift: RunDrift
    fit: dict[str, float]

    @property
    def day(self) -> str:
        """Date and time of day, UTC."""
        return f"{datetime.fromtimestamp(self.date, UTC):%Y-%m-%d %H:%M}"


@dataclass(frozen=True)
class HistoryResult(Result):
    """A board's recordings over time.

    Attributes
    ----------
    board : its serial number
    entries : oldest first
    left_out : files without what this needs, and why
    due : properties of the calibration that left their interval, and when they will
    page : control charts
    model : what the recordings are compared with
    """

    board: str
    entries: tuple[Entry, ...]
    left_out: tuple[str, ...]
    due: tuple[str, ...]
    page: Path
    model: str

    def as_dict(self) -> dict[str, object]:
        """JSON values in SI."""
        return {
            "board": self.board,
            "model": self.model,
            "recordings": [
                {"file": str(e.file), "date": e.date, "fit": e.fit, **e.drift.as_dict()}
                for e in self.entries
            ],
            "left_out": list(self.left_out),
            "calibration_due": list(self.due),
            "page": str(self.page),
        }

    def rows(self) -> Rows:
        """A line for each recording, one for each property that left its interval."""
        rows = [("board", self.board), ("model", self.model)]
        for e in self.entries:
            fits = ", ".join(f"{a} {v:.1f} %" for a, v in e.fit.items())
            rows.append((e.day, f"fit {fits}; {e.file.name}"))
            rows += [("", text) for text in outside(e)]
        names = ", ".join(p.name for p in self.entries[0].drift.properties)
        rows.append(("", f"estimated together: {names}; {FEWEST}"))
        rows += [("left out", text) for text in self.left_out]
        rows += [("CALIBRATION DUE", text) for text in self.due]
        if not self.due:
            rows.append(
                ("calibration", "not due: gain and zero are as at first, within their intervals")
            )
        return [*rows, ("page", str(self.page))]


def last_of(d: AxisDrift, k: int) -> tuple[float, float]:
    """Final estimate of a property and its standard deviation."""
    return float(d.track.value[-1, k]), float(d.track.sigma[-1, k])


def outside(entry: Entry) -> list[str]:
    """Properties of a recording that are outside the interval of the model, one line each."""
    found = []
    for axis, d in entry.drift.axes.items():
        for k, p in enumerate(entry.drift.properties):
            value, sigma = last_of(d, k)
            if abs(value - p.value) > LIMIT * sigma:
                half = 1.96 * sigma * p.scale
                found.append(f"{axis}: {p.name} {p.text(value)} ± {half:.2f}, of {p.text(p.value)}")
    return found


def due(entries: Sequence[Entry]) -> tuple[str, ...]:
    """Why the calibration is due, or when it will be by the trend of gain and zero.

    Of each axis the last recording counts in which it moved.
    """
    found = []
    for axis in AXES:
        last = next((e for e in reversed(entries) if axis in e.drift.axes), None)
        if last is None:
            continue
        for k, p in enumerate(last.drift.properties):
            if p.name not in OF_CALIBRATION:
                continue
            value, sigma = last_of(last.drift.axes[axis], k)
            first, _ = last_of(next(e for e in entries if axis in e.drift.axes).drift.axes[axis], k)
            if abs(value - first) > LIMIT * sigma:
                found.append(f"{axis}: {p.name} {p.text(value)}, at first {p.text(first)}")
            elif (days := _days_left(entries, axis, k)) is not None:
                found.append(f"{axis}: {p.name} leaves its interval in about {days:.0f} days")
    return tuple(found)


def _days_left(entries: Sequence[Entry], axis: str, k: int) -> float | None:
    """Days until a trend that is certain reaches the limit; None without one."""
    runs = [e for e in entries if axis in e.drift.axes]
    time = np.array([e.date for e in runs]) / DAY
    if len(runs) < 4 or np.ptp(time) == 0.0:
        return None
    values = np.array([last_of(e.drift.axes[axis], k)[0] for e in runs])
    (slope, offset), cov = np.polyfit(time - time[-1], values, 1, cov=True)
    if abs(slope) < LIMIT * math.sqrt(cov[0, 0]):
        return None
    sigma = last_of(runs[-1].drift.axes[axis], k)[1]
    left = (math.copysign(LIMIT * sigma, slope) - (offset - values[0])) / slope
    return float(left) if left > 0.0 else None
