"""Speed of steps over their amplitude: from where on a servo runs at its fastest."""

import math
from collections.abc import Sequence

import numpy as np

from analysis.recording.measurements import Measurement
from analysis.report.numbers import ReportNumbers
from analysis.report.parts import Line, Plot, Section
from analysis.report.samples import steps_of
from analysis.report.sections.panels import axis_panels
from analysis.response import slew_points

FIGURES = ("slew_rate", "speed_reached")


def slew(runs: Sequence[Measurement], numbers: ReportNumbers) -> Section | None:
    """Every step as a ring, the slew rate as a line; None without steps of several sizes."""
    panels, lines = axis_panels(
        runs, lambda k, axis: _lines(axis, numbers, k), "speed [°/s]", y_log=True
    )
    if not panels:
        return None
    plot = Plot(
        "slew",
        "Speed between 20 and 80 % of each step that exceeds its noise. The speed of a linear "
        "gimbal is proportional to the amplitude; the line is the slew rate, from the knee on.",
        "commanded step [°]",
        panels,
        lines,
        x_log=True,
        panel_height=300,
    )
    return Section("slew", "Slew rate", (), (plot,))


def _lines(axis: Measurement, numbers: ReportNumbers, k: int) -> list[Line]:
    figures = numbers.runs[k].by_name(axis.component)
    if not any(n in figures for n in FIGURES):
        return []
    amplitude, speed = slew_points(steps_of(axis))
    found = [Line(axis.name, np.degrees(amplitude), np.degrees(speed), f"run{k}", 0, "rings")]
    rate, knee = figures.get("slew_rate"), figures.get("slew_knee")
    if rate is not None and knee is not None and math.isfinite(knee.value):
        ends = np.degrees([knee.value, amplitude[-1]])
        found.append(Line(axis.name, ends, np.degrees([rate.value, rate.value]), f"run{k}"))
    return found
