"""The parts of an OpenRocket design with their places and radii."""

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Final
from xml.etree.ElementTree import Element

from twin.physics.vehicle.design import VehicleError

BODY: Final = ("nosecone", "bodytube", "transition")
FINS: Final = ("trapezoidfinset", "ellipticalfinset", "freeformfinset")
RINGS: Final = ("innertube", "tubecoupler", "engineblock", "centeringring", "bulkhead")
INSIDE: Final = ("masscomponent", "shockcord", "parachute", "streamer")
OUTSIDE: Final = ("launchlug", "railbutton")
KNOWN: Final = (*BODY, *FINS, *RINGS, *INSIDE, *OUTSIDE)
LARGEST: Final = 1e5  # of any number that is used, SI units
MOST: Final = 400  # parts
DEFAULT_RADIUS: Final = 0.025  # m, of bodies that are all automatic


@dataclass
class Part:
    """A part, placed.

    Attributes
    ----------
    start : station of its front [m]
    length : along the axis, 0 of stage and rocket [m]
    outer, inner : radii; of a nose or transition the aft ones [m]
    front : radius at the front [m]
    """

    element: Element
    name: str
    start: float = 0.0
    length: float = 0.0
    outer: float = 0.0
    inner: float = 0.0
    front: float = 0.0
    children: list["Part"] = field(default_factory=list)

    @property
    def tag(self) -> str:
        """Kind of the part."""
        return self.element.tag

    def number(self, tag: str, default: float = 0.0) -> float:
        """A number of the part; `default` where it has none or an automatic one.

        Raises
        ------
        VehicleError : the part and the number that is none
        """
        text = (self.element.findtext(tag) or "").strip()
        if not text or text.startswith(("auto", "filled")):
            return default
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if not abs(value) <= LARGEST:
            raise VehicleError(f"{self.name}: {tag} = {text[:40]!r} is not a number in range")
        return value

    def size(self, tag: str, default: float = 0.0) -> float:
        """A number that must not be negative, unless it is the default.

        Raises
        ------
        VehicleError : the part and the number
        """
        value = self.number(tag, default)
        if value < 0 and value != default:
            raise VehicleError(f"{self.name}: {tag} = {value:g}; must be 0 or more")
        return value

    def word(self, tag: str, default: str = "") -> str:
        """A text of the part."""
        return (self.element.findtext(tag) or default).strip().lower()

    def flag(self, tag: str) -> bool:
        """A flag of the part; off where it has none."""
        return self.word(tag) == "true"

    def density(self, tag: str = "material") -> float:
        """Of the material: per volume, area or length."""
        found = self.element.find(tag)
        try:
            value = float("0" if found is None else found.get("density", "0"))
        except ValueError:
            value = math.nan
        if not 0 <= value <= LARGEST:
            raise VehicleError(f"{self.name}: the density of its material is not a number in range")
        return value

    @property
    def count(self) -> int:
        """Instances of the part."""
        value = self.number("instancecount", self.number("fincount", 1.0))
        if not 1 <= value <= MOST or value != round(value):
            raise VehicleError(f"{self.name}: its count is {value:g}; must be 1 to {MOST}")
        return round(value)

    def walk(self) -> Iterator["Part"]:
        """The part and all parts in it."""
        yield self
        for child in self.children:
            yield from child.walk()


def tree(root: Element) -> Part:
    """The rocket with its one stage.

    Raises
    ------
    VehicleError : the part that a vehicle here cannot have
    """
    rocket = root.find("rocket")
    assert rocket is not None
    whole = Part(rocket, "rocket")
    stages = _inside(rocket)
    if len(stages) != 1 or stages[0].tag != "stage":
        extra = _named(stages[1]) if len(stages) > 1 else "none"
        raise VehicleError(f"it has {len(stages)} stages; a vehicle has one ({extra} is too many)")
    stage = Part(stages[0], _named(stages[0]))
    whole.children.append(stage)
    bodies = [Part(element, _named(element)) for element in _inside(stages[0])]
    for body in bodies:
        if body.tag not in BODY:
            raise VehicleError(f"{body.name}: a part of kind {body.tag} cannot be imported")
    if not bodies or bodies[0].tag != "nosecone" or bodies[0].flag("isflipped"):
        raise VehicleError("the first part must be a nose cone with its tip to the front")
    _radii(bodies)
    start = 0.0
    for body in bodies:
        body.start, body.length = start, body.size("length")
        start += body.length
        stage.children.append(body)
    for body in bodies:
        _fill(body)
    if sum(1 for _ in whole.walk()) > MOST:
        raise VehicleError(f"it has more than {MOST} parts")
    return whole


def _inside(element: Element) -> list[Element]:
    found = element.find("subcomponents")
    return [] if found is None else list(found)


def _named(element: Element) -> str:
    return f"{element.tag} {(element.findtext('name') or '').strip()[:60]!r}"


def _radii(bodies: list[Part]) -> None:
    """Outer radii; automatic ones are those of the nearest part before, else behind."""
    front, aft = {"transition": "foreradius"}, {"bodytube": "radius"}
    ahead = [body.size(front.get(body.tag, "radius"), -1.0) for body in bodies]
    behind = [body.size(aft.get(body.tag, "aftradius"), -1.0) for body in bodies]
    for k, body in enumerate(bodies):
        before = next((r for r in reversed(behind[:k]) if r >= 0), None)
        later = (r for j in range(k + 1, len(bodies)) for r in (ahead[j], behind[j]))
        after = next((r for r in later if r >= 0), None)
        near = before if before is not None else after
        tail = behind[k]
        if tail < 0:
            ordered = (after, before) if body.tag != "bodytube" else (before, after)
            tail = next((r for r in ordered if r is not None), DEFAULT_RADIUS)
        nose = ahead[k] if ahead[k] >= 0 else (tail if near is None else near)
        body.front = {"nosecone": 0.0, "bodytube": tail}.get(body.tag, nose)
        body.outer = tail
        body.inner = max(tail - body.size("thickness", tail), 0.0)


def _fill(parent: Part) -> None:
    """Place the parts inside a part."""
    for element in _inside(parent.element):
        part = Part(element, _named(element))
        if part.tag not in KNOWN or part.tag in BODY:
            raise VehicleError(f"{part.name}: a part of kind {part.tag} cannot be imported")
        if part.word("clusterconfiguration", "single") != "single":
            raise VehicleError(f"{part.name}: a cluster of tubes cannot be imported")
        part.length = _length(part)
        part.outer = part.size("outerradius", parent.inner)
        wall = part.size("thickness", part.outer)
        part.inner = max(part.outer - wall, 0.0)
        part.start = _start(part, parent)
        parent.children.append(part)
    for part in parent.children:
        if part.tag == "centeringring":
            part.inner = part.size("innerradius", _hole(part, parent))
        if part.tag == "bulkhead":
            part.inner = 0.0
        _fill(part)


def _length(part: Part) -> float:
    if part.tag == "freeformfinset":
        points = corners(part)
        return points[-1][0] - points[0][0]
    tag = {"trapezoidfinset": "rootchord", "ellipticalfinset": "rootchord"}.get(part.tag, "length")
    tag = {**dict.fromkeys(INSIDE, "packedlength"), "railbutton": "outerdiameter"}.get(
        part.tag, tag
    )
    return part.size(tag)


def corners(part: Part) -> tuple[tuple[float, float], ...]:
    """Corners of a free-form fin [m].

    Raises
    ------
    VehicleError : fewer than three, or not numbers
    """
    try:
        points = tuple(
            (float(p.get("x", "")), float(p.get("y", ""))) for p in part.element.iter("point")
        )
    except ValueError:
        points = ()
    if len(points) < 3 or not all(abs(v) <= LARGEST for point in points for v in point):
        raise VehicleError(f"{part.name}: needs three or more corners that are numbers in range")
    return points


def _start(part: Part, parent: Part) -> float:
    """Station of a part's front from its position relative to its parent."""
    place = part.element.find("axialoffset")
    if place is None:
        place = part.element.find("position")
    if place is None:
        return parent.start
    offset = part.number(place.tag)
    method = place.get("method") or place.get("type") or "top"
    free = parent.length - part.length
    ahead = {"top": 0.0, "middle": free / 2, "bottom": free, "after": parent.length}
    if method == "absolute":
        return offset
    if method not in ahead:
        raise VehicleError(f"{part.name}: position of kind {method[:40]!r} is not known")
    return parent.start + ahead[method] + offset


def _hole(ring: Part, parent: Part) -> float:
    """Radius of an automatic hole: of the inner tubes that pass through the ring."""
    tubes = [
        tube.outer
        for tube in parent.children
        if tube.tag == "innertube"
        and tube.start < ring.start + ring.length
        and ring.start < tube.start + tube.length
    ]
    return min(max(tubes, default=0.0), ring.outer)
