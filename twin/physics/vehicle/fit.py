"""Parts inside the body that take each other's place, listed as notes."""

from itertools import combinations
from typing import Final, NamedTuple

import numpy as np

from twin.physics.motor import Motor
from twin.physics.vehicle.carrier import Carrier
from twin.physics.vehicle.design import Design, Mass
from twin.physics.vehicle.outline import Outline

LEAST: Final = 1e-3  # m, of overlap that is reported
ROOM: Final = 0.8  # of a ring's width: a tube not wider than this passes through it
MOST: Final = 3  # overlaps that are reported


class _Place(NamedTuple):
    """What fills a cylinder around the axis; stations and diameter [m]."""

    name: str
    low: float
    high: float
    diameter: float
    hollow: bool


def misfits(
    design: Design, outline: Outline, motor: Motor, held: Carrier | None
) -> tuple[str, ...]:
    """Masses inside that overlap each other, the motor or the gimbal, or are wider than the body.

    Points and discs have no volume to overlap. A hollow mass may have a narrower one inside or
    through it, and the motor may sit in a tube. The largest overlap comes first.
    """
    masses = [_place(item, k) for k, item in enumerate(design.masses)]
    full = [place for place in masses if place.high > place.low and place.diameter > 0]
    drive = _drive(design, outline, motor, held)
    pairs = [pair for pair in combinations(full, 2) if not _inside(*pair)]
    pairs += [(a, drive) for a in full if not (a.hollow and a.diameter > drive.diameter)]
    overlaps = [(min(a.high, b.high) - max(a.low, b.low), a, b) for a, b in pairs]
    found = [
        f"{a.name} and {b.name} overlap by {1e3 * by:.0f} mm, {1e3 * max(a.low, b.low):.0f} to"
        f" {1e3 * min(a.high, b.high):.0f} mm behind the tip"
        for by, a, b in sorted(overlaps, key=lambda overlap: -overlap[0])
        if by > LEAST
    ]
    middles = np.array([item.position for item in design.masses])
    for place, room in zip(masses, (2 * outline.radius(middles)).tolist(), strict=True):
        if place.diameter > room + LEAST:
            found.append(
                f"{place.name} is {1e3 * place.diameter:.3g} mm wide; the body has"
                f" {1e3 * room:.3g} mm there"
            )
    more = [f"and {len(found) - MOST} more parts that do not fit"] if len(found) > MOST else []
    return tuple(found[:MOST] + more)


def _place(item: Mass, k: int) -> _Place:
    name, half = item.name or f"mass {k + 1}", item.length / 2
    return _Place(name, item.position - half, item.position + half, item.diameter, item.hollow)


def _drive(design: Design, outline: Outline, motor: Motor, held: Carrier | None) -> _Place:
    """The motor, or the gimbal with it, which leaves nothing free of the tube around it."""
    front = outline.nozzle - motor.length
    if held is None or design.gimbal is None:
        return _Place("the motor", front, outline.nozzle, motor.diameter, hollow=False)
    front = min(front, design.gimbal.pivot - held.reach)
    return _Place("the gimbal", front, outline.nozzle, 2 * outline.largest_radius, hollow=False)


def _inside(a: _Place, b: _Place) -> bool:
    """Whether one is a shell around all of the other, or a ring on it."""
    wide, narrow = (a, b) if a.diameter >= b.diameter else (b, a)
    within = wide.low - LEAST <= narrow.low and narrow.high <= wide.high + LEAST
    ring = narrow.low - LEAST <= wide.low and wide.high <= narrow.high + LEAST
    slim = narrow.diameter < (wide.diameter if within else ROOM * wide.diameter)
    return wide.hollow and slim and (within or ring)
