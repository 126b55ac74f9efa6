"""Ever smaller steps: what was asked, and what moved. Answers how to measure angle resolution."""

from collections.abc import Sequence

import numpy as np

from analysis.recording.measurements import Measurement
from analysis.report.figures import steps_of
from analysis.report.numbers import ReportNumbers
from analysis.report.parts import Line, Panel, Plot, Section

FLOOR = 1e-3  # degrees; a step that moved less is drawn here, a logarithm has no zero


def staircase(runs: Sequence[Measurement], numbers: ReportNumbers) -> Section | None:
    """Attained over commanded step, both logarithmic; nothing without a staircase."""
    panels: list[Panel] = []
    lines: list[Line] = []
    for name in [a.component for a in runs[0].axes]:
        points = [
            (k, run, *_moved(run, name))
            for k, run in enumerate(runs)
            if any(f.axis == name and f.kind == "staircase" for f in numbers.runs[k].figures)
        ]
        if not points:
            continue
        panels.append(Panel(f"axis {name}", "moved [°]", 0, len(panels), y_log=True))
        asked = np.concatenate([p[2] for p in points])
        ends = np.array([asked.min(), asked.max()])
        lines.append(Line("as commanded", ends, ends, "command", len(panels) - 1))
        lines += [
            Line(run.name, u, np.maximum(y, FLOOR), f"run{k}", len(panels) - 1, "rings")
            for k, run, u, y in points
        ]
    if not panels:
        return None
    plot = Plot(
        "staircase",
        f"Steps leave zero and return, every one drawn; what moved less than {FLOOR:g}° stands at "
        "the bottom. Threshold is the smallest step that always moves the gimbal beyond three "
        "standard errors, resolution the smallest that always moves it by at least half.",
        "commanded step [°]",
        tuple(panels),
        tuple(lines),
        x_log=True,
        panel_height=300,
    )
    return Section("resolution", "Threshold and resolution", (), (plot,))


def _moved(run: Measurement, name: str) -> tuple[np.ndarray, np.ndarray]:
    axis = run.axis(name)
    found = steps_of(axis) if axis is not None else ()
    asked = np.array([s.command_after - s.command_before for s in found])
    moved = np.array(
        [s.response[-max(len(s.response) // 3, 3) :].mean() - s.before.mean() for s in found]
    )
    return np.degrees(np.abs(asked)), np.degrees(moved * np.sign(asked))
