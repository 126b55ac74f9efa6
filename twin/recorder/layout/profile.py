"""Altitude over downrange of a flight, as a picture with a grid."""

import math
from collections.abc import Sequence

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import NDArray

from twin.recorder import columns, style
from twin.recorder.layout import plots

Floats = NDArray[np.float64]
Stamps = NDArray[np.int64]

PROFILE = f"{plots.VIEW}/profile"
PERIOD_NS = 100_000_000
GRID_LINES = 5
GRID_COLOR, TEXT_COLOR = (70, 75, 85), (170, 175, 185)


class Profile:
    """Collects positions; writes the place at each time, and at the end the whole path."""

    def __init__(self) -> None:
        self._path: list[Floats] = []
        self._first: Floats | None = None

    def drain(self, stream: columns.Columns, time: Stamps, wall: Stamps, position: Floats) -> None:
        """Take positions (n, 3) in the world [m]; rows that are not finite are skipped."""
        rows = np.flatnonzero(np.isfinite(position).all(axis=1))
        if not rows.size:
            return
        _, first = np.unique(time[rows] // PERIOD_NS, return_index=True)
        rows = rows[first]
        if self._first is None:
            self._first = position[rows[0]].copy()
        moved = position[rows] - self._first
        flat = np.column_stack([np.hypot(moved[:, 0], moved[:, 1]), -moved[:, 2]])
        self._path.append(flat)
        stamps = columns.times(time[rows], wall[rows])
        stream.send_columns(f"{PROFILE}/now", stamps, columns.points(flat))

    def start(self, stream: rr.RecordingStream) -> None:
        """Write the style of the present place."""
        dot = rr.Points2D.from_fields(colors=[style.THRUST], radii=[-5.0])
        stream.log(f"{PROFILE}/now", dot, static=True)

    def finish(self, stream: rr.RecordingStream) -> rrb.Spatial2DView | None:
        """Write path, apogee and grid; returns the view, None without a path."""
        if not self._path:
            return None
        path = np.vstack(self._path)
        width, height = float(np.ptp(path[:, 0])), -float(path[:, 1].min())
        if not (math.isfinite(width + height) and width + height > 0.0):
            return None
        line = rr.LineStrips2D([path], colors=[style.SIMULATED], radii=[-1.5])
        stream.log(f"{PROFILE}/path", line, static=True)
        top = path[int(np.argmin(path[:, 1]))]
        apogee = rr.Points2D(
            [top], labels=[f"highest point {-top[1]:.0f} m"], colors=[style.COMMAND], radii=[-3.5],
            show_labels=True,
        )  # fmt: skip
        stream.log(f"{PROFILE}/apogee", apogee, static=True)
        step = grid_step(max(width, height))
        self._grid(stream, step, width, height)
        return view(
            rrb.VisualBounds2D(
                x_range=[-0.12 * max(width, step), max(width, step) * 1.06],
                y_range=[-1.15 * max(height, step), 0.3 * max(height, step)],
            )
        )

    @staticmethod
    def _grid(stream: rr.RecordingStream, step: float, width: float, height: float) -> None:
        ups, alongs = _steps(step, height), _steps(step, width)
        far, high = max(width, alongs[-1]), max(height, ups[-1])
        lines = [[[0.0, -u], [far, -u]] for u in ups] + [[[a, 0.0], [a, -high]] for a in alongs]
        grid = rr.LineStrips2D(lines, colors=[GRID_COLOR], radii=[-0.5], draw_order=-1.0)
        stream.log(f"{PROFILE}/grid", grid, static=True)
        places = [[-0.06 * far, -u] for u in ups] + [[a, 0.05 * high] for a in alongs[1:]]
        labels = [f"{u:g} m" for u in ups] + [f"{a:g} m" for a in alongs[1:]]
        text = rr.Points2D(
            places, labels=labels, colors=[TEXT_COLOR], radii=[-0.1], show_labels=True
        )
        stream.log(f"{PROFILE}/scale", text, static=True)


def view(bounds: rrb.VisualBounds2D | None = None) -> rrb.Spatial2DView:
    """View of the profile."""
    return rrb.Spatial2DView(
        name="Altitude over downrange [m]",
        contents=[f"{PROFILE}/**"],
        visual_bounds=bounds,
        background=(13, 14, 16),
    )


def grid_step(extent: float) -> float:
    """A step of 1, 2 or 5 times a power of ten for about `GRID_LINES` lines."""
    rough = extent / GRID_LINES
    power = 10.0 ** math.floor(math.log10(rough))
    return power * next(k for k in (1.0, 2.0, 5.0, 10.0) if k * power >= rough)


def _steps(step: float, extent: float) -> Sequence[float]:
    return [k * step for k in range(int(extent / step) + 2)]
