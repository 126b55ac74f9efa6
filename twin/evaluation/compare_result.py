"""Errors between two motions as a table."""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from analysis.comparison import AxisComparison, Comparison, PathDifference
from analysis.flown import Flown
from analysis.plain import plain
from twin.config.result import Result, Rows
from twin.evaluation.flights import differences, ends_apart, leading

if TYPE_CHECKING:
    from twin.evaluation.drift import RunDrift
    from twin.evaluation.explain import RunExplanation

EXCITED = 0.05  # of the power beside: below, as between the lines of held steps, nothing is shown
COHERENT = 0.8  # below, gain and phase are not shown
WORTHLESS = -100.0  # %; a fit below says only that the motions have nothing in common
SHOWN_HZ = (0.5, 1.0, 2.0, 5.0, 10.0)
_FIGURES = (
    ("rmse", "rmse", "°"),
    ("mae", "mae", "°"),
    ("worst", "worst", "°"),
    ("fit", "fit", " %"),
    ("fit without offset", "fit_moving", " %"),
    ("variance explained", "vaf", " %"),
)


@dataclass(frozen=True)
class CompareResult(Result):
    """Errors between two motions, and the recording that shows both.

    Attributes
    ----------
    comparison : axis by axis; the reference first
    shift : added to the other's stamps to align its first command with the reference's [s]
    limit : fit below which the check fails [%], or None
    flight : how far the vehicles' flights lie apart; None where none flew
    flights : their figures
    warnings : reasons to doubt the figures
    drift : properties of the gimbal over time, with `--drift`
    explanation : shares of the model's effects in the difference, with `--explain`
    """

    comparison: Comparison
    shift: float
    limit: float | None
    file: Path
    wall_s: float
    flight: PathDifference | None = None
    flights: tuple[Flown, Flown] | None = None
    warnings: tuple[str, ...] = ()
    drift: "RunDrift | None" = None
    explanation: "RunExplanation | None" = None

    @property
    def passed(self) -> bool:
        """Whether every axis that counts reaches the limit."""
        return self.limit is None or self.comparison.fit >= self.limit

    def as_dict(self) -> dict[str, object]:
        """JSON values: errors in radians, delay in seconds, spectra in Hz, dB and degrees."""
        return {
            **self.comparison.to_dict(),
            "shift_s": self.shift,
            "fail_below": self.limit,
            "passed": self.passed,
            "flight": self._flight(),
            "warnings": list(self.warnings),
            "drift": None if self.drift is None else self.drift.as_dict(),
            "explanation": None if self.explanation is None else self.explanation.as_dict(),
            "recording": str(self.file),
            "wall_s": self.wall_s,
        }

    def _flight(self) -> dict[str, object] | None:
        if self.flight is None:
            return None
        if self.flights is None:
            return self.flight.to_dict()
        apart = {
            "difference": differences(self.flights),
            "ends_apart_m": plain(ends_apart(self.flights)),
        }
        return {**self.flight.to_dict(), **apart}

    def rows(self) -> Rows:
        """Flights first; then errors, delay and coherence, a column per axis.

        In brackets with the delay removed.
        """
        c = self.comparison
        rows = [("reference", c.reference), ("compared", c.other)]
        if self.flight is not None:
            rows.append(("flights, under power", self.flight.text()))
        if self.flights is not None:
            rows += leading(self.flights)
        if abs(self.shift) > 1e-6:
            rows.append(("shifted by", f"{1e3 * self.shift:.1f} ms, to align the first commands"))
        rows.append(("(delay removed)", _columns(a.axis for a in c.axes)))
        rows.append(("delay", _columns(_late(a) for a in c.axes)))
        for name, field, unit in _FIGURES:
            rows.append((name, _columns(_both(a, field, unit) for a in c.axes)))
        rows.append(("fit per repeat", _columns(_repeats(a) for a in c.axes)))
        rows += [(f"at {f:g} Hz", _columns(_at(a, f) for a in c.axes)) for f in SHOWN_HZ]
        if any(a.left_out for a in c.axes):
            rows.append(("left out, gaps", _columns(f"{100 * a.left_out:.1f} %" for a in c.axes)))
        if self.drift is not None:
            rows += self.drift.rows()
        if self.explanation is not None:
            rows += self.explanation.rows()
        if self.drift is not None and self.explanation is not None:
            rows.append(
                ("", "drift is of changes during the run, the shares of constant differences")
            )
        rows += [("fit not counted", f"{axis}: {why}") for axis, why in c.uncounted.items()]
        rows += [("WARNING", w) for w in self.warnings]
        if self.limit is not None:
            verdict = "passed" if self.passed else "FAILED"
            fit = f"worst fit {c.fit:.2f} %" if math.isfinite(c.fit) else "no axis counts"
            rows.append((verdict, f"{fit}, limit {self.limit:g} %"))
        return [*rows, ("recording", str(self.file)), ("", f"twin view {self.file}")]


def _columns(cells: Iterable[str]) -> str:
    return "".join(f"{cell:<34}" for cell in cells).rstrip()


def _both(a: AxisComparison, what: str, unit: str) -> str:
    """A figure and, in brackets, the same with the delay removed.

    Percentages of the motion mean nothing where there was hardly any.
    """
    if a.hardly_moved and unit == " %":
        return "hardly moved"
    scale = 180.0 / math.pi if unit == "°" else 1.0
    values = [scale * getattr(e, what) for e in (a.as_is, a.aligned)]
    if unit == "°":
        return f"{values[0]:.4f}{unit} ({values[1]:.4f}{unit})"
    return "{} ({})".format(*(_percent(v) for v in values))


def _percent(value: float) -> str:
    return f"< {WORTHLESS:.0f} %" if value < WORTHLESS else f"{value:.2f} %"


def _late(a: AxisComparison) -> str:
    if not math.isfinite(a.delay) or a.hardly_moved:
        return "-"
    late = f"{abs(1e3 * a.delay):.2f} ms"
    return f"{late} ahead of the reference" if round(1e3 * a.delay, 2) < 0.0 else late


def _repeats(a: AxisComparison) -> str:
    fits = [e.fit for e in a.repeats if math.isfinite(e.fit)]
    if not fits or a.hardly_moved:
        return "-"
    return f"{_percent(min(fits))} to {_percent(max(fits))}, n = {len(fits)}"


def _at(a: AxisComparison, frequency: float) -> str:
    """Gain and phase at a frequency [Hz] with 95 % intervals, where the record tells them."""
    if a.hardly_moved:
        return "-"
    s = a.spectrum
    k = int(np.argmin(np.abs(s.frequency - frequency)))
    if abs(s.frequency[k] / frequency - 1.0) > 0.5:
        return "not coherent"
    if not s.power[k] >= EXCITED:
        return "no power"
    if not s.coherence[k] >= COHERENT:
        return "not coherent"
    gain = f"{s.gain[k]:+.2f} ± {s.gain_error[k]:.2f} dB"
    return f"{gain}, {s.phase[k]:+.1f} ± {s.phase_error[k]:.1f}°"
