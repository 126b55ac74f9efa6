"""The assembly of `twin compare`: two motions side by side, and both in one recording."""

import math
import time
from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from analysis import schema
from analysis.comparison.compare import AxisComparison, Comparison
from analysis.comparison.compare import compare as side_by_side
from analysis.comparison.flights import PathDifference, flight_path, holds_flight, path_difference
from analysis.comparison.motion import Motion, bridged
from analysis.recording.caveats import caveats
from analysis.recording.reader import Recording, TimeSeries
from twin.config import Compare
from twin.config.result import Result, Rows
from twin.errors import TwinError
from twin.evaluation.inputs import is_table, seen

if TYPE_CHECKING:
    from analysis.recording.run import Run

Array = NDArray[np.float64]

REFERENCE, OTHER, DIFFERENCE = "gimbal/reference", "gimbal/other", "gimbal/difference"
COHERENT = 0.8  # below, gain and phase say nothing
TOLD_HZ = (0.5, 1.0, 2.0, 5.0, 10.0)
_FIGURES = (
    ("rmse", "rmse", "°"),
    ("mae", "mae", "°"),
    ("worst", "worst", "°"),
    ("fit", "fit", " %"),
    ("variance explained", "vaf", " %"),
)


@dataclass(frozen=True)
class CompareResult(Result):
    """Two motions side by side, and the recording that shows them.

    Attributes
    ----------
    comparison : axis by axis; the reference first
    shift : added to the other's stamps to lay its first command over the reference's [s]
    limit : fit below which the check fails [%], or None
    flight : how far the vehicles' flights lie apart; None where none flew
    warnings : reasons to doubt the figures
    """

    comparison: Comparison
    shift: float
    limit: float | None
    file: Path
    wall_s: float
    flight: PathDifference | None = None
    warnings: tuple[str, ...] = ()

    @property
    def passed(self) -> bool:
        """Whether every axis that counts fits at least as well as the limit asks."""
        return self.limit is None or self.comparison.fit >= self.limit

    def as_dict(self) -> dict[str, object]:
        """JSON values: errors in radians, delay in seconds, spectra in Hz, dB and degrees."""
        return {
            **self.comparison.to_dict(),
            "shift_s": self.shift,
            "fail_below": self.limit,
            "passed": self.passed,
            "flight": None if self.flight is None else self.flight.to_dict(),
            "warnings": list(self.warnings),
            "recording": str(self.file),
            "wall_s": self.wall_s,
        }

    def rows(self) -> Rows:
        """The result as a table."""
        c = self.comparison
        rows = [("reference", c.reference), ("compared", c.other)]
        if abs(self.shift) > 1e-6:
            rows.append(("laid over by", f"{1e3 * self.shift:.1f} ms, the first command"))
        rows.append(("(delay taken out)", _columns(a.axis for a in c.axes)))
        rows.append(("delay", _columns(_late(a) for a in c.axes)))
        for name, field, unit in _FIGURES:
            rows.append((name, _columns(_pair(a, field, unit) for a in c.axes)))
        rows.append(("fit per repeat", _columns(_repeats(a) for a in c.axes)))
        rows += [(f"at {f:g} Hz", _columns(_at(a, f) for a in c.axes)) for f in TOLD_HZ]
        if any(a.left_out for a in c.axes):
            rows.append(("left out, holes", _columns(f"{100 * a.left_out:.1f} %" for a in c.axes)))
        if self.flight is not None:
            rows.append(("flights, under power", self.flight.text()))
        rows += [("fit not counted", f"{axis}: {why}") for axis, why in c.uncounted.items()]
        rows += [("WARNING", w) for w in self.warnings]
        if self.limit is not None:
            word = "passed" if self.passed else "FAILED"
            fit = f"worst fit {c.fit:.2f} %" if math.isfinite(c.fit) else "no axis counts"
            rows.append((word, f"{fit}, {self.limit:g} % asked for"))
        rows += [("recording", str(self.file)), ("", f"twin view {self.file}")]
        return rows


@dataclass(frozen=True)
class _Laid:
    """Two motions on one axis of time, what was commanded, and how far the other was shifted."""

    reference: Motion
    other: Motion
    command: TimeSeries
    shift: float
    run: Recording  # of the reference
    other_run: Recording | None = None

    @property
    def runs(self) -> list[Recording]:
        return [r for r in (self.run, self.other_run) if r is not None]


def compare(config: Compare) -> CompareResult:
    """Compare two motions of a gimbal and write both into one recording.

    Raises
    ------
    TwinError, AnalysisError : something the user asked for cannot be done, in one line
    """
    began = time.perf_counter()
    laid = _laid(config)
    axes = []
    for name in (c for c in laid.reference.components if c in laid.other.components):
        begins = _repeats_begin(laid, name)
        found = side_by_side(
            _axis(laid.reference, name), _axis(laid.other, name),
            repeats=begins.tolist(), longest_delay=1e-3 * config.longest_delay_ms,
            still=() if _commanded(laid.command, name) else (name,),
        )  # fmt: skip
        # what comes after the last repeat is none
        axes += [replace(a, repeats=a.repeats[: max(len(begins) - 1, 0)]) for a in found.axes]
    if not axes:
        side_by_side(laid.reference, laid.other)  # says which axes each has
    file = config.out or Path("runs/compare.rrd")
    if file.is_dir() or not file.suffix:
        file /= "compare.rrd"
    comparison = Comparison(laid.reference.name, laid.other.name, tuple(axes))
    _record(config, file, laid)
    return CompareResult(
        comparison,
        laid.shift,
        config.fail_below,
        file,
        time.perf_counter() - began,
        None if laid.other_run is None else _flights(laid.run, laid.other_run),
        caveats(laid.runs, [str(f) for f in config.recordings]),
    )


def _flights(first: Recording, second: Recording) -> PathDifference | None:
    if not (holds_flight(first) and holds_flight(second)):
        return None
    return path_difference(flight_path(first), flight_path(second))


def _laid(config: Compare) -> _Laid:
    from analysis.recording.run import aligned, runs_of

    files = config.recordings
    if not 1 <= len(files) <= 2:
        raise TwinError(
            f"compare: {len(files)} recordings; give two (or tables), or one that holds measured"
            " and simulated"
        )
    if len(files) == 1 and is_table(files[0]):
        raise TwinError(f"compare: {files[0]} is a table with one motion; name the other, too")
    runs = seen(config, files)
    if len(runs) == 1:
        run = runs[0]
        measured, simulated = run["gimbal/measured"], run["gimbal/simulated"]
        return _Laid(
            _motion(measured, f"{files[0]} measured"),
            _motion(simulated, f"{files[0]} simulated"),
            run["gimbal/command"],
            0.0,
            run,
        )
    first, second = runs_of(runs, [str(f) for f in files])
    labels = [f"{f} ({r.motion})" for f, r in zip(files, (first, second), strict=True)]
    shift = aligned((first, second))[1].shift
    return _Laid(
        _motion(_angles(first), labels[0]),
        _motion(_angles(second), labels[1], shift),
        first.recording["gimbal/command"],
        shift,
        first.recording,
        second.recording,
    )


def _angles(run: "Run") -> TimeSeries:
    return run.recording[f"gimbal/{run.motion}"]


def _motion(series: TimeSeries, name: str, shift: float = 0.0) -> Motion:
    """Rows that hold something; of equal stamps the first."""
    held = np.isfinite(series.values).any(axis=1)
    time, values = series.time[held] + shift, series.values[held]
    new = np.concatenate([[True], np.diff(time) > 0.0])[: len(time)]
    return Motion(time[new], values[new], series.components, name)


def _axis(motion: Motion, name: str) -> Motion:
    column = motion.components.index(name)
    return Motion(motion.time, motion.values[:, [column]], (name,), motion.name)


def _repeats_begin(laid: _Laid, axis: str) -> Array:
    """When each repeat of an axis begins [s], and when the last ends.

    An axis is commanded for as many equal times as the run was told to repeat its signal.
    """
    command = laid.command
    changes = command.time[np.flatnonzero(np.diff(command.column(axis)) != 0.0) + 1]
    count = laid.run.setting("repeats")
    if len(changes) < 2 or not isinstance(count, int) or not 1 <= count <= len(changes):
        return np.zeros(0)
    last = changes[-1]
    if laid.run.setting("signal") == "steps":
        last += np.diff(changes).max()  # a step lasts as long as it is held
    return np.linspace(changes[0], last, count + 1)


def _record(config: Compare, file: Path, laid: _Laid) -> None:
    """Both motions and their difference at the reference's stamps, as one recording."""
    from twin.recorder import Recorder

    reference, other, command = laid.reference, laid.other, laid.command
    signals = ("gimbal/command", REFERENCE, OTHER, DIFFERENCE)
    properties: dict[str, object] = {
        "command": "compare",
        "configuration": {"recordings": [str(f) for f in config.recordings]},
        "reference": reference.name,
        "other": other.name,
    }
    stamps = np.rint(reference.time * 1e9).astype(np.int64)
    rows = np.full((len(stamps), 8), np.nan)
    held = np.clip(np.searchsorted(command.time, reference.time + 1e-9, side="right") - 1, 0, None)
    for k, name in enumerate(schema.SIGNALS[REFERENCE].components):
        if name not in reference.components or name not in other.components:
            continue
        rows[:, k] = command.column(name)[held]
        rows[:, 2 + k] = reference.values[:, reference.components.index(name)]
        there = other.values[:, other.components.index(name)]
        good = np.isfinite(there)
        rows[:, 4 + k] = bridged(reference.time, other.time[good], there[good])
        rows[:, 6 + k] = rows[:, 4 + k] - rows[:, 2 + k]
    rows[:, :2] = np.nan_to_num(rows[:, :2])
    with Recorder(file, signals=signals, properties=properties, drain_ns=8_000_000_000) as recorder:
        recorder.event(int(stamps[0]), f"reference: {reference.name}")
        recorder.event(int(stamps[0]), f"other: {other.name}")
        for stamp, row in zip(stamps.tolist(), rows, strict=True):
            recorder.row[:] = row
            recorder.commit(stamp, stamp)


def _columns(cells: Iterable[str]) -> str:
    return "".join(f"{cell:<30}" for cell in cells).rstrip()


def _pair(a: AxisComparison, what: str, unit: str) -> str:
    """A figure as it is and, in brackets, with the delay taken out."""
    scale = 180.0 / math.pi if unit == "°" else 1.0
    values = [scale * getattr(e, what) for e in (a.as_is, a.aligned)]
    if unit == "°":
        return f"{values[0]:.4f}{unit} ({values[1]:.4f}{unit})"
    return f"{values[0]:.2f}{unit} ({values[1]:.2f}{unit})"


def _commanded(command: TimeSeries, axis: str) -> bool:
    """Whether an axis' command ever changed."""
    asked = command.column(axis)
    return bool((np.diff(asked[np.isfinite(asked)]) != 0.0).any())


def _late(a: AxisComparison) -> str:
    return f"{1e3 * a.delay:.2f} ms" if math.isfinite(a.delay) else "-"


def _repeats(a: AxisComparison) -> str:
    fits = [e.fit for e in a.repeats if math.isfinite(e.fit)]
    if not fits:
        return "-"
    return f"{min(fits):.2f} to {max(fits):.2f} %, n = {len(fits)}"


def _at(a: AxisComparison, frequency: float) -> str:
    """Gain and phase at a frequency [Hz], where the motions are coherent there."""
    s = a.spectrum
    k = int(np.argmin(np.abs(s.frequency - frequency)))
    if not s.coherence[k] >= COHERENT or abs(s.frequency[k] / frequency - 1.0) > 0.5:
        return "not coherent"
    return f"{s.gain[k]:+.2f} dB, {s.phase[k]:+.1f}°"
