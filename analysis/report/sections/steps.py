"""Step responses overlaid: every repeat, and their mean with its interval."""

import math
from collections.abc import Sequence

import numpy as np

from analysis.recording.measurements import Measurement
from analysis.report.numbers import ReportNumbers
from analysis.report.parts import Line, Panel, Plot, Section
from analysis.report.samples import steps_of
from analysis.response import Step
from analysis.response.figure import ALIKE, student

SHOWN = 6.0  # times the slowest rise
MOST_REPEATS = 12  # drawn one by one; the mean is of all
CAPTION = (
    "Every repeat (thin), their mean (thick) and its 95 % interval (band; Student's t over the "
    "repeats). Time zero is the command."
)
SIMULATED = (
    " Repeats of a simulation differ only by where backlash and friction held the gimbal before."
)


def steps(runs: Sequence[Measurement], numbers: ReportNumbers) -> Section | None:
    """One panel per axis and direction, time from the command, angle from where the step began."""
    panels: list[Panel] = []
    lines: list[Line] = []
    for row, first in enumerate(runs[0].axes):
        for column, way in enumerate((1.0, -1.0)):
            drawn = [
                (k, found)
                for k, run in enumerate(runs)
                if (found := _largest(_steps(run, numbers, k, first.component), way))
            ]
            if not drawn:
                continue
            size = math.degrees(drawn[0][1][0].command_after - drawn[0][1][0].command_before)
            title = f"{first.component}, {'up' if way > 0 else 'down'} by {abs(size):.3g}°"
            panels.append(Panel(title, "angle from start [°]", row, column))
            index = len(panels) - 1
            shortest = min(float(s.time[-1]) for _, found in drawn for s in found)
            lines.append(_command(size, shortest, index))
            for k, found in drawn:
                lines += _lines(runs[k].name, f"run{k}", found, index, shortest)
    if not panels:
        return None
    plot = Plot(
        "steps",
        f"{CAPTION}{SIMULATED if any(r.motion == 'simulated' for r in runs) else ''}",
        "time from command [s]",
        tuple(panels),
        tuple(lines),
        x_range=_shown(lines),
    )
    return Section("steps", "Step responses", (), (plot,))


def _shown(lines: Sequence[Line]) -> tuple[float, float] | None:
    """From just before the command until well after the slowest mean has risen to 90 %."""
    rises, ends = [], []
    for line in lines:
        if line.style == "line" and line.role != "command":
            last = line.y[-1]
            there = np.flatnonzero(line.y / last >= 0.9) if last else np.array([], int)
            rises.append(float(line.x[there[0]]) if len(there) else float(line.x[-1]))
            ends.append(float(line.x[-1]))
    until = min(max(ends), SHOWN * max(rises))
    return (-0.04 * until, until) if until > 0.0 else None


def _steps(run: Measurement, numbers: ReportNumbers, k: int, name: str) -> tuple[Step, ...]:
    axis = run.axis(name)
    if axis is None or numbers.runs[k].kind(name) not in ("steps", "staircase"):
        return ()
    return steps_of(axis)


def _largest(found: Sequence[Step], way: float) -> list[Step]:
    """The steps of one direction with the largest amplitude."""
    sizes = [(s.command_after - s.command_before) * way for s in found]
    top = max(sizes, default=0.0)
    return [
        s for s, size in zip(found, sizes, strict=True) if top > 0.0 and size > top * (1 - ALIKE)
    ]


def _command(size: float, until: float, panel: int) -> Line:
    time = np.array([-0.05 * until, 0.0, 0.0, until])
    return Line("command", time, np.array([0.0, 0.0, size, size]), "command", panel)


def _lines(label: str, role: str, found: Sequence[Step], panel: int, until: float) -> list[Line]:
    curves = [(s.time, np.degrees(s.response - float(s.before.mean()))) for s in found]
    period = float(np.median(np.diff(found[0].time)))
    grid = np.arange(0.0, until, max(period, until / 600))
    each = np.array([np.interp(grid, t, y, left=math.nan) for t, y in curves])
    mean = np.array(each.mean(axis=0))
    if len(curves) < 2:
        return [Line(label, grid, mean, role, panel)]
    half = student(len(curves) - 1) * each.std(axis=0, ddof=1) / math.sqrt(len(curves))
    return [
        *(
            Line(label, t[t <= until], y[t <= until], role, panel, "thin")
            for t, y in curves[:MOST_REPEATS]
        ),
        Line(label, grid, mean, role, panel, "line", mean - half, mean + half),
    ]
