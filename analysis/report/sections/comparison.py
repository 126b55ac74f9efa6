"""Each run against the reference: errors, delay, residuals over time."""

import math
from collections.abc import Sequence

import numpy as np

from analysis.comparison.compare import AxisComparison, Comparison
from analysis.comparison.motion import bridged
from analysis.recording.measurements import Measurement
from analysis.report.numbers import ReportNumbers
from analysis.report.parts import Cell, Line, Panel, Plot, Section, Table, thinned
from analysis.report.words import number


def comparison(runs: Sequence[Measurement], numbers: ReportNumbers) -> Section | None:
    """Table of errors and plot of residuals against the first run; nothing for one run alone."""
    reference = runs[0]
    found = [c for c in numbers.comparisons if c.reference == reference.name]
    if not found:
        return None
    rows: list[tuple[Cell | str, ...]] = [
        (c.other, a.axis, *_cells(a)) for c in found for a in c.axes
    ]
    table = Table(
        ("run", "axis", "delay", "rms", "mean", "worst", "fit", "VAF", "rms, aligned",
         "fit, aligned", "fit of repeats"),
        tuple(rows),
        "Angle minus that of the reference, as recorded; fit is 100 (1 − |difference| / "
        "|reference − mean|) %, VAF the variance accounted for. Delay is behind the reference, "
        "found where the difference varies least; only the aligned columns have it taken out.",
    )  # fmt: skip
    text = " ".join((f"Every run against {reference.name}.", *_left_out(found)))
    return Section(
        "comparison", "Comparison", (text,), (table, _residuals(runs, {c.other for c in found}))
    )


def _left_out(found: Sequence[Comparison]) -> list[str]:
    """Sentences on what was not compared, and which axes count for no fit."""
    notes = [
        f"{c.other}, {axis}: {why}, so its fit counts for nothing."
        for c in found
        for axis, why in c.uncounted.items()
    ]
    return notes + [
        f"{number(100.0 * a.left_out, 3)} % of the readings of {c.reference}, {a.axis}, lie in "
        f"holes of {c.other} and are not compared."
        for c in found
        for a in c.axes
        if a.left_out
    ]


def _cells(axis: AxisComparison) -> tuple[Cell, ...]:
    e, aligned = axis.as_is, axis.aligned
    fits = [r.fit for r in axis.repeats if math.isfinite(r.fit)]
    spread = f"{number(min(fits), 3)} to {number(max(fits), 3)} %" if fits else "–"
    texts = (
        f"{number(axis.delay * 1e3, 3)} ms" if math.isfinite(axis.delay) else "–",
        *(f"{number(math.degrees(v), 3)}°" for v in (e.rmse, e.mae, e.worst)),
        *(f"{number(v, 4)} %" for v in (e.fit, e.vaf)),
        f"{number(math.degrees(aligned.rmse), 3)}°",
        f"{number(aligned.fit, 4)} %",
        spread,
    )
    return tuple(Cell(text, "number") for text in texts)


def _residuals(runs: Sequence[Measurement], others: set[str]) -> Plot:
    panels, lines = [], []
    for row, axis in enumerate(runs[0].axes):
        panels.append(Panel(f"axis {axis.component}", "difference [°]", row))
        for k, run in enumerate(runs[1:], start=1):
            other = run.axis(axis.component)
            if other is None or run.name not in others:
                continue
            there = bridged(axis.angles.time, other.angles.time, other.angles.value)
            x, y = thinned(axis.angles.time, np.degrees(there - axis.angles.value))
            lines.append(Line(f"{run.name} − {runs[0].name}", x, y, f"run{k}", row))
    return Plot(
        "residuals",
        "Difference of the angles over time, without alignment.",
        "time [s]",
        tuple(panels),
        tuple(lines),
        panel_height=180,
    )
