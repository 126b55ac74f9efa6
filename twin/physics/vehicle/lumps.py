"""Mass, centre and inertia of every part, in closed form or by quadrature over its shape."""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final

import numpy as np

from twin.physics.vehicle.design import Design, Mass, VehicleError
from twin.physics.vehicle.outline import Outline, PlacedFins, Segment

PANELS: Final = 400  # frusta of a shell: its area within 1e-5


@dataclass(frozen=True)
class Lump:
    """A part's mass, axially symmetric.

    Attributes
    ----------
    mass : [kg]
    station : of its centre of mass [m]
    transverse, axial : moments of inertia about that centre [kg m²]
    source : where the mass comes from
    """

    name: str
    mass: float
    station: float
    transverse: float
    axial: float
    source: str = ""


def total(lumps: Iterable[Lump], name: str = "") -> Lump:
    """All lumps together."""
    parts = list(lumps)
    mass = sum(lump.mass for lump in parts)
    if mass <= 0:
        return Lump(name, 0.0, 0.0, 0.0, 0.0)
    station = sum(lump.mass * lump.station for lump in parts) / mass
    transverse = sum(lump.transverse + lump.mass * (lump.station - station) ** 2 for lump in parts)
    return Lump(name, mass, station, transverse, sum(lump.axial for lump in parts))


def lumps(design: Design, outline: Outline) -> tuple[Lump, ...]:
    """Every part of the airframe: body, fins and masses inside; no motor, no gimbal.

    Raises
    ------
    VehicleError : a part without a mass, or one denser than steel
    """
    found = [_of_segment(segment, k) for k, segment in enumerate(outline.segments)]
    found += [_of_fins(placed, k) for k, placed in enumerate(outline.fins)]
    found += [_of_mass(mass, k) for k, mass in enumerate(design.masses)]
    return tuple(found)


def _of_segment(segment: Segment, index: int) -> Lump:
    part = segment.part
    name = part.name or f"{part.part} {index + 1}"
    if part.solid or part.wall is not None:
        volume, first, transverse, axial = _solid(segment)
    else:
        volume, first, transverse, axial = _shell(segment)
    if part.mass is not None:
        mass, source = part.mass, "given"
    elif part.density is not None and (part.solid or part.wall is not None):
        mass, source = part.density * volume, f"{part.density:g} kg/m³ × {volume * 1e6:.4g} cm³"
    else:
        raise VehicleError(
            f"body part {name!r} has no mass: give mass, or density with wall (or solid = true)"
        )
    scale = mass / volume
    middle = first / volume
    about = max(transverse - volume * middle**2, 0.0) * scale
    behind = middle if part.centre is None else part.centre
    return Lump(name, mass, segment.start + behind, about, axial * scale, source)


def _solid(segment: Segment) -> tuple[float, float, float, float]:
    """∫dV, ∫x dV, ∫(x² + r²/2) dV, ∫r² dV of the material, x behind the front."""
    x, weight, outer = segment.quadrature()
    wall = segment.part.wall
    inner = np.zeros_like(outer) if wall is None else np.maximum(outer - wall, 0.0)
    if segment.part.solid:
        inner = np.zeros_like(outer)
    area = math.pi * weight * (outer**2 - inner**2)
    polar = math.pi / 2 * weight * (outer**4 - inner**4)
    return (
        float(area.sum()),
        float(area @ x),
        float(area @ x**2 + polar.sum() / 2),
        float(polar.sum()),
    )


def _shell(segment: Segment) -> tuple[float, float, float, float]:
    """The same over the outer surface: a sum of frusta, each with its own centre and inertia."""
    t = np.linspace(0.0, 1.0, PANELS + 1)
    share = t * t if segment.widening else 1.0 - t[::-1] ** 2
    x = share * segment.part.length
    r = segment.radius(x)
    (x0, x1), (r0, r1) = (x[:-1], x[1:]), (r[:-1], r[1:])
    area = math.pi * (r0 + r1) * np.hypot(x1 - x0, r1 - r0)
    both = np.maximum(r0 + r1, 1e-300)
    first = area * (x0 + (x1 - x0) * (r0 + 2 * r1) / (3 * both))
    second = area * (x0 * x0 + (x1 - x0) * x0 * 2 * (r0 + 2 * r1) / (3 * both))
    second += area * (x1 - x0) ** 2 * (r0 + 3 * r1) / (6 * both)
    square = area * (r0**2 + r1**2) / 2  # ∫r² dA of a frustum, exactly
    return (
        float(area.sum()),
        float(first.sum()),
        float(second.sum() + square.sum() / 2),
        float(square.sum()),
    )


def _of_fins(placed: PlacedFins, index: int) -> Lump:
    """Plates that stand on the body; the mean over the roll angle of an even set is its own."""
    fins, plan, count = placed.fins, placed.plan, round(placed.fins.count)
    name = fins.name or f"fins {index + 1}"
    y, dy, lead, chord = plan.strips()
    off, area = placed.radius + y, dy * chord
    volume = count * float(area.sum()) * fins.thickness
    if fins.mass is not None:
        mass, source = fins.mass, "given"
    elif fins.density is not None:
        mass, source = fins.density * volume, f"{fins.density:g} kg/m³ × {volume * 1e6:.4g} cm³"
    else:
        raise VehicleError(f"{name!r} have no mass: give mass (of the whole set) or density")
    centre = plan.centroid()
    along = float(area @ ((lead + chord / 2 - centre) ** 2 + chord**2 / 12) / area.sum())
    round_axis = float(area @ off**2 / area.sum()) + fins.thickness**2 / 12
    return Lump(
        name,
        mass,
        placed.start + centre,
        mass * (along + round_axis / 2),
        mass * round_axis,
        source,
    )


def _of_mass(item: Mass, index: int) -> Lump:
    name = item.name or f"mass {index + 1}"
    r, length, m = item.diameter / 2, item.length, item.mass
    if not item.hollow or r == 0:
        transverse, axial = m * (3 * r * r + length * length) / 12, m * r * r / 2
    else:  # a thin tube with both ends closed, areas 2πrl and 2·πr²
        wall = m * length / (length + r)
        ends = m - wall
        transverse = wall * (r * r / 2 + length**2 / 12) + ends * (r * r / 4 + length**2 / 4)
        axial = wall * r * r + ends * r * r / 2
    return Lump(name, m, item.position, transverse, axial, "given")
