"""What is left of the angle when the command is taken away, by approach direction."""

from collections.abc import Sequence

import numpy as np

from analysis.recording.measurements import Measurement
from analysis.report.figures import at_rest, in_motion
from analysis.report.numbers import ReportNumbers
from analysis.report.parts import Line, Panel, Plot, Section, Style

SIDES: tuple[tuple[float, Style], ...] = ((1.0, "dots"), (-1.0, "rings"))
MOST = 1500  # points of one sweep


def hysteresis(runs: Sequence[Measurement], numbers: ReportNumbers) -> Section | None:
    """Error over command: dots approached from below, rings from above; loops of slow sweeps."""
    panels: list[Panel] = []
    lines: list[Line] = []
    for name in [a.component for a in runs[0].axes]:
        drawn = [line for k, run in enumerate(runs) for line in _run(run, numbers, k, name)]
        if not drawn:
            continue
        panel = len(panels)
        panels.append(Panel(f"axis {name}", "angle − command [°]", 0, panel))
        lines += [Line(d.name, d.x, d.y, d.role, panel, d.style) for d in drawn]
    if not panels:
        return None
    plot = Plot(
        "hysteresis",
        "Dots were approached from below, rings from above; lines are slow sweeps and hold the "
        "gimbal's lag beside its play. A tilt of the cloud is a gain that is not one.",
        "command [°]",
        tuple(panels),
        tuple(lines),
        panel_height=290,
    )
    return Section("hysteresis", "Hysteresis and linearity", (), (plot,))


def _run(run: Measurement, numbers: ReportNumbers, k: int, name: str) -> list[Line]:
    axis = run.axis(name)
    kind = {f.axis: f.kind for f in numbers.runs[k].figures}.get(name)
    if axis is None or kind not in ("steps", "staircase", "ramps"):
        return []
    role = f"run{k}"
    if kind == "ramps":
        u, y, _ = in_motion(axis)
        every = max(1, len(u) // MOST)
        return [Line(run.name, np.degrees(u)[::every], np.degrees(y - u)[::every], role)]
    u, y, way = at_rest(axis)
    u, error = np.degrees(u), np.degrees(y - u)
    return [
        Line(run.name, u[way == sign], error[way == sign], role, 0, style)
        for sign, style in SIDES
        if (way == sign).any()
    ]
