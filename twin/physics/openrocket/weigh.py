"""Masses of OpenRocket's parts from size and material, and what the designer put in their place."""

import math
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from twin.physics.openrocket.shapes import body, fin_set
from twin.physics.openrocket.tree import BODY, FINS, RINGS, Part
from twin.physics.vehicle.design import VehicleError
from twin.physics.vehicle.outline import Segment
from twin.physics.vehicle.planform import PlanForm

PANELS: Final = 2000  # frusta of a nose or transition: its volume within 1e-5
FILL: Final = {"square": 1.0, "rounded": 0.99, "airfoil": 0.85}  # of a fin's section, OpenRocket

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Piece:
    """Mass of a part, without the parts in it.

    Attributes
    ----------
    mass : [kg]
    station : of its centre [m]
    """

    part: Part
    mass: float
    station: float


def pieces(part: Part) -> list[Piece]:
    """Masses of a part and of all parts in it, with overrides applied."""
    found = [_own(part), *(piece for child in part.children for piece in pieces(child))]
    mass, centre = part.size("overridemass", -1.0), part.number("overridecg", math.nan)
    if mass >= 0:
        number = len(found) if _is_whole(part, "mass") else 1
        found = [*_scaled(found[:number], mass), *found[number:]]
    if not math.isnan(centre):
        number = len(found) if _is_whole(part, "cg") else 1
        found = [*_moved(found[:number], part.start + centre), *found[number:]]
    return found


def _is_whole(part: Part, kind: str) -> bool:
    """Whether an override includes the parts inside."""
    flags = ("overridesubcomponents", f"overridesubcomponents{kind}")
    return part.tag in ("rocket", "stage") or any(part.flag(flag) for flag in flags)


def _scaled(found: list[Piece], mass: float) -> list[Piece]:
    """All pieces in proportion, so that together they have that mass."""
    total = sum(piece.mass for piece in found)
    if total <= 0:
        return [replace(found[0], mass=mass), *found[1:]]
    return [replace(piece, mass=piece.mass * mass / total) for piece in found]


def _moved(found: list[Piece], station: float) -> list[Piece]:
    """All pieces shifted, so that their common centre has that station."""
    total = sum(piece.mass for piece in found)
    now = sum(piece.mass * piece.station for piece in found) / total if total > 0 else station
    return [replace(piece, station=piece.station + station - now) for piece in found]


def _own(part: Part) -> Piece:
    """Mass of a part by itself, from its size and material."""
    middle = part.start + part.length / 2
    if part.tag in BODY:
        volume, centre = _shell(part)
        return Piece(part, part.density() * volume, part.start + centre)
    if part.tag in FINS:
        return _fins(part)
    shift = (part.count - 1) * part.number("instanceseparation") / 2
    return Piece(part, part.count * _single(part), middle + shift)


def _single(part: Part) -> float:
    """One instance of a part inside or outside the body [kg]."""
    if part.tag in RINGS:
        area = math.pi * (part.outer**2 - part.inner**2)
        return part.density() * area * part.length
    if part.tag == "masscomponent":
        return part.size("mass")
    if part.tag == "shockcord":
        return part.density() * part.size("cordlength")
    if part.tag == "parachute":
        cloth = part.density() * math.pi / 4 * part.size("diameter") ** 2
        return cloth + part.size("linecount") * part.size("linelength") * part.density(
            "linematerial"
        )
    if part.tag == "streamer":
        return part.density() * part.size("striplength") * part.size("stripwidth")
    if part.tag == "launchlug":
        outer = part.size("radius")
        inner = max(outer - part.size("thickness"), 0.0)
        return part.density() * math.pi * (outer**2 - inner**2) * part.length
    if part.tag == "railbutton":
        return part.density() * _button(part) + part.size("screwmass") + part.size("nutmass")
    return 0.0


def _button(part: Part) -> float:
    """Volume of a rail button: two discs on a core [m³]."""
    outer, inner = part.size("outerdiameter"), part.size("innerdiameter")
    discs = part.size("baseheight") + part.size("flangeheight")
    core = max(part.size("height") - discs, 0.0)
    return math.pi / 4 * (outer**2 * discs + inner**2 * core)


def _shell(part: Part) -> tuple[float, float]:
    """Volume of a body part's wall, its shoulders included [m³], and its centre behind the front.

    The wall is measured across the surface, as OpenRocket does.
    """
    if part.length <= 0:
        raise VehicleError(f"{part.name}: length = 0; must be positive")
    x = np.linspace(0.0, part.length, PANELS + 1)
    r = Segment(body(part), part.start, part.front, part.outer).radius(x)
    dx, dr = np.diff(x), np.diff(r)
    solid = (part.element.findtext("thickness") or "").strip() == "filled"
    wall = part.outer + part.front if solid else part.size("thickness")
    across = wall * np.hypot(dx, dr) / dx
    inner0, inner1 = np.maximum(r[:-1] - across, 0.0), np.maximum(r[1:] - across, 0.0)
    volume = np.pi / 3 * dx * (_square(r[:-1], r[1:]) - _square(inner0, inner1))
    total, first = float(volume.sum()), float(volume @ (x[:-1] + dx / 2))
    for end, sign in (("fore", -1.0), ("aft", 1.0)):
        amount, middle = _shoulder(part, end)
        edge = 0.0 if end == "fore" else part.length
        total, first = total + amount, first + amount * (edge + sign * middle)
    return total, first / total if total > 0 else part.length / 2


def _square(a: Array, b: Array) -> Array:
    return np.asarray(a * a + a * b + b * b)


def _shoulder(part: Part, end: str) -> tuple[float, float]:
    """Volume of a shoulder [m³] and its centre off the part's end [m]."""
    radius, length = part.size(f"{end}shoulderradius"), part.size(f"{end}shoulderlength")
    wall = min(part.size(f"{end}shoulderthickness"), radius)
    tube = math.pi * (radius**2 - (radius - wall) ** 2) * length
    capped = part.flag(f"{end}shouldercapped")
    cap = math.pi * (radius - wall) ** 2 * min(wall, length) if capped else 0.0
    total = tube + cap
    off = tube * length / 2 + cap * (length - wall / 2)
    return total, off / total if total > 0 else 0.0


def _fins(part: Part) -> Piece:
    """A fin set with its tabs and fillets."""
    fins = fin_set(part)
    plan = PlanForm.of(fins)
    area = plan.area()
    own, first = area, area * plan.centroid()
    for tab, place in _tabs(part, plan.root):
        own, first = own + tab, first + tab * place
    mass = fins.thickness * own * FILL[fins.section] * part.density()
    centre = first / own
    fillet = 2 * plan.root * _fillet(part) * part.density("filletmaterial")
    total = mass + fillet
    station = (mass * centre + fillet * plan.root / 2) / total if total > 0 else plan.root / 2
    return Piece(part, part.count * total, part.start + station)


def _tabs(part: Part, root: float) -> list[tuple[float, float]]:
    """Area of the tab of one fin [m²] and its middle behind the root's leading edge [m]."""
    height, length = part.size("tabheight"), part.size("tablength")
    place = part.element.find("tabposition")
    if height * length == 0 or place is None:
        return []
    offset, method = part.number("tabposition"), place.get("relativeto", "front")
    ahead = {"front": 0.0, "top": 0.0, "center": (root - length) / 2, "middle": (root - length) / 2}
    return [(height * length, ahead.get(method, root - length) + offset + length / 2)]


def _fillet(part: Part) -> float:
    """Section of a fillet between the body and a fin's side [m²]: a circle that touches both."""
    r, body = part.size("filletradius"), part.outer
    if r <= 0 or body <= 0:
        return 0.0
    angle = math.asin(r / (r + body))  # at the body's axis
    triangle = r * math.sqrt((r + body) ** 2 - r * r) / 2
    return max(triangle - body**2 * angle / 2 - r * r * (math.pi / 2 - angle) / 2, 0.0)
