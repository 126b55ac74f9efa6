"""Ever smaller steps, commanded and measured: threshold and angle resolution."""

from collections.abc import Sequence

import numpy as np

from analysis.recording.measurements import Measurement
from analysis.report.numbers import ReportNumbers
from analysis.report.parts import Line, Plot, Section
from analysis.report.samples import steps_of
from analysis.report.sections.panels import axis_panels

FLOOR = 1e-3  # degrees; a step that moved less is drawn here, a logarithm has no zero


def staircase(runs: Sequence[Measurement], numbers: ReportNumbers) -> Section | None:
    """Measured over commanded step, both logarithmic; None without a staircase."""
    panels, lines = axis_panels(
        runs, lambda k, axis: _lines(axis, numbers, k), "moved [°]", y_log=True
    )
    if not panels:
        return None
    plot = Plot(
        "staircase",
        f"Each step leaves zero and returns. Steps that moved the gimbal by less than {FLOOR:g}° "
        "are drawn at the bottom. Threshold: the smallest step that, with every larger one, moves "
        "the gimbal by more than three standard errors. Resolution: the smallest that, with every "
        "larger one, moves it by at least half of the command.",
        "commanded step [°]",
        panels,
        lines,
        x_log=True,
        panel_height=300,
    )
    return Section("resolution", "Threshold and resolution", (), (plot,))


def _lines(axis: Measurement, numbers: ReportNumbers, k: int) -> list[Line]:
    if numbers.runs[k].kind(axis.component) != "staircase":
        return []
    steps = steps_of(axis)
    u = np.array([s.command_after - s.command_before for s in steps])
    y = np.array([s.rest.mean() - s.before.mean() for s in steps]) * np.sign(u)
    u = np.degrees(np.abs(u))
    ends = np.array([u.min(), u.max()])
    return [
        Line("as commanded", ends, ends, "command"),
        Line(axis.name, u, np.maximum(np.degrees(y), FLOOR), f"run{k}", 0, "rings"),
    ]
