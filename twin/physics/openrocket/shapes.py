"""Outer shapes of OpenRocket's parts: nose, tubes, transitions and fins."""

import math
from typing import Final

from twin.physics.openrocket.tree import Part, corners
from twin.physics.vehicle.design import Body, FinSet, Plan, Section, VehicleError
from twin.physics.vehicle.design import Part as Kind
from twin.physics.vehicle.planform import PlanForm
from twin.physics.vehicle.profile import Shape

KINDS: Final[dict[str, Kind]] = {
    "nosecone": "nose", "bodytube": "tube", "transition": "transition",
}  # fmt: skip
SHAPES: Final[dict[str, Shape]] = {
    "conical": "cone", "ogive": "ogive", "ellipsoid": "ellipsoid", "power": "power",
    "parabolic": "parabola", "haack": "haack",
}  # fmt: skip
PLANS: Final[dict[str, Plan]] = {
    "trapezoidfinset": "trapezoid", "ellipticalfinset": "ellipse", "freeformfinset": "points",
}  # fmt: skip
SECTIONS: Final[dict[str, Section]] = {
    "square": "square", "rounded": "rounded", "airfoil": "airfoil",
}  # fmt: skip


def body(part: Part) -> Body:
    """Shape of a nose, tube or transition, without its mass."""
    if part.tag == "bodytube":
        return Body(part="tube", length=part.length, diameter=2 * part.outer)
    word = part.word("shape", "ogive")
    if word not in SHAPES:
        raise VehicleError(f"{part.name}: shape {word[:40]!r} is not known")
    shape = SHAPES[word]
    free = shape in ("power", "parabola", "haack")
    return Body(
        part=KINDS[part.tag],
        length=part.length,
        diameter=2 * part.outer,
        shape=shape,
        parameter=part.number("shapeparameter") if free else None,
    )


def fin_set(part: Part) -> FinSet:
    """Shape of a fin set, without its mass.

    Raises
    ------
    VehicleError : its plan form has no area
    """
    shape = PLANS[part.tag]
    points = corners(part) if shape == "points" else ()
    fins = FinSet(
        count=float(part.count),
        thickness=part.size("thickness"),
        shape=shape,
        root=None if points else part.length,
        span=None if points else part.size("height"),
        tip=part.size("tipchord") if shape == "trapezoid" else None,
        sweep=part.number("sweeplength") if shape == "trapezoid" else 0.0,
        points=tuple((x - points[0][0], y) for x, y in points),
        position=part.start,
        cant=math.radians(part.number("cant")),
        section=SECTIONS.get(part.word("crosssection", "square"), "square"),
        mass=0.0,
    )
    if not PlanForm.of(fins).area() > 0:
        raise VehicleError(f"{part.name}: its plan form has no area; give it a root and a height")
    return fins
