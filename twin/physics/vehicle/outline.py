"""The outer surface: body segments one behind the other, fins on them, the motor behind them.

Stations x run from the tip of the nose towards the tail [m].
"""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from twin.physics.vehicle.design import Body, Design, FinSet
from twin.physics.vehicle.planform import PlanForm
from twin.physics.vehicle.profile import nodes, unit_radius

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Segment:
    """A part of the body, placed.

    Attributes
    ----------
    part : as the builder describes it
    start : station of its front [m]
    front, aft : radii [m]
    """

    part: Body
    start: float
    front: float
    aft: float
    _unit: Callable[[Array], Array] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        part, growth = self.part, abs(self.aft - self.front)
        shape = part.shape or ("ogive" if part.part == "nose" else "cone")
        slenderness = part.length / growth if growth > 0 else 1.0
        object.__setattr__(self, "_unit", unit_radius(shape, slenderness, part.parameter))

    @property
    def end(self) -> float:
        """Station of its aft end [m]."""
        return self.start + self.part.length

    @property
    def widening(self) -> bool:
        """Whether it grows towards the tail."""
        return self.aft >= self.front

    def radius(self, x: Array | float) -> Array:
        """Radii (…,) [m] at distances x behind its front [m]; 0 outside."""
        x = np.asarray(x, dtype=float)
        share = np.clip(x / self.part.length, 0.0, 1.0)
        if self.front == self.aft:
            inside = np.full_like(share, self.front)
        elif self.widening:
            inside = self.front + (self.aft - self.front) * self._unit(share)
        else:
            inside = self.aft + (self.front - self.aft) * self._unit(1.0 - share)
        return np.where((x >= 0) & (x <= self.part.length), inside, 0.0)

    def quadrature(self) -> tuple[Array, Array, Array]:
        """Distances behind the front (k,) [m], their weights [m] and the radii there [m]."""
        x, weight = nodes()
        if not self.widening:
            x, weight = 1.0 - x[::-1], weight[::-1]
        return x * self.part.length, weight * self.part.length, self.radius(x * self.part.length)

    def volume(self) -> float:
        """Volume inside the outer surface [m³]."""
        _, weight, r = self.quadrature()
        return float(np.pi * weight @ r**2)


@dataclass(frozen=True)
class PlacedFins:
    """A fin set, placed.

    Attributes
    ----------
    start : station of the root's leading edge [m]
    radius : of the body at the middle of the root [m]
    """

    fins: FinSet
    plan: PlanForm
    start: float
    radius: float


@dataclass(frozen=True)
class Outline:
    """The outer surface of a vehicle.

    Attributes
    ----------
    casing : radius of the motor [m]
    nozzle : station of the nozzle exit [m]; the motor is seen where it is behind the body
    """

    segments: tuple[Segment, ...]
    fins: tuple[PlacedFins, ...]
    casing: float = 0.0
    nozzle: float = 0.0

    @classmethod
    def of(cls, design: Design, casing: float = 0.0, nozzle: float = 0.0) -> "Outline":
        """Outline of a design with a motor of that radius and station of its nozzle [m]."""
        segments: list[Segment] = []
        start = radius = 0.0
        for part in design.body:
            aft = radius if part.diameter is None else part.diameter / 2
            front = aft if part.part == "tube" else radius
            segments.append(Segment(part, start, front, aft))
            start, radius = segments[-1].end, aft
        bare = cls(tuple(segments), ())
        placed = tuple(bare._placed(fins) for fins in design.fins)
        return cls(bare.segments, placed, casing, nozzle)

    def _placed(self, fins: FinSet) -> PlacedFins:
        plan = PlanForm.of(fins)
        start = self.tail - plan.root if fins.position is None else fins.position
        middle = start + plan.root / 2
        return PlacedFins(fins, plan, start, float(self.radius(np.array(middle))))

    @property
    def tail(self) -> float:
        """Station of the aft end of the body [m]."""
        return self.segments[-1].end

    @property
    def end(self) -> float:
        """Station of what is farthest aft [m]."""
        tips = [placed.start + placed.plan.x.max() for placed in self.fins]
        return float(max([self.tail, self.nozzle, *tips]))

    @property
    def largest_radius(self) -> float:
        """Largest radius of the body [m]."""
        return float(max(max(s.front, s.aft) for s in self.segments))

    def radius(self, x: Array) -> Array:
        """Radii (…,) of body and motor at stations x [m]."""
        at = np.asarray(x, dtype=float)
        of_body = [segment.radius(at - segment.start) for segment in self.segments]
        behind = np.where((at > self.tail) & (at <= self.nozzle), self.casing, 0.0)
        return np.asarray(np.max([behind, *of_body], axis=0))

    def width(self, x: Array) -> Array:
        """Width (…,) [m] of the shadow at stations x [m], averaged over the roll angle.

        Perimeter of the slice's convex hull over π (Cauchy); of fin sets at one station the wider.
        """
        radius = self.radius(x)
        width = 2.0 * radius
        for placed in self.fins:
            reach = placed.plan.reach(np.asarray(x) - placed.start)
            edge = np.where(reach > 0, placed.radius + reach, 0.0)
            wide = hull_width(radius, edge, placed.fins.thickness / 2, round(placed.fins.count))
            width = np.where(edge > radius, np.maximum(width, wide), width)
        return width

    def corners(self) -> Array:
        """Stations at which the width jumps or kinks, both ends included, ascending [m]."""
        stations = [0.0, self.tail, self.nozzle] + [s.end for s in self.segments]
        for placed in self.fins:
            stations += [placed.start + float(x) for x in placed.plan.corners]
        inside = [x for x in stations if 0 <= x <= self.end]
        return np.unique(np.round(inside, 9))


def hull_width(radius: Array, edge: Array, half: float, count: int) -> Array:
    """Mean width (…,) [m] of a circle with `count` plates that reach `edge` off its centre [m].

    Perimeter of the convex hull over π: the outer edges, twice `half` wide, then either tangents
    and arcs of the circle, or straight lines from plate to plate where these hide it.
    """
    corner, aside = np.hypot(edge, half), np.arctan2(half, np.maximum(edge, 1e-12))
    touch = np.arccos(np.clip(radius / np.maximum(corner, 1e-12), 0.0, 1.0))
    tangent = np.sqrt(np.maximum(corner**2 - radius**2, 0.0))
    arc = 2 * np.pi / count - 2 * (aside + touch)
    shown = 2 * half + 2 * tangent + radius * arc
    hidden = 2 * half + 2 * corner * np.sin(np.maximum(np.pi / count - aside, 0.0))
    return np.asarray(count * np.where(arc > 0, shown, hidden) / np.pi)
