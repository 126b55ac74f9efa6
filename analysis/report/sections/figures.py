"""The figures a TVC engineer quotes, one column a run."""

import math
from collections.abc import Sequence

from analysis.recording.measurements import Measurement
from analysis.report.numbers import ReportNumbers, RunNumbers
from analysis.report.parts import Cell, Section, Table
from analysis.report.words import DIRECTIONS, angle_text, split, value_text
from analysis.response import Figure

SHORT = 24  # characters

Key = tuple[str, str, str]  # axis, figure, amplitude


def figures(runs: Sequence[Measurement], numbers: ReportNumbers) -> Section | None:
    """Value ± half of its 95 % interval, number of repeats, amplitude; disagreement is marked."""
    tables = [_by_key(n) for n in numbers.runs]
    marked = [{(axis, name, _at(a)) for axis, name, a in n.disagree} for n in numbers.runs]
    found = dict.fromkeys(key for by in tables for key in by)
    axes = list(dict.fromkeys(a.axis for n in numbers.runs for a in n.figures))
    order = list(dict.fromkeys(split(name)[0] for _, name, _ in found))
    keys = sorted(
        found,
        key=lambda k: (axes.index(k[0]), order.index(split(k[1])[0]), _way(k[1])),
    )
    if not keys:
        return _nothing(numbers)
    rows: list[tuple[Cell | str, ...]] = []
    for key in keys:
        axis, name, amplitude = key
        words, direction = split(name)
        cells = [_cell(by.get(key), key in off) for by, off in zip(tables, marked, strict=True)]
        rows.append((axis, *map(_whole, (words, direction, amplitude)), *cells))
    head = ("axis", "figure", "direction", "at", *(r.name for r in runs))
    caption = "Value ± half of the 95 % interval; n is the number of repeats or averages. "
    if any(marked):
        caption += (
            f"≠: outside the interval of {runs[0].name} and beyond the practical tolerance (2 % of "
            "the value; 0.05°, 2 °/s, 0.5 ms, 0.5 %, 0.1 Hz). "
        )
    caption += (
        "Times are measured from the command: rise time from 10 to 90 %, settling to 2 %, dead "
        "time to 5 % of the step; where noise exceeds these bands, to the noise, and without an"
        " interval. Without an overshoot beyond the noise a peak has no time. Static error: "
        "command minus final angle. Hysteresis: angle from above minus from below. AP: mean "
        "attained angle minus command. RP: mean distance from that mean plus three standard "
        "deviations. vAP: distance of the means of both approach directions (ISO 9283). Cosine "
        "loss: axial thrust lost at the largest angle. Figures of a model without an amplitude "
        "are computed from its equations."
    )
    parts = [Table(head, tuple(rows), caption, folded="Every figure, amplitude and direction")]
    if numbers.notes:
        parts.append(_notes(numbers))
    return Section("figures", "All figures", (), tuple(parts))


def _whole(text: str) -> Cell:
    """On one line, if it is short; names come from recordings."""
    return Cell(text, "number" if len(text) <= SHORT else "")


def _way(name: str) -> int:
    direction = split(name)[1]
    return DIRECTIONS.index(direction) if direction else -1


def _nothing(numbers: ReportNumbers) -> Section | None:
    return Section("figures", "All figures", (), (_notes(numbers),)) if numbers.notes else None


def _notes(numbers: ReportNumbers) -> Table:
    return Table(
        ("Notes: not determined, uncertain, or worth knowing",),
        tuple((Cell(n, "warn"),) for n in numbers.notes),
    )


def _by_key(run: RunNumbers) -> dict[Key, Figure]:
    return {(a.axis, f.name, _at(f.amplitude)): f for a in run.figures for f in a.figures}


def _at(amplitude: float) -> str:
    return angle_text(amplitude) if math.isfinite(amplitude) else "–"


def _cell(figure: Figure | None, disagrees: bool) -> Cell:
    if figure is None:
        return Cell("–")
    n = f"  (n {figure.n})" if figure.n else ""
    return Cell(value_text(figure) + n, "off" if disagrees else "number")
