"""Each run against the reference: errors and delay."""

import math
from collections.abc import Sequence

from analysis.comparison.compare import AxisComparison, Comparison
from analysis.recording.measurements import Measurement
from analysis.report.numbers import ReportNumbers
from analysis.report.parts import Cell, Section, Table
from analysis.report.words import number


def comparison(runs: Sequence[Measurement], numbers: ReportNumbers) -> Section | None:
    """Table of errors against the first run; nothing for one run alone."""
    reference = runs[0]
    found = [c for c in numbers.comparisons if c.reference == reference.name]
    if not found:
        return None
    rows: list[tuple[Cell | str, ...]] = [
        (c.other, a.axis, *_cells(a)) for c in found for a in c.axes
    ]
    table = Table(
        ("run", "axis", "delay", "rms", "worst", "fit", "fit, no offset", "VAF",
         "rms, aligned", "fit, aligned", "fit, repeats"),
        tuple(rows),
        "Angle minus that of the reference, as recorded. Fit: 100 (1 − |difference| / "
        "|reference − mean|) %; it contains a constant offset of the angle sensor, the fit without "
        "offset does not. twin identify prints the latter, and where it can dates commands by the "
        "pulse frames in which the servos took them up, this page by their stamps; so its fit of "
        "the same recording is usually higher. VAF: variance accounted for. Delay: behind the "
        "reference, at the smallest variance of the difference; only the aligned columns are "
        "corrected for it.",
    )  # fmt: skip
    text = " ".join((f"Every run against {reference.name}.", *_left_out(found)))
    return Section("comparison", "Comparison", (text,), (table,))


def _left_out(found: Sequence[Comparison]) -> list[str]:
    """Sentences on what was not compared, and which axes are not judged."""
    notes = [
        f"{c.other}, axis {axis}: {why}; its fit is not judged."
        for c in found
        for axis, why in c.uncounted.items()
    ]
    return notes + [
        f"{number(100.0 * a.left_out, 3)} % of the readings of {c.reference}, axis {a.axis}, "
        f"lie in gaps of {c.other} and are not compared."
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
        *(f"{number(math.degrees(v), 3)}°" for v in (e.rmse, e.worst)),
        *(f"{number(v, 4)} %" for v in (e.fit, e.fit_moving, e.vaf)),
        f"{number(math.degrees(aligned.rmse), 3)}°",
        f"{number(aligned.fit, 4)} %",
        spread,
    )
    return tuple(Cell(text, "number") for text in texts)
