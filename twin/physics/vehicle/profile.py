"""Radius over length of noses and transitions.

Every shape grows from 0 to 1 over a length of 1; a nose is scaled to its base, a transition
between its two radii. Source: G. A. Crowell, The Descriptive Geometry of Nose Cones (1996);
OpenRocket technical documentation (2013), appendix A, whose clipped shapes are not used.
"""

from collections.abc import Callable
from typing import Final, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from twin.physics.aerodynamics.silhouette import gauss

Array = NDArray[np.float64]
Shape = Literal["cone", "ogive", "ellipsoid", "parabola", "power", "haack"]
SHAPES: Final = get_args(Shape)
DEFAULTS: Final = {"parabola": 1.0, "power": 0.5, "haack": 0.0}  # K', exponent, C (von Kármán)
NODES: Final = 64  # of the quadrature along a part


def unit_radius(
    shape: Shape, slenderness: float, parameter: float | None
) -> Callable[[Array], Array]:
    """Radius over the base radius at distances x from the tip over the length, both 0 to 1.

    Parameters
    ----------
    slenderness : length over base radius; a tangent ogive depends on it
    parameter : exponent of `power`, C of `haack`, K' of `parabola`; `DEFAULTS` where None
    """
    p = DEFAULTS.get(shape, 0.0) if parameter is None else parameter
    makers: dict[str, Callable[[Array], Array]] = {
        "cone": lambda x: x,
        "ogive": lambda x: _ogive(x, slenderness),
        "ellipsoid": lambda x: np.sqrt(np.maximum(1 - (1 - x) ** 2, 0.0)),
        "parabola": lambda x: (2 * x - p * x * x) / (2 - p),
        "power": lambda x: x**p if p > 0 else np.where(x > 0, 1.0, 0.0),
        "haack": lambda x: _haack(x, p),
    }
    return makers[shape]


def _ogive(x: Array, slenderness: float) -> Array:
    """Tangent ogive; blunter than a hemisphere it is an ellipsoid."""
    if slenderness <= 1.0:
        return np.sqrt(np.maximum(1 - (1 - x) ** 2, 0.0))
    rho = (1 + slenderness**2) / 2  # radius of the arc over the base radius
    along = slenderness * (1 - x)
    return np.asarray(np.sqrt(np.maximum(rho**2 - along**2, 0.0)) + 1 - rho)


def _haack(x: Array, c: float) -> Array:
    theta = np.arccos(np.clip(1 - 2 * x, -1.0, 1.0))
    square = (theta - np.sin(2 * theta) / 2 + c * np.sin(theta) ** 3) / np.pi
    return np.asarray(np.sqrt(np.maximum(square, 0.0)))


def nodes(count: int = NODES) -> tuple[Array, Array]:
    """Abscissae and weights (count,) on 0 to 1, dense at 0, where a blunt tip is steep."""
    x, weight = gauss(count)
    t = (1 + x) / 2
    return t * t, weight * t  # x = t², dx = 2 t dt, dt = weight / 2
