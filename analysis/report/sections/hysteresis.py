"""Angle minus command over the command, by approach direction."""

from collections.abc import Sequence

import numpy as np

from analysis.recording.measurements import Measurement
from analysis.report.numbers import ReportNumbers
from analysis.report.parts import Line, Plot, Section, Style
from analysis.report.samples import at_rest, in_motion
from analysis.report.sections.panels import axis_panels

SIDES: tuple[tuple[float, Style], ...] = ((1.0, "dots"), (-1.0, "rings"))
MOST = 1500  # points of one sweep


def hysteresis(runs: Sequence[Measurement], numbers: ReportNumbers) -> Section | None:
    """Dots approached from below, rings from above, loops of slow sweeps; None without any."""
    panels, lines = axis_panels(
        runs, lambda k, axis: _lines(axis, numbers, k), "angle − command [°]"
    )
    if not panels:
        return None
    plot = Plot(
        "hysteresis",
        "Settled angle minus command. Dots: approached from below; rings: from above. Lines: slow "
        "sweeps, which contain the lag of the gimbal as well as its backlash. A slope is a gain "
        "other than one.",
        "command [°]",
        panels,
        lines,
        panel_height=290,
    )
    return Section("hysteresis", "Hysteresis and linearity", (), (plot,))


def _lines(axis: Measurement, numbers: ReportNumbers, k: int) -> list[Line]:
    kind, role = numbers.runs[k].kind(axis.component), f"run{k}"
    if kind == "ramps":
        u, y, _ = in_motion(axis)
        every = max(1, len(u) // MOST)
        return [Line(axis.name, np.degrees(u)[::every], np.degrees(y - u)[::every], role)]
    if kind not in ("steps", "staircase"):
        return []
    u, y, way = at_rest(axis)
    u, error = np.degrees(u), np.degrees(y - u)
    return [
        Line(axis.name, u[way == sign], error[way == sign], role, 0, style)
        for sign, style in SIDES
        if (way == sign).any()
    ]
