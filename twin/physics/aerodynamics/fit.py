"""Whether a vehicle's air coefficients belong to its geometry.

A coarse check on loading, in milliseconds: `silhouette` makes the tables themselves.
"""

from typing import Final

import mujoco
import numpy as np
from numpy.typing import NDArray

from twin.errors import TwinError
from twin.physics.aerodynamics.silhouette import outer_shapes

Array = NDArray[np.float64]
STATIONS: Final = 120
LENGTH: Final = 0.02  # of the vehicle's length: ends and centroid of the planform
AREA: Final = 0.06  # of the planform; facets and fins seen askew cost up to 3 %
REBUILD: Final = "`python -m twin.physics.aerodynamics FILE` computes them from the geometry"


def misfits(model: mujoco.MjModel) -> tuple[str, ...]:
    """What of the numerics `air_*` does not fit the shapes of the body `vehicle`, one line each.

    Compared are both ends, the area and the centroid of the planform that the crossflow strips
    describe, and the stations of nose and fins, with the geoms that are not hidden.
    """
    try:
        parts = outer_shapes(model)
    except TwinError:
        return ()
    z, area = (np.array(model.numeric(f"air_strip_{what}").data) for what in ("z", "area"))
    low = min(float(points[:, 2].min()) for points in parts)
    high = max(float(points[:, 2].max()) for points in parts)
    if not area.sum() > 0:
        return ()
    slack, found = LENGTH * (high - low), []
    if z.max() > high + slack or z.min() < low - slack:
        found.append(
            f"air_strip_z reaches from {z.min():.4g} to {z.max():.4g} m, the geometry from"
            f" {low:.4g} to {high:.4g} m"
        )
    else:
        found += _planform(parts, z, area, low, high)
    for part in ("nose", "fin"):
        for station in model.numeric(f"air_{part}_z").data:
            if not low - slack <= station <= high + slack and model.numeric(
                f"air_{part}_slope"
            ).data.any():
                found.append(
                    f"air_{part}_z = {station:.4g} m lies off the geometry, {low:.4g} to {high:.4g} m"
                )
    return tuple(f"{text}: these coefficients are of another shape; {REBUILD}" for text in found)


def _planform(parts: list[Array], z: Array, area: Array, low: float, high: float) -> list[str]:
    edges = np.linspace(low, high, STATIONS + 1)
    middle = (edges[1:] + edges[:-1]) / 2
    width = np.max([_width(points, middle) for points in parts], axis=0)
    own, centre = width.sum() * (edges[1] - edges[0]), float(width @ middle / width.sum())
    stated, at = float(area.sum()), float(area @ z / area.sum())
    found = []
    if abs(stated / own - 1) > AREA:
        found.append(
            f"air_strip_area adds up to {stated * 1e4:.4g} cm², the geometry's planform to"
            f" {own * 1e4:.4g} cm²"
        )
    if abs(at - centre) > LENGTH * (high - low):
        found.append(
            f"the centroid of air_strip_area lies at {at:.4g} m, that of the geometry at"
            f" {centre:.4g} m"
        )
    return found


def _width(points: Array, z: Array) -> Array:
    """Width (…,) [m] of one convex part's shadow at stations z, seen from the side it is widest."""
    reach = np.hypot(points[:, 0], points[:, 1])
    order = np.argsort(points[:, 2])
    levels, at = np.unique(points[order, 2].round(6), return_inverse=True)
    widest = np.zeros(levels.size)
    np.maximum.at(widest, at, reach[order])
    return 2 * np.interp(z, levels, widest, left=0.0, right=0.0)
