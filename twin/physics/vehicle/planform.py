"""Plan form of a fin: a polygon over the body's surface, and its integrals along the span."""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from twin.physics.aerodynamics.silhouette import gauss
from twin.physics.vehicle.design import FinSet

Array = NDArray[np.float64]
ELLIPSE_POINTS: Final = 400  # of half an ellipse: its area within 1e-5
_GAUSS: Final = gauss(4)


@dataclass(frozen=True)
class PlanForm:
    """Corners of one fin from the root's leading edge over the tip to the root's trailing edge.

    Attributes
    ----------
    x, y : behind the root's leading edge, and off the body (n,) [m]
    corners : distances behind the root's leading edge at which the outline kinks [m]
    """

    x: Array
    y: Array
    corners: tuple[float, ...]

    @classmethod
    def of(cls, fins: FinSet) -> "PlanForm":
        """Plan form of a fin set."""
        if fins.shape == "points":
            x, y = np.array(fins.points, dtype=float).T
            return cls(x - x[0], y, tuple(float(v) for v in x - x[0]))
        assert fins.root is not None
        assert fins.span is not None
        if fins.shape == "ellipse":
            angle = np.linspace(np.pi, 0.0, ELLIPSE_POINTS)
            x, y = fins.root / 2 * (1 + np.cos(angle)), fins.span * np.sin(angle)
            return cls(x, np.maximum(y, 0.0), (0.0, fins.root / 2, fins.root))
        tip = fins.root if fins.tip is None else fins.tip
        x = np.array([0.0, fins.sweep, fins.sweep + tip, fins.root])
        return cls(x, np.array([0.0, fins.span, fins.span, 0.0]), tuple(float(v) for v in x))

    @property
    def root(self) -> float:
        """Root chord [m]."""
        return float(self.x[-1] - self.x[0])

    @property
    def span(self) -> float:
        """From body to tip [m]."""
        return float(self.y.max())

    def reach(self, x: Array) -> Array:
        """Farthest off the body (…,) [m] at distances x behind the root's leading edge [m]."""
        at = np.asarray(x, dtype=float)
        out = np.zeros_like(at)
        for (xa, ya), (xb, yb) in zip(self._points, np.roll(self._points, -1, axis=0), strict=True):
            low, high = min(xa, xb), max(xa, xb)
            inside = (at >= low) & (at <= high)
            share = np.clip((at - xa) / (xb - xa), 0, 1) if high > low else np.full_like(at, 0.5)
            here = max(ya, yb) if high == low else ya + share * (yb - ya)
            out = np.where(inside, np.maximum(out, here), out)
        return out

    @property
    def _points(self) -> Array:
        return np.column_stack([self.x, self.y])

    def strips(self) -> tuple[Array, Array, Array, Array]:
        """Heights y (k,), weights dy, leading edges and chords there [m]: exact for polygons."""
        levels = np.unique(self.y)
        t, weight = (_GAUSS[0] + 1) / 2, _GAUSS[1] / 2
        y = (levels[:-1, None] + np.diff(levels)[:, None] * t).ravel()
        dy = (np.diff(levels)[:, None] * weight).ravel()
        lead, trail = np.full(y.size, np.inf), np.full(y.size, -np.inf)
        for (xa, ya), (xb, yb) in zip(self._points[:-1], self._points[1:], strict=True):
            cut = (y - ya) * (y - yb) < 0
            if cut.any():
                x = xa + (y[cut] - ya) / (yb - ya) * (xb - xa)
                lead[cut], trail[cut] = np.minimum(lead[cut], x), np.maximum(trail[cut], x)
        return y, dy, lead, trail - lead

    def area(self) -> float:
        """Area of one fin [m²]."""
        _, dy, _, chord = self.strips()
        return float(dy @ chord)

    def chord(self) -> float:
        """Mean aerodynamic chord ∫c² dy / area [m]."""
        _, dy, _, chord = self.strips()
        return float(dy @ chord**2 / (dy @ chord))

    def centroid(self) -> float:
        """Centre of the area, behind the root's leading edge [m]."""
        _, dy, lead, chord = self.strips()
        return float(dy @ (chord * (lead + chord / 2)) / (dy @ chord))

    def quarter(self) -> float:
        """Quarter of the mean aerodynamic chord, behind the root's leading edge [m].

        Source: Barrowman & Barrowman (1966), NARAM-8, eq. 76a, for a trapezoid; OpenRocket
        technical documentation (2013), section 3.2.2, for any plan form.
        """
        _, dy, lead, chord = self.strips()
        return float(dy @ (chord * (lead + chord / 4)) / (dy @ chord))

    def mid_chord_cosine(self) -> float:
        """Cosine of the sweep of the line through the middles of the chords, mean over the span."""
        y, dy, lead, chord = self.strips()
        return _mean_cosine(y, dy, lead + chord / 2)

    def leading_cosine(self) -> float:
        """Cosine of the leading edge's sweep, mean over the span."""
        y, dy, lead, _ = self.strips()
        return _mean_cosine(y, dy, lead)

    def moment(self, radius: float, power: int) -> float:
        """∫ c (radius + y)ⁿ dy of one fin [m^(n + 2)]."""
        y, dy, _, chord = self.strips()
        return float(dy @ (chord * (radius + y) ** power))


def _mean_cosine(y: Array, dy: Array, x: Array) -> float:
    """Of the mean angle over the span of a line x(y) that is straight in every band."""
    bands = (-1, _GAUSS[0].size)
    height, width, along = y.reshape(bands), dy.reshape(bands).sum(axis=1), x.reshape(bands)
    angle = np.arctan((along[:, -1] - along[:, 0]) / (height[:, -1] - height[:, 0]))
    return float(np.cos(width @ angle / width.sum()))
