"""Step responses laid over each other: every repeat, and their mean with its interval."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from analysis.recording.measurements import Measurement
from analysis.report.figures import steps_of
from analysis.report.numbers import ReportNumbers
from analysis.report.parts import Line, Panel, Plot, Section
from analysis.response import Step

Array = NDArray[np.float64]

ALIKE = 0.05  # of the amplitude: steps that close are repeats
SHOWN = 6.0  # times the slowest arrival
MOST_REPEATS = 12  # drawn one by one; the mean is of all


def steps(runs: Sequence[Measurement], numbers: ReportNumbers) -> Section | None:
    """One panel per axis and direction, time from the command, angle from where the step began."""
    panels: list[Panel] = []
    lines: list[Line] = []
    names = [a.component for a in runs[0].axes]
    for name in names:
        for column, way in enumerate((1.0, -1.0)):
            drawn = [
                (k, run, _largest(_steps(run, numbers, k, name), way)) for k, run in enumerate(runs)
            ]
            drawn = [(k, run, found) for k, run, found in drawn if found]
            if not drawn:
                continue
            size = math.degrees(drawn[0][2][0].command_after - drawn[0][2][0].command_before)
            title = f"{name}, {'up' if way > 0 else 'down'} by {abs(size):.3g}°"
            row = names.index(name)
            panels.append(Panel(title, "angle from start [°]", row, column))
            index = len(panels) - 1
            shortest = min(float(s.time[-1]) for _, _, found in drawn for s in found)
            lines.append(_command(size, shortest, index))
            for k, run, found in drawn:
                lines += _run(run.name, f"run{k}", found, index, shortest)
    if not panels:
        return None
    plot = Plot(
        "steps",
        "Every repeat (thin), their mean (thick) and its 95 % interval (band; Student, as wide as "
        "the repeats differ: those of a simulation differ only in where backlash and friction "
        "left the gimbal before). Time counts from the command.",
        "time from command [s]",
        tuple(panels),
        tuple(lines),
        x_range=_shown(lines),
    )
    return Section("steps", "Step responses", (), (plot,))


def _shown(lines: Sequence[Line]) -> tuple[float, float] | None:
    """From just before the command until well after the slowest mean has come nine tenths."""
    arrivals, ends = [], []
    for line in lines:
        if line.style == "line" and line.role != "command":
            last = line.y[-1]
            there = np.flatnonzero(line.y / last >= 0.9) if last else np.array([], int)
            arrivals.append(float(line.x[there[0]]) if len(there) else float(line.x[-1]))
            ends.append(float(line.x[-1]))
    until = min(max(ends), SHOWN * max(arrivals))
    return (-0.04 * until, until) if until > 0.0 else None


def _steps(run: Measurement, numbers: ReportNumbers, k: int, name: str) -> tuple[Step, ...]:
    axis = run.axis(name)
    kinds = {f.axis: f.kind for f in numbers.runs[k].figures}
    if axis is None or kinds.get(name) not in ("steps", "staircase"):
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
    early = -0.05 * until
    return Line(
        "command", np.array([early, 0.0, 0.0, until]), np.array([0.0, 0.0, size, size]),
        "command", panel,
    )  # fmt: skip


def _run(label: str, role: str, found: Sequence[Step], panel: int, until: float) -> list[Line]:
    curves = [(s.time, np.degrees(s.response - float(s.before.mean()))) for s in found]
    period = float(np.median(np.diff(found[0].time)))
    grid = np.arange(0.0, until, max(period, until / 600))
    each = np.array([np.interp(grid, t, y, left=math.nan) for t, y in curves])
    lines = [
        Line(label, t[t <= until], y[t <= until], role, panel, "thin")
        for t, y in curves[:MOST_REPEATS]
        if len(curves) > 1
    ]
    mean = np.array(each.mean(axis=0))
    if len(curves) < 2:
        return [Line(label, grid, mean, role, panel)]
    from scipy.stats import t as student

    half = student.ppf(0.975, len(curves) - 1) * each.std(axis=0, ddof=1) / math.sqrt(len(curves))
    return [*lines, Line(label, grid, mean, role, panel, "line", mean - half, mean + half)]
