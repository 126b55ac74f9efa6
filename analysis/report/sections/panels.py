"""One panel an axis, side by side, with the lines of every run that has something to show."""

from collections.abc import Callable, Sequence
from dataclasses import replace

from analysis.recording.measurements import Measurement
from analysis.report.parts import Line, Panel


def axis_panels(
    runs: Sequence[Measurement],
    draw: Callable[[int, Measurement], Sequence[Line]],
    y_label: str,
    *,
    y_log: bool = False,
) -> tuple[tuple[Panel, ...], tuple[Line, ...]]:
    """Panels and lines of the first run's axes; axes without a line are left out.

    Parameters
    ----------
    draw : number of a run and one of its axes → the lines of that axis
    """
    panels: list[Panel] = []
    lines: list[Line] = []
    for first in runs[0].axes:
        name = first.component
        axes = ((k, run.axis(name)) for k, run in enumerate(runs))
        drawn = [line for k, axis in axes if axis is not None for line in draw(k, axis)]
        if drawn:
            lines += [replace(line, panel=len(panels)) for line in drawn]
            panels.append(Panel(f"axis {name}", y_label, 0, len(panels), y_log))
    return tuple(panels), tuple(lines)
