"""Excitation of a gimbal: from what was asked to commands, and from the recording to figures."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from twin.config import Step
from twin.experiments.excitation import Excitation

IN_FULL = ("peak", "peak time")  # told by --json and the report; a screen is small

if TYPE_CHECKING:
    from analysis.report.figures import AxisFigures


def excitation(config: Step) -> Excitation:
    """What the gimbal is to be told, in radians.

    Raises
    ------
    TwinError : a value that cannot be, with its flag
    """
    limit = config.rate_limit_deg_s
    return Excitation(
        signal=config.signal,
        amplitude=math.radians(config.amplitude_deg),
        axis=config.axis,
        repeats=config.repeats,
        hold=config.hold_s,
        duration=config.duration_s,
        band=config.band_hz,
        smallest=math.radians(config.smallest_deg),
        rate_limit=None if limit is None else math.radians(limit),
        seed=config.seed,
    )


def figures(recording: Path) -> "tuple[AxisFigures, ...]":
    """Figures of a recording, per axis and of both; axes that were not commanded are left out."""
    from analysis.recording import load
    from analysis.report.figures import run_figures

    return tuple(f for f in run_figures(load(recording)) if f.kind != "still")


def lines(figures: "Sequence[AxisFigures]") -> list[tuple[str, str]]:
    """One row a figure, as people read it, a column for every axis and direction."""
    from analysis.report.words import amplitude_text, split, value_text

    cells: dict[str, dict[tuple[str, str], str]] = {}
    heads: dict[tuple[str, str], str] = {}
    for axis in figures:
        for f in axis.figures:
            name, direction = split(f.name)
            column = (axis.axis, direction)
            if name not in IN_FULL:
                cells.setdefault(name, {})[column] = value_text(f)
            if direction:
                heads[column] = f"{axis.axis} {direction}, {amplitude_text(f)}, n = {f.n}"
            else:
                heads.setdefault(column, axis.axis)
    rows = []
    for directed in (True, False):
        columns = [c for c in sorted(heads, key=lambda c: (len(c[0]), c)) if bool(c[1]) is directed]
        told = {n: by for n, by in cells.items() if set(by) & set(columns)}
        table = [
            [heads[c] for c in columns],
            *([by.get(c, "") for c in columns] for by in told.values()),
        ]
        widths = [max(map(len, column)) + 2 for column in zip(*table, strict=True)]
        rows += [
            (name, "".join(f"{c:<{w}}" for c, w in zip(cells, widths, strict=True)).rstrip())
            for name, cells in zip(["", *told] if told else (), table, strict=False)
        ]
    return rows + [(f"note on {a.axis}", note) for a in figures for note in a.notes]
