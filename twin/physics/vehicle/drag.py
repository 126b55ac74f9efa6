"""Drag along the axis, built up from friction, pressure and base; drag across the axis.

Sources: OpenRocket technical documentation (2013), section 3.4 [OR]; Hoerner, Fluid-Dynamic Drag
(1965) [H]; Jorgensen, NASA TR R-474 (1977) [J].
"""

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from twin.physics.aerodynamics.atmosphere import SEA_LEVEL_DENSITY
from twin.physics.vehicle.outline import Outline, PlacedFins, Segment

MACH: Final = 0.3  # at which the constant coefficient is taken
SPEED_OF_SOUND: Final = 340.294  # m/s, ICAO standard atmosphere at sea level
VISCOSITY: Final = 1.7894e-5  # Pa s, the same
LONG_CYLINDER: Final = 1.2  # across the flow, below Reynolds numbers of 2e5: [H]
# a cylinder of that length over diameter against an endless one: [J] figure 4, [H] page 3-16
SLENDERNESS: Final = (
    (0.0, 0.50),
    (2.0, 0.57),
    (5.0, 0.62),
    (10.0, 0.68),
    (20.0, 0.75),
    (40.0, 0.82),
)
LEADING: Final = {"square": 0.85, "rounded": 0.0, "airfoil": 0.0}  # times the stagnation pressure
TRAILING: Final = {"square": 1.0, "rounded": 0.5, "airfoil": 0.0}  # times the base pressure


@dataclass(frozen=True)
class Drag:
    """Drag coefficients referred to the reference area, by cause."""

    friction: float
    pressure: float
    base: float
    fins: float

    @property
    def total(self) -> float:
        """Axial drag coefficient."""
        return self.friction + self.pressure + self.base + self.fins

    @property
    def text(self) -> str:
        """The parts in words."""
        return (
            f"friction {self.friction:.3f}, nose and steps {self.pressure:.3f}, base"
            f" {self.base:.3f}, fin edges {self.fins:.3f}"
        )


def axial(outline: Outline, area: float, roughness: float) -> Drag:
    """Drag at zero angle of attack and Mach 0.3 at sea level, motor off."""
    speed = MACH * SPEED_OF_SOUND
    reynolds = SEA_LEVEL_DENSITY * speed * outline.tail / VISCOSITY
    skin = _friction(reynolds, roughness / outline.tail)
    base = 0.12 + 0.13 * MACH**2  # [OR] 3.94
    aft = math.pi * outline.segments[-1].aft ** 2
    return Drag(
        friction=skin * _wetted(outline) / area,
        pressure=_pressure(outline, base) / area,
        base=base * aft / area,
        fins=sum(_edges(placed, base) for placed in outline.fins) / area,
    )


def _friction(reynolds: float, roughness: float) -> float:
    """Skin friction of a turbulent boundary layer [OR] 3.78 to 3.82."""
    rough = 0.032 * roughness**0.2 if roughness > 0 else 0.0
    smooth = 1.48e-2 if reynolds < 1e4 else 1 / (1.50 * math.log(reynolds) - 5.6) ** 2
    limit = 51 * roughness**-1.039 if roughness > 0 else math.inf
    return (rough if reynolds > limit else smooth) * (1 - 0.1 * MACH**2)


def _wetted(outline: Outline) -> float:
    """Wetted area with form factors [m²]: [OR] 3.85."""
    planform = 0.0
    for segment in outline.segments:
        _, weight, radius = segment.quadrature()
        planform += float(2 * weight @ radius)
    slenderness = outline.tail / (2 * outline.largest_radius)
    body = (1 + 1 / (2 * slenderness)) * math.pi * planform
    return body + sum(
        (1 + 2 * placed.fins.thickness / placed.plan.chord())
        * 2 * round(placed.fins.count) * placed.plan.area()
        for placed in outline.fins
    )  # fmt: skip


def _pressure(outline: Outline, base: float) -> float:
    """Drag area of nose, transitions and steps [m²]: [OR] 3.86 and 3.88."""
    drag, before = 0.0, 0.0
    for segment in outline.segments:
        change = math.pi * (segment.front**2 - before**2)
        drag += 0.8 * change if change > 0 else -base * change
        growth = math.pi * (segment.aft**2 - segment.front**2)
        if growth > 0:
            drag += 0.8 * _joint(segment) ** 2 * growth
        elif growth < 0:
            gamma = segment.part.length / (2 * (segment.front - segment.aft))
            drag -= base * growth * float(np.clip((3 - gamma) / 2, 0.0, 1.0))
        before = segment.aft
    return drag


def _joint(segment: Segment) -> float:
    """Sine of the angle of the surface to the axis at the aft end."""
    step = 1e-4 * segment.part.length
    rise = segment.aft - float(segment.radius(segment.part.length - step))
    return rise / math.hypot(rise, step)


def _edges(placed: PlacedFins, base: float) -> float:
    """Drag area of the leading and trailing edges of a fin set [m²]: [OR] 3.89 to 3.93."""
    fins, plan = placed.fins, placed.plan
    stagnation = 1 + MACH**2 / 4 + MACH**4 / 40
    lead = LEADING[fins.section] * stagnation
    if fins.section != "square":
        lead = (1 - MACH**2) ** -0.417 - 1
    lead *= plan.leading_cosine() ** 2
    return (lead + TRAILING[fins.section] * base) * round(fins.count) * fins.thickness * plan.span


def across(slenderness: float) -> float:
    """Crossflow drag coefficient of a body of that length over diameter."""
    x, factor = zip(*SLENDERNESS, strict=True)
    return LONG_CYLINDER * float(np.interp(slenderness, x, factor))
