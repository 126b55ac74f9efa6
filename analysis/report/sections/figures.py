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
        caption += f"≠: outside the interval of {runs[0].name}. "
    caption += (
        "Times count from the command; rise from 10 to 90 %, settling to 2 % and dead to "
        "5 %, or to what noise leaves: then without an interval. A peak "
        "without an overshoot beyond the noise has no time. AP is the mean of the angles attained "
        "minus the command, RP the mean of their distances from it plus three deviations, vAP the "
        "distance between the means from either side (ISO 9283). Cosine loss is the axial thrust "
        "lost at the largest angle; of a model, what has no amplitude is of its equations."
    )
    parts = [Table(head, tuple(rows), caption)]
    if numbers.notes:
        parts.append(_notes(numbers))
    return Section("figures", "Figures", (), tuple(parts))


def _whole(text: str) -> Cell:
    """On one line, if it is short; names come from recordings."""
    return Cell(text, "number" if len(text) <= SHORT else "")


def _way(name: str) -> int:
    direction = split(name)[1]
    return DIRECTIONS.index(direction) if direction else -1


def _nothing(numbers: ReportNumbers) -> Section | None:
    return Section("figures", "Figures", (), (_notes(numbers),)) if numbers.notes else None


def _notes(numbers: ReportNumbers) -> Table:
    return Table(
        ("not determined, or uncertain",),
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
