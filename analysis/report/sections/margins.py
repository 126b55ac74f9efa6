"""Stability margins of the attitude loop with each identified model in it."""

import math
from collections.abc import Sequence

from analysis.recording.measurements import Measurement
from analysis.report.numbers import ReportNumbers
from analysis.report.parts import Cell, Section, Table
from analysis.report.words import number
from analysis.transfer_function.margins import Margins, decibels


def margins(runs: Sequence[Measurement], numbers: ReportNumbers) -> Section | None:  # noqa: ARG001
    """One row a model, axis and instant of the flight; nothing without a model."""
    rows: list[tuple[Cell | str, ...]] = [
        (model, m.axis, m.loop, *_cells(m)) for model, of in numbers.margins.items() for m in of
    ]
    if not rows:
        return None
    head = (
        "model", "axis", "at", "gain margin", "gain reduction", "phase margin", "delay margin",
        "crossover",
    )  # fmt: skip
    caption = (
        "Attitude loop of the reference vehicle (PID, rate low-pass, hold of the control period, "
        "transverse inertia; no air) with the linear part of the model, one axis at a time. Gain "
        "margin: factor by which the loop gain may rise; gain reduction: by which it may fall. "
        "Delay margin: delay that may be added anywhere in the loop."
    )
    return Section("margins", "Attitude loop", (), (Table(head, tuple(rows), caption),))


def _cells(m: Margins) -> tuple[Cell, ...]:
    texts = (
        decibels(m.gain),
        decibels(m.lower_gain),
        f"{number(math.degrees(m.phase), 3)}°",
        f"{number(1e3 * m.delay, 3)} ms" if m.stable else "unstable",
        f"{number(m.crossover, 3)} rad/s",
    )
    return tuple(Cell(text, "number" if m.stable else "off") for text in texts)
