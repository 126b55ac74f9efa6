"""Where flights end: mean place and dispersion ellipse, with intervals."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from twin.campaigns.statistics.statistic import Estimate, bootstrapped

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Ellipse:
    """Dispersion of places: one standard deviation along the principal axes.

    Attributes
    ----------
    centre : mean place, east and north of the launch point [m]
    major, minor : deviations with intervals [m]
    angle : of the major axis from east to north [rad]
    """

    centre: tuple[float, float]
    major: Estimate
    minor: Estimate
    angle: float

    def outline(self, share: float = 0.5) -> Array:
        """Points (n, 2) of the ellipse that holds a share of a normal distribution [m]."""
        t = np.linspace(0.0, 2.0 * math.pi, 121)
        scale = math.sqrt(-2.0 * math.log(1.0 - share))
        x, y = scale * self.major.value * np.cos(t), scale * self.minor.value * np.sin(t)
        c, s = math.cos(self.angle), math.sin(self.angle)
        return np.stack([self.centre[0] + c * x - s * y, self.centre[1] + s * x + c * y], axis=1)


def ellipse(places: Array, confidence: float) -> Ellipse | None:
    """Dispersion of places (n, 2) [m]; None where they are fewer than three."""
    kept = places[np.isfinite(places).all(axis=1)]
    if len(kept) < 3:
        return None
    axis = np.linalg.eigh(np.cov(kept, rowvar=False))[1][:, 1]
    x, y = kept.mean(axis=0).tolist()
    return Ellipse(
        (x, y),
        bootstrapped(kept, lambda p: _deviation(p, +1), confidence),
        bootstrapped(kept, lambda p: _deviation(p, -1), confidence),
        math.atan2(axis[1], axis[0]) % math.pi,
    )


def _deviation(places: Array, sign: int) -> Array:
    """Larger (+1) or smaller (-1) deviation of places (..., n, 2) along their axes (...)."""
    d = places - places.mean(axis=-2, keepdims=True)
    a, b = (d[..., 0] ** 2).mean(axis=-1), (d[..., 1] ** 2).mean(axis=-1)
    c = (d[..., 0] * d[..., 1]).mean(axis=-1)
    n = places.shape[-2]
    root = 0.5 * (a + b) + sign * np.hypot(0.5 * (a - b), c)
    return np.asarray(np.sqrt(np.maximum(root, 0.0) * n / (n - 1)))
