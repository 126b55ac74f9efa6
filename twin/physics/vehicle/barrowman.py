"""Normal force, roll damping and roll moment of every part, after Barrowman.

All slopes are referred to the vehicle's reference area. Sources: Barrowman & Barrowman (1966),
NARAM-8 [B66]; Barrowman (1967), The practical calculation of the aerodynamic characteristics of
slender finned vehicles [B67]; OpenRocket technical documentation (2013) [OR].
"""

import math
from dataclasses import dataclass
from typing import Final

from twin.physics.vehicle.outline import Outline, PlacedFins, Segment

# of sets of five to eight fins over the sum of single ones: MIL-HDBK-762, in [OR] eq. 3.54
CROWDING: Final = {5: 0.948, 6: 0.913, 7: 0.854, 8: 0.810}
NEGLIGIBLE: Final = 1e-9  # of a slope
SLOPE: Final = "2 ΔA / A_ref, Barrowman 1966"


@dataclass(frozen=True)
class Term:
    """Normal force of one part at small angles of attack.

    Attributes
    ----------
    slope : C_Nα, referred to the reference area [1/rad]
    station : of its centre of pressure [m]
    source : formula and publication
    """

    name: str
    slope: float
    station: float
    source: str


def body_terms(outline: Outline, area: float) -> list[Term]:
    """Terms of nose, transitions and steps between parts; a tube has none."""
    terms, before = [], 0.0
    for k, segment in enumerate(outline.segments):
        name = segment.part.name or f"{segment.part.part} {k + 1}"
        slope = 2 * math.pi * (segment.front**2 - before**2) / area
        terms.append(Term(f"step before {name}", slope, segment.start, f"{SLOPE}, eq. 10"))
        if segment.front != segment.aft:
            terms.append(_of_segment(segment, name, area))
        before = segment.aft
    return [term for term in terms if abs(term.slope) > NEGLIGIBLE]


def _of_segment(segment: Segment, name: str, area: float) -> Term:
    """Slope and centre of pressure from end areas and volume."""
    low, high = math.pi * segment.front**2, math.pi * segment.aft**2
    behind = (segment.part.length * high - segment.volume()) / (high - low)
    source = f"{SLOPE} at (l A_aft - V) / ΔA, eq. 10, 28"
    return Term(name, 2 * (high - low) / area, segment.start + behind, source)


def fin_term(placed: PlacedFins, area: float) -> Term:
    """A fin set with the body's interference."""
    count = round(placed.fins.count)
    slope = count / 2 * single_fin(placed, area) * CROWDING.get(count, 1.0) * interference(placed)
    source = "Barrowman 1967 eq. 3-6, interference 1966 eq. 77; quarter mean chord 1966 eq. 76a"
    name = placed.fins.name or "fins"
    return Term(name, slope, placed.start + placed.plan.quarter(), source)


def centre_of_pressure(outline: Outline) -> float:
    """Station of the centre of pressure at small angles of attack [m]: Σ C_Nα x / Σ C_Nα."""
    area = math.pi * outline.largest_radius**2
    terms = [*body_terms(outline, area), *(fin_term(placed, area) for placed in outline.fins)]
    return sum(t.slope * t.station for t in terms) / sum(t.slope for t in terms)


def single_fin(placed: PlacedFins, area: float) -> float:
    """C_Nα of one fin across the flow, without the body, incompressible [1/rad]: [B67] eq. 3-6."""
    plan = placed.plan
    ratio = plan.span**2 / (plan.area() * plan.mid_chord_cosine())
    return 2 * math.pi * plan.span**2 / area / (1 + math.sqrt(1 + ratio**2))


def interference(placed: PlacedFins) -> float:
    """Factor K_T(B) by which the body raises the fins' slope: [B66] eq. 77."""
    return 1 + placed.radius / (placed.plan.span + placed.radius)


def roll(placed: PlacedFins, area: float) -> tuple[float, float]:
    """Damping Σ∫ a c y² dy [m⁴] and forcing of a cant angle δ·Σ∫ a c y dy [m³] of a fin set.

    `a` is the lift slope of a fin over its own area; y counts from the vehicle's axis. The moment
    is ½ρ v (v · forcing - ω · damping): every strip at the angle δ - ω y / v. Source: [B67].
    """
    plan, count = placed.plan, round(placed.fins.count)
    own = single_fin(placed, area) * area / plan.area()
    damping = count * own * plan.moment(placed.radius, 2)
    forcing = count * own * plan.moment(placed.radius, 1) * placed.fins.cant
    return damping, forcing
