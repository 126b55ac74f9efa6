"""At most twelve figures that answer most questions; the whole table is further down, folded."""

import math
from collections.abc import Iterator, Sequence

from analysis.recording.measurements import Measurement
from analysis.report.numbers import ReportNumbers, RunNumbers
from analysis.report.parts import Cell, Section, Table
from analysis.report.words import amplitude_text, split, value_text
from analysis.response import Figure

MOST = 12
KEYS = (
    "gain", "rise time", "dead time", "settling", "overshoot", "static error", "hysteresis",
    "hysteresis with lag", "slew rate", "speed reached", "threshold", "resolution", "bandwidth",
    "−90° frequency", "phase lag at 1 Hz", "equivalent delay", "linearity",
)  # fmt: skip
STAIRCASE = ("threshold", "resolution")
WAYS = ("", "up", "from below", "down", "from above")  # the first that there is, is shown


def key_figures(runs: Sequence[Measurement], numbers: ReportNumbers) -> Section | None:
    """One row a figure, one column a run and axis; nothing without figures."""
    axes = [a.component for a in runs[0].axes]
    chosen = {(r.label, axis): largest_figures(r, axis) for r in numbers.runs for axis in axes}
    off = {(r.label, axis, name) for r in numbers.runs for axis, name, _ in r.disagree}
    rows: list[tuple[Cell | str, ...]] = []
    for name in KEYS:
        found = [(place, by.get(name)) for place, by in chosen.items()]
        first = next((f for _, f in found if f is not None), None)
        if first is None or len(rows) == MOST:
            continue
        at = f" at {amplitude_text(first)}" if math.isfinite(first.amplitude) else ""
        cells = (_cell(f, f is not None and (*place, f.name) in off) for place, f in found)
        rows.append((f"{name}{at}", *cells))
    if not rows:
        return None
    head = ("figure", *(f"{label} {axis}" for label, axis in chosen))
    caption = (
        "Value ± half of its 95 % interval; of steps that of the largest upwards. Further figures, "
        "directions and amplitudes are in the folded table."
    )
    return Section("key-figures", "Key figures", (), (Table(head, tuple(rows), caption),))


def largest_figures(run: RunNumbers, axis: str) -> dict[str, Figure]:
    """By name the figure of the largest amplitude, of the first of `WAYS`; telling ones only.

    Left out are those not measurable, and a threshold or resolution that no step was too small for.
    """
    found: dict[str, Figure] = {}
    for figure in sorted(_of(run, axis), key=_order):
        found.setdefault(split(figure.name)[0], figure)
    return found


def _of(run: RunNumbers, axis: str) -> Iterator[Figure]:
    return (f for a in run.figures if a.axis == axis for f in a.figures if _says(f))


def _says(figure: Figure) -> bool:
    bounded = figure.name not in STAIRCASE or figure.interval[0] > 0.0
    return bounded and math.isfinite(figure.value)


def _order(figure: Figure) -> tuple[int, float]:
    way = split(figure.name)[1]
    size = -abs(figure.amplitude) if math.isfinite(figure.amplitude) else 0.0
    return WAYS.index(way) if way in WAYS else len(WAYS), size


def _cell(figure: Figure | None, disagrees: bool) -> Cell:
    if figure is None:
        return Cell("–")
    return Cell(value_text(figure), "off" if disagrees else "number")
