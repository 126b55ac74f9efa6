"""Shorthand for the few solids a printed part is made of, in millimetres."""

import math
from typing import Any

import manifold3d
import numpy as np
from numpy.typing import ArrayLike

Solid = Any  # manifold3d.Manifold, which carries no types
SEGMENTS = 64  # chords of a 52 mm bore stay within 0.03 mm of the circle


def box(low: tuple[float, float, float], high: tuple[float, float, float]) -> Solid:
    """Cuboid between two corners."""
    size = tuple(h - b for b, h in zip(low, high, strict=True))
    return manifold3d.Manifold.cube(size).translate(low)


def rod(
    start: ArrayLike, end: ArrayLike, radius: float, end_radius: float = -1.0, segments: int = 24
) -> Solid:
    """Cylinder, or cone with `end_radius`, between two points."""
    foot = np.asarray(start, float)
    along = np.asarray(end, float) - foot
    length = float(np.linalg.norm(along))
    solid = manifold3d.Manifold.cylinder(length, radius, end_radius, segments)
    tilt = math.degrees(math.acos(along[2] / length))
    turn = math.degrees(math.atan2(along[1], along[0]))
    return solid.rotate((0, tilt, turn)).translate(tuple(foot))


def tube(inner: float, outer: float, bottom: float, top: float) -> Solid:
    """Hollow cylinder about z."""
    return disc(outer, bottom, top) - disc(inner, bottom - 1, top + 1)


def disc(radius: float, bottom: float, top: float) -> Solid:
    """Solid cylinder about z."""
    return manifold3d.Manifold.cylinder(top - bottom, radius, radius, SEGMENTS).translate(
        (0, 0, bottom)
    )


def sector(radius: float, bottom: float, top: float, first: float, last: float) -> Solid:
    """Pie slice about z from azimuth `first` to `last` [degrees, counter-clockwise]."""
    angles = np.radians(np.linspace(first, last, max(3, int((last - first) / 10))))
    outline = [(0.0, 0.0)] + [(radius * math.cos(a), radius * math.sin(a)) for a in angles]
    section = manifold3d.CrossSection([outline])
    return manifold3d.Manifold.extrude(section, top - bottom).translate((0, 0, bottom))


def union(*solids: Solid) -> Solid:
    """All of them as one."""
    return manifold3d.Manifold.batch_boolean(list(solids), manifold3d.OpType.Add)


def hull(*solids: Solid) -> Solid:
    """Convex hull over all of them."""
    return manifold3d.Manifold.batch_hull(list(solids))


def sphere(radius: float, segments: int = 32) -> Solid:
    """Ball about the origin."""
    return manifold3d.Manifold.sphere(radius, segments)
