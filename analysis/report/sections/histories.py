"""Commanded and attained angles over time and their differences, every run, every axis."""

import math
from collections.abc import Collection, Sequence

import numpy as np

from analysis.comparison.motion import bridged
from analysis.recording.measurements import Measurement
from analysis.report.numbers import ReportNumbers, same_command
from analysis.report.parts import Line, Panel, Plot, Section, held, thinned

COLUMNS = 2  # two axes stand side by side


def histories(runs: Sequence[Measurement], numbers: ReportNumbers) -> Section | None:
    """One column an axis: angles above, differences from the first run below; None without one."""
    if not runs[0].axes:
        return None
    compared = {c.other for c in numbers.comparisons if c.reference == runs[0].name}
    panels: list[Panel] = []
    lines: list[Line] = []
    for k, axis in enumerate(runs[0].axes):
        row, column = (0, k) if len(runs[0].axes) == COLUMNS else (2 * k, 0)
        lines += _lines(runs, axis.component, len(panels))
        panels.append(Panel(f"axis {axis.component}", "angle [°]", row, column))
        differences = _differences(runs, axis, compared, len(panels))
        if differences:
            panels.append(Panel("difference", "difference [°]", row + 1, column))
            lines += differences
    caption = (
        "Gimbal angle over experiment time. Drag to zoom, double-click to reset, click a name to "
        "hide it."
    )
    if compared:
        caption += f" Difference: angle minus that of {runs[0].name}, without alignment."
    plot = Plot("history", caption, "time [s]", tuple(panels), tuple(lines))
    return Section("histories", "Angles over time", (), (plot,))


def _differences(
    runs: Sequence[Measurement], axis: Measurement, compared: Collection[str], panel: int
) -> list[Line]:
    found = []
    for k, run in enumerate(runs):
        other = run.axis(axis.component)
        if other is not None and run.name in compared:
            there = bridged(axis.angles.time, other.angles.time, other.angles.value)
            x, y = thinned(axis.angles.time, np.degrees(there - axis.angles.value))
            found.append(Line(f"{run.name}, {run.motion}", x, y, f"run{k}", panel))
    return found


def _lines(runs: Sequence[Measurement], name: str, panel: int) -> list[Line]:
    found = []
    for k, run in enumerate(runs):
        axis = run.axis(name)
        if axis is None:
            continue
        first = runs[0].axis(name)
        if k == 0 or first is None or not same_command(first, axis):
            t, u = held(axis.command.time, np.degrees(axis.command.value))
            label = "command" if k == 0 else f"command, {run.name}"
            found.append(Line(label, t, u, "command", panel))
        t, y = thinned(axis.angles.time, np.degrees(axis.angles.value))
        found.append(Line(f"{run.name}, {run.motion}", t, y, f"run{k}", panel))
        other = run.recording.series.get("gimbal/simulated")
        if run.motion == "measured" and other is not None and name in other.components:
            values = np.degrees(other.column(name))
            t, y = thinned(other.time + run.shift, values)
            if not np.all(y == 0.0) and math.isfinite(float(np.nanmax(np.abs(y), initial=0.0))):
                found.append(Line(f"{run.name}, simulated", t, y, f"run{k}", panel, "dash"))
    return found
