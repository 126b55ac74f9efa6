"""`twin history FOLDER`: one board's recordings over time, against a model."""

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from analysis.comparison import errors
from analysis.estimate import AxisDrift
from analysis.recording import Recording, read
from analysis.report import Line, Panel, Plot, Section, Table, render
from analysis.schema import AnalysisError
from hardware.frames import AXES
from twin.config import History
from twin.config.paths import named, point_latest
from twin.config.result import Result, Rows
from twin.errors import TwinError
from twin.evaluation.drift import RunDrift, run_drift

OF_CALIBRATION = ("gain", "zero")
LIMIT = 3.0  # standard deviations, as of a control chart (Shewhart, 1931)
DAY = 86400.0  # s
LINKAGE = "of the first recording, simulated with each one's commands"
FEWEST = "twin compare FILE --explain names the fewest of more effects that explain the difference"
OTHER = "of each recording, by the motion recorded beside it"


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


def history(config: History) -> HistoryResult:
    """Estimate the properties of a board from each of its recordings, and write control charts.

    Raises
    ------
    TwinError, AnalysisError : no recordings of one board, in one line
    """
    out = named(config.out, "history", ".html", ".htm", force=config.force)
    if not config.folder.is_dir():
        raise TwinError(f"twin history {config.folder}: must be a folder with recordings (.rrd)")
    runs, left_out = _runs(config.folder)
    board, own = _of_one_board(runs, config)
    own.sort(key=lambda run: _date(*run))
    shadow = own[0][1].properties["shadow"]
    assert isinstance(shadow, dict)  # by `_runs`
    entries = []
    for file, recording in own:
        same = replace(recording, properties={**recording.properties, "shadow": shadow})
        try:
            drift = run_drift(same, config.mechanism)
        except (TwinError, AnalysisError) as error:
            left_out.append(f"{file.name}: {error}")
            continue
        entries.append(Entry(file, _date(file, recording), drift, _fits(recording, drift)))
    if not entries:
        raise TwinError(f"twin history {config.folder}: {left_out[-1]}")
    model = LINKAGE if shadow.get("gimbal") == "linkage" else OTHER
    result = HistoryResult(board, tuple(entries), tuple(left_out), due(entries), out, model)
    render(sections(entries, model), f"History of board {board}", out, result.as_dict())
    point_latest(out)
    return result


def _runs(folder: Path) -> tuple[list[tuple[Path, Recording]], list[str]]:
    """Recordings of rigs with a model beside them, and what is wrong with the others."""
    found, left_out = [], []
    for file in sorted(p for p in folder.glob("*.rrd") if not p.is_symlink()):
        try:
            recording = read(file)
        except AnalysisError as error:
            left_out.append(f"{file.name}: {error}")
            continue
        if isinstance(recording.properties.get("shadow"), dict):
            found.append((file, recording))
        else:
            left_out.append(f"{file.name}: not of a rig with a model beside it")
    if not found:
        raise TwinError(f"twin history {folder}: no recording of a rig with a model beside it")
    return found, left_out


def _of_one_board(
    runs: Sequence[tuple[Path, Recording]], config: History
) -> tuple[str, list[tuple[Path, Recording]]]:
    """Its serial number, and its recordings."""
    boards = [board_of(recording) for _, recording in runs]
    names = sorted(set(boards))
    asked = config.board
    alike = [n for n in names if asked is None or n.removeprefix("unit-").startswith(asked)]
    chosen = asked if asked in names else alike[0] if len(alike) == 1 else None
    if chosen is None:
        raise TwinError(
            f"twin history {config.folder}: holds recordings of {', '.join(names)};"
            " give one of them, or its beginning, as --board"
        )
    return chosen, [run for run, board in zip(runs, boards, strict=True) if board == chosen]


def board_of(recording: Recording) -> str:
    """Serial number of the board, by its calibration; what a simulated rig is without one."""
    files = recording.properties.get("files")
    kept = files.get("calibration") if isinstance(files, dict) else None
    try:
        number = json.loads(kept["text"])["rig"] if isinstance(kept, dict) else None
    except (KeyError, TypeError, ValueError, RecursionError):
        number = None
    if isinstance(number, str) and number.strip("0"):
        return number[:20]
    unit = recording.setting("unit")
    gimbal = str(recording.setting("gimbal"))[:40]
    return f"{gimbal} without a calibration" if unit is None else f"unit-{unit}"


def _date(file: Path, recording: Recording) -> float:
    text = recording.properties.get("date")
    try:
        return datetime.fromisoformat(str(text)).timestamp()
    except ValueError:
        return file.stat().st_mtime


def _fits(recording: Recording, drift: RunDrift) -> dict[str, float]:
    measured = recording["gimbal/measured"]
    known = np.isfinite(measured.values).all(axis=1)
    return {
        axis: errors(measured.column(axis)[known], d.motion[known]).fit
        for axis, d in drift.axes.items()
    }


def _last(d: AxisDrift, k: int) -> tuple[float, float]:
    """Final estimate of a property and its standard deviation."""
    return float(d.track.value[-1, k]), float(d.track.sigma[-1, k])


def outside(entry: Entry) -> list[str]:
    """Properties of a recording that are outside the interval of the model, one line each."""
    found = []
    for axis, d in entry.drift.axes.items():
        for k, p in enumerate(entry.drift.properties):
            value, sigma = _last(d, k)
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
            value, sigma = _last(last.drift.axes[axis], k)
            first, _ = _last(next(e for e in entries if axis in e.drift.axes).drift.axes[axis], k)
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
    values = np.array([_last(e.drift.axes[axis], k)[0] for e in runs])
    (slope, offset), cov = np.polyfit(time - time[-1], values, 1, cov=True)
    if abs(slope) < LIMIT * math.sqrt(cov[0, 0]):
        return None
    sigma = _last(runs[-1].drift.axes[axis], k)[1]
    left = (math.copysign(LIMIT * sigma, slope) - (offset - values[0])) / slope
    return float(left) if left > 0.0 else None


def sections(entries: Sequence[Entry], model: str) -> tuple[Section, ...]:
    """Control charts of all properties, and the table of the recordings."""
    properties = entries[0].drift.properties
    start = entries[0].date
    lines, panels = [], []
    for row, p in enumerate(properties):
        panels.append(Panel(p.name, p.unit or "of the model", row))
        for j, axis in enumerate("xy"):
            runs = [e for e in entries if axis in e.drift.axes]
            if not runs:
                continue
            days = np.array([(e.date - start) / DAY for e in runs])
            value, sigma = np.array([_last(e.drift.axes[axis], row) for e in runs]).T * p.scale
            labels = tuple(f"{e.day} {e.file.name}" for e in runs)
            low, high = value - 1.96 * sigma, value + 1.96 * sigma
            lines.append(Line(axis, days, value, f"run{j}", row, "line", low, high, labels))
        span = np.array([0.0, max((entries[-1].date - start) / DAY, 1e-3)])
        for side in (-LIMIT, LIMIT):
            limit = np.full(2, (p.value + side * p.sigma) * p.scale)
            lines.append(Line("limit of the model", span, limit, "command", row, "dash"))
    caption = (
        f"Estimates of each recording with 95 % intervals, against the model {model}; dashed: three"
        " standard deviations of the model."
    )
    chart = Plot("properties", caption, "days since the first recording", tuple(panels),
                 tuple(lines), panel_height=150)  # fmt: skip
    head = ("recording", "date", "fit x [%]", "fit y [%]", "outside the interval")
    rows = tuple(
        (
            e.file.name,
            e.day,
            *(f"{e.fit[a]:.1f}" if a in e.fit else "–" for a in "xy"),
            "; ".join(outside(e)) or "–",
        )
        for e in entries
    )
    table = Table(head, rows, f"Fit of the measured angle to the model {model}.")
    return (
        Section("chart", "Control charts", (), (chart,)),
        Section("recordings", "Recordings", (), (table,)),
    )
