"""Speed of steps over their amplitude: from where on a servo runs at its fastest."""

import math
from collections.abc import Sequence

import numpy as np

from analysis.recording.measurements import Measurement
from analysis.report.figures import steps_of
from analysis.report.numbers import ReportNumbers
from analysis.report.parts import Line, Panel, Plot, Section
from analysis.response import slew_points

FIGURES = ("slew_rate", "speed_reached")


def slew(runs: Sequence[Measurement], numbers: ReportNumbers) -> Section | None:
    """Every step a ring, the slew rate a line; nothing without steps of several sizes."""
    panels: list[Panel] = []
    lines: list[Line] = []
    for name in [a.component for a in runs[0].axes]:
        drawn = [line for k, run in enumerate(runs) for line in _run(run, numbers, k, name)]
        if not drawn:
            continue
        panel = len(panels)
        panels.append(Panel(f"axis {name}", "speed [°/s]", 0, panel, y_log=True))
        lines += [Line(d.name, d.x, d.y, d.role, panel, d.style) for d in drawn]
    if not panels:
        return None
    plot = Plot(
        "slew",
        "Between 20 and 80 % of every step that stands clear of its noise. A linear gimbal's speed "
        "grows with the amplitude; the line is the speed from the knee on, where it stays.",
        "commanded step [°]",
        tuple(panels),
        tuple(lines),
        x_log=True,
        panel_height=300,
    )
    return Section("slew", "Slew rate", (), (plot,))


def _run(run: Measurement, numbers: ReportNumbers, k: int, name: str) -> list[Line]:
    axis = run.axis(name)
    told = {f.name: f for a in numbers.runs[k].figures if a.axis == name for f in a.figures}
    if axis is None or not any(n in told for n in FIGURES):
        return []
    amplitude, speed = slew_points(steps_of(axis))
    found = [Line(run.name, np.degrees(amplitude), np.degrees(speed), f"run{k}", 0, "rings")]
    rate, knee = told.get("slew_rate"), told.get("slew_knee")
    if rate is not None and knee is not None and math.isfinite(knee.value):
        ends = np.degrees([knee.value, amplitude[-1]])
        level = np.degrees([rate.value, rate.value])
        found.append(Line(run.name, ends, level, f"run{k}"))
    return found
