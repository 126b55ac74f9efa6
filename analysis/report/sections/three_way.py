"""Every run against every other in one table: fit, rms difference and delay."""

import math
from collections.abc import Sequence

from analysis.comparison.compare import Comparison
from analysis.recording.measurements import Measurement
from analysis.report.numbers import ReportNumbers
from analysis.report.parts import Section, Table
from analysis.report.words import number


def three_way(runs: Sequence[Measurement], numbers: ReportNumbers) -> Section | None:
    """Every run against every other, for three or more; nothing for fewer."""
    if len(runs) < 3 or not numbers.comparisons:
        return None
    by = {(c.reference, c.other): c for c in numbers.comparisons}
    rows = [
        (row.name, *(_cell(by.get((row.name, column.name))) for column in runs[1:]))
        for row in runs[:-1]
    ]
    table = Table(
        ("reference", *(r.name for r in runs[1:])),
        tuple(rows),
        "Smallest fit over the commanded axes, largest rms difference over the axes, and mean "
        "delay behind the reference; as recorded, without alignment.",
    )
    return Section("overview", "Every run against every other", (), (table,))


def _cell(found: Comparison | None) -> str:
    if found is None:
        return ""
    worst = max(a.as_is.rmse for a in found.axes)
    delays = [a.delay for a in found.axes if math.isfinite(a.delay)]
    late = f", {number(1e3 * sum(delays) / len(delays), 2)} ms" if delays else ""
    fit = f"{number(found.fit, 3)} %" if math.isfinite(found.fit) else "no fit"
    return f"{fit}, {number(math.degrees(worst), 2)}° rms{late}"
