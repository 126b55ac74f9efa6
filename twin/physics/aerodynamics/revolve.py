"""The body of revolution that a mesh approximates.

A mesh of a nose lies inside the surface it was sampled from: its slices are polygons inscribed in
circles and its outline consists of chords; MuJoCo's hemisphere of ten levels is 0.3 % too narrow.
Its vertices lie on the surface, so the body of revolution can be reconstructed.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Faces = NDArray[np.int64]

SEGMENTS = 512  # of a circle: mean width of the polygon within (π/512)²/6 = 6e-6
_FEWEST_LEVELS = 8  # a cone, prism or plate has two to four, with true edges
_MOST_LEVELS = 400  # of a profile; a mesh without levels has one for every vertex
_FEWEST_POINTS = 4  # of a level in the mean, by which a circle is recognised
_FINER = 8  # levels inserted for each level of the mesh
_SAME = 2e-6  # m; tolerance of a level, since MuJoCo stores vertices in single precision
_ROUND = 1e-4  # of the largest radius: tolerance of a vertex from the circle of its level
_NARROWER = 0.03  # of the largest width: tolerance of facets inside; an octagon has 0.026
_WIDER = 1e-3  # of the same, outside: rounding


def levels(vertices: Array) -> Array:
    """Stations (k,) [m] at which vertices (n, 3) [m] lie, ascending, with near ones merged."""
    stations = np.unique(vertices[:, 2])
    return np.asarray(stations[np.concatenate([[True], np.diff(stations) > _SAME])])


def profile(vertices: Array) -> tuple[Array, Array] | None:
    """Stations and radii (k,) [m] of a body of revolution about an axis along z, or None.

    On every level all vertices (n, 3) [m] lie on one circle about the axis; discs may close the
    ends. Bodies of fewer than eight levels count as polyhedra.
    """
    stations = levels(vertices)
    if not _FEWEST_LEVELS <= stations.size <= min(_MOST_LEVELS, len(vertices) / _FEWEST_POINTS):
        return None
    radius = np.hypot(*(vertices[:, :2] - _axis(vertices)).T)
    at = np.searchsorted(stations, vertices[:, 2] + _SAME) - 1
    widest = np.zeros(stations.size)
    np.maximum.at(widest, at, radius)
    inner = (at > 0) & (at < stations.size - 1)
    if np.abs(radius - widest[at])[inner].max() > _ROUND * widest.max():
        return None
    return stations, widest


def _axis(vertices: Array) -> Array:
    return np.asarray((vertices[:, :2].min(axis=0) + vertices[:, :2].max(axis=0)) / 2)


def refined(vertices: Array, faces: Faces, width: Callable[[Array], Array]) -> tuple[Array, Faces]:
    """Vertices (n, 3) [m] and faces (m, 3) of the body of revolution that a mesh approximates.

    The square of the radius is interpolated by a cubic spline, which is exact for spheres,
    ellipsoids and paraboloids. A mesh of another body, or with edges that the spline cannot follow,
    is returned unchanged; `width` gives its mean width [m] at stations (…,) [m].
    """
    from scipy.interpolate import CubicSpline

    outline = profile(vertices)
    if outline is None:
        return vertices, faces
    stations, radii = outline
    square = CubicSpline(stations, radii * radii)
    middle = (stations[1:] + stations[:-1]) / 2
    gap = (2 * np.sqrt(np.maximum(square(middle), 0.0)) - width(middle)) / (2 * radii.max())
    if gap.max() > _NARROWER or gap.min() < -_WIDER:
        return vertices, faces
    steps = np.arange(_FINER) / _FINER
    between = stations[:-1, None] + np.diff(stations)[:, None] * steps
    fine = np.append(between.ravel(), stations[-1])
    return _revolved(fine, np.sqrt(np.maximum(square(fine), 0.0)), _axis(vertices))


def _revolved(stations: Array, radii: Array, axis: Array) -> tuple[Array, Faces]:
    """Mantle of a body of revolution; trimesh's own drops its smallest triangles."""
    angle = 2 * np.pi * np.arange(SEGMENTS) / SEGMENTS
    circle = np.column_stack([np.cos(angle), np.sin(angle)])
    flat = radii[:, None, None] * circle + axis  # (k, s, 2)
    height = np.broadcast_to(stations[:, None, None], (*flat.shape[:2], 1))
    k, s = np.meshgrid(np.arange(stations.size - 1), np.arange(SEGMENTS), indexing="ij")
    near, beside = k * SEGMENTS + s, k * SEGMENTS + (s + 1) % SEGMENTS
    low = np.stack([near, beside, beside + SEGMENTS], axis=-1)
    high = np.stack([near, beside + SEGMENTS, near + SEGMENTS], axis=-1)
    faces = np.concatenate([low.reshape(-1, 3), high.reshape(-1, 3)])
    return np.concatenate([flat, height], axis=-1).reshape(-1, 3), faces.astype(np.int64)
