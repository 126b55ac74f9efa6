"""Commanded and attained angles over time, every run, every axis."""

import math
from collections.abc import Sequence

import numpy as np

from analysis.recording.measurements import Measurement
from analysis.report.numbers import ReportNumbers, same_command
from analysis.report.parts import Line, Panel, Plot, Section, held, thinned


def histories(runs: Sequence[Measurement], numbers: ReportNumbers) -> Section:  # noqa: ARG001
    """One panel an axis; an angle simulated beside a measured one in one recording is dashed."""
    names = [a.component for a in runs[0].axes]
    panels, lines = [], []
    for k, name in enumerate(names):
        panels.append(Panel(f"axis {name}", "angle [°]", k))
        lines += _lines(runs, name, k)
    plot = Plot(
        "history",
        "Gimbal angle over experiment time. Drag to zoom, double-click to go back, click a name to "
        "hide it. Long records are thinned to the extremes of every stretch.",
        "time [s]",
        tuple(panels),
        tuple(lines),
    )
    return Section("histories", "Time histories", (), (plot,))


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
