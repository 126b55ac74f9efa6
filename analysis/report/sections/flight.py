"""A flight beside its gimbal: attitude error, height and speed over time, every run."""

from collections.abc import Sequence

import numpy as np

from analysis.array import Array
from analysis.recording.measurements import Measurement
from analysis.report.numbers import ReportNumbers
from analysis.report.parts import Line, Panel, Plot, Section, thinned


def flight(runs: Sequence[Measurement], numbers: ReportNumbers) -> Section | None:  # noqa: ARG001
    """Nothing unless a vehicle flew."""
    panels: list[Panel] = []
    lines: list[Line] = []
    for title, label, signal, component, scale in SHOWN:
        drawn = [(k, run) for k, run in enumerate(runs) if signal in run.recording.series]
        if not drawn:
            continue
        row, column = divmod(len(panels), 2)
        panels.append(Panel(title, label, row, column))
        for k, run in drawn:
            series = run.recording[signal]
            values = _size(series.values) if component is None else series.column(component)
            t, y = thinned(series.time + run.shift, values * scale)
            lines.append(Line(run.name, t, y, f"run{k}", len(panels) - 1))
    if not panels:
        return None
    text = (
        "In flight the gimbal answers its controller, whose commands answer the gimbal: step and "
        "frequency figures need a test of the gimbal alone (twin step)."
    )
    caption = "Of the body's origin on the gimbal pivot, in the world frame; east, north, up."
    plot = Plot("flight", caption, "time [s]", tuple(panels), tuple(lines), panel_height=200)
    return Section("flight", "Flight", (text,), (plot,))


def _size(values: Array) -> Array:
    return np.array(np.linalg.norm(values, axis=1))


SHOWN: tuple[tuple[str, str, str, str | None, float], ...] = (
    ("attitude error about x", "error [°]", "control/error", "x", 180.0 / np.pi),
    ("attitude error about y", "error [°]", "control/error", "y", 180.0 / np.pi),
    ("height", "height [m]", "vehicle/position", "z", 1.0),
    ("speed", "speed [m/s]", "vehicle/velocity", None, 1.0),
)
