"""Which designs cannot be built: parts that do not fit each other, masses in wrong units."""

import math
from typing import Final

from twin.physics.vehicle.carrier import Carrier
from twin.physics.vehicle.design import (
    HEAVIEST,
    LARGEST,
    THICKEST,
    Body,
    Design,
    FinSet,
    VehicleError,
)
from twin.physics.vehicle.lumps import Lump
from twin.physics.vehicle.outline import Outline, PlacedFins, Segment

SLACK = 1e-6  # m; stations in a file are rounded
THIN: Final = 1e-3  # m, wall of a part that gives none
FREE: Final = 5e-4  # m, between the swinging motor and the tube


def check_parts(design: Design) -> None:
    """Refuse parts that cannot be, before they are placed.

    Raises
    ------
    VehicleError : the part, its value and what would be right
    """
    if not design.body or design.body[0].part != "nose":
        raise VehicleError('body: must begin with a part = "nose"')
    for k, part in enumerate(design.body):
        _check_body(part, k)
    for k, fins in enumerate(design.fins):
        _check_plan(fins, f"fins[{k}]")
    if design.gimbal is not None and design.origin is not None:
        raise VehicleError("origin: the pivot of the gimbal is the origin; leave it out")
    if len(design.rail_buttons) not in (0, 2):
        raise VehicleError(f"rail_buttons: must be two stations, not {len(design.rail_buttons)}")


def _check_body(part: Body, k: int) -> None:
    where = f"body[{k}]"
    if part.part == "nose" and k > 0:
        raise VehicleError(f'{where}: only the first part is a nose; use part = "transition"')
    if part.part != "tube" and part.diameter is None:
        raise VehicleError(f"{where}: a {part.part} needs diameter, of its aft end")
    if part.part == "tube" and part.shape is not None:
        raise VehicleError(f'{where}: a tube has no shape; use part = "transition"')
    if part.solid and part.wall is not None:
        raise VehicleError(f"{where}: wall and solid exclude each other")
    if part.centre is not None and part.centre > part.length:
        raise VehicleError(
            f"{where}: centre = {part.centre:g} m lies behind the part, {part.length:g} m long"
        )
    if part.parameter is not None and part.shape not in ("power", "haack", "parabola"):
        raise VehicleError(f"{where}: parameter needs shape power, haack or parabola")


def _check_plan(fins: FinSet, where: str) -> None:
    if fins.count != round(fins.count):
        raise VehicleError(f"{where}: count = {fins.count:g} must be a whole number")
    if fins.shape == "points":
        _check_points(fins, where)
        return
    needed = {"root": fins.root, "span": fins.span}
    if fins.shape == "trapezoid":
        needed["tip"] = fins.tip
    if missing := [name for name, value in needed.items() if value is None]:
        raise VehicleError(f"{where}: a {fins.shape} needs {' and '.join(missing)}")
    if fins.points:
        raise VehicleError(f'{where}: points need shape = "points"')
    if fins.thickness > THICKEST * (fins.root or LARGEST):
        raise VehicleError(
            f"{where}: thickness = {fins.thickness:g} m of a root of {fins.root:g} m; must be at"
            f" most {THICKEST:g} of it"
        )


def _check_points(fins: FinSet, where: str) -> None:
    points = fins.points
    if len(points) < 3:
        raise VehicleError(f"{where}: points has {len(points)} corners; must have 3 or more")
    if points[0][1] != 0 or points[-1][1] != 0:
        raise VehicleError(f"{where}: the first and the last of points must lie on the body, at 0")
    if min(y for _, y in points[1:-1]) <= 0:
        raise VehicleError(f"{where}: the points between must lie off the body, above 0")
    if points[-1][0] <= points[0][0]:
        raise VehicleError(f"{where}: the last of points must lie behind the first")


def check_outline(design: Design, outline: Outline) -> None:
    """Refuse parts that do not fit onto or into each other.

    Raises
    ------
    VehicleError : the part, its value and what would be right
    """
    for k, segment in enumerate(outline.segments):
        _check_wall(segment, k)
    for k, placed in enumerate(outline.fins):
        _check_fins(placed, outline, k)
    for k, item in enumerate(design.masses):
        name = f"masses[{k}]" + (f" ({item.name})" if item.name else "")
        low, high = item.position - item.length / 2, item.position + item.length / 2
        if low < -SLACK or high > outline.end + SLACK:
            raise VehicleError(
                f"{name}: reaches from {low:.4g} to {high:.4g} m behind the tip; must lie within"
                f" the vehicle, 0 to {outline.end:.4g} m"
            )
        if item.diameter > 2 * outline.largest_radius + SLACK:
            raise VehicleError(
                f"{name}: diameter = {item.diameter:g} m; the body is"
                f" {2 * outline.largest_radius:g} m wide"
            )
    for k, chute in enumerate(design.parachutes):
        if chute.position is not None and chute.position > outline.end:
            raise VehicleError(
                f"parachutes[{k}]: position = {chute.position:g} m; must lie on the vehicle, 0 to"
                f" {outline.end:.4g} m"
            )
    for station in design.rail_buttons:
        if not 0 <= station <= outline.end:
            raise VehicleError(
                f"rail_buttons: {station:g} m; must lie on the vehicle, 0 to {outline.end:.4g} m"
            )
    if design.rail_buttons and len(set(design.rail_buttons)) == 1:
        raise VehicleError("rail_buttons: must be two different stations")


def _check_wall(segment: Segment, k: int) -> None:
    wall = segment.part.wall
    if wall is not None and wall > max(segment.front, segment.aft):
        raise VehicleError(
            f"body[{k}]: wall = {wall:g} m of a part of {max(segment.front, segment.aft):g} m"
            " radius; must be thinner"
        )


def _check_fins(placed: PlacedFins, outline: Outline, k: int) -> None:
    shoulder, tail = outline.segments[0].end, outline.tail
    low, high = placed.start, placed.start + placed.plan.root
    # swept fins stand out behind the tail of many designs; what carries them is the other half
    if low < shoulder - SLACK or (low + high) / 2 > tail + SLACK:
        name = f" {placed.fins.name!r}" if placed.fins.name else ""
        raise VehicleError(
            f"fins[{k}]{name}: the root reaches from {low:.4g} to {high:.4g} m behind the tip; must"
            f" lie on the body behind the nose, {shoulder:.4g} to {tail:.4g} m, at least its front"
            " half"
        )
    if placed.plan.y.max() > tail:
        raise VehicleError(
            f"fins[{k}]: span = {placed.plan.y.max():g} m; the body is {tail:.4g} m long. A number"
            f' without a unit is in m: write "{placed.plan.y.max():g} mm"?'
        )
    if placed.radius <= 0:
        raise VehicleError(f"fins[{k}]: the body has no width at {low:.4g} m")


def check_masses(outline: Outline, parts: tuple[Lump, ...], whole: Lump) -> None:
    """Refuse masses that no material has, the sign of grams given as kilograms.

    Raises
    ------
    VehicleError : the mass and the volume that it is said to fill
    """
    volume = sum(segment.volume() for segment in outline.segments)
    if whole.mass <= 0:
        raise VehicleError("the vehicle has no mass")
    for part in (*parts, whole):
        if part.mass > HEAVIEST * volume:
            raise VehicleError(
                f"{part.name or 'the vehicle'}: {part.mass:g} kg in a body of"
                f" {volume * 1e3:.4g} litres would be denser than steel; are the masses in grams?"
                ' Write "40 g" or 0.04'
            )


def check_motor(design: Design, outline: Outline, carrier: Carrier | None) -> None:
    """Refuse a motor that does not fit its place.

    Raises
    ------
    VehicleError : the motor's size and that of its place
    """
    motor = design.motor_data
    assert motor is not None
    if carrier is not None:
        bore = carrier.bore
    else:
        aft = 2 * max(outline.segments[-1].aft, outline.segments[-1].front)
        bore = aft if design.motor.diameter is None else design.motor.diameter
        if bore > aft + SLACK:
            raise VehicleError(f"motor.diameter = {bore:g} m; the body is {aft:g} m wide there")
    if motor.diameter > bore * (1 + SLACK):
        raise VehicleError(
            f"motor {motor.name!r} is {motor.diameter * 1e3:g} mm wide; its mount takes"
            f" {bore * 1e3:.4g} mm: give a --motor FILE.eng of at most that, or a wider"
            f" {'mechanism' if carrier is not None else 'mount'}"
        )
    front = outline.nozzle - motor.length
    if front < 0:
        raise VehicleError(
            f"motor {motor.name!r} is {motor.length:g} m long; the vehicle is"
            f" {outline.nozzle:.4g} m long"
        )


def check_gimbal(design: Design, outline: Outline, held: Carrier | None) -> None:
    """Refuse a gimbal that the body does not take, and settings that belong to a fixed motor.

    Raises
    ------
    VehicleError : the pivot or the body, and what would fit
    """
    if design.gimbal is None or held is None or design.motor_data is None:
        return
    pivot = design.gimbal.pivot
    if not 0 < pivot < outline.end:
        raise VehicleError(
            f"gimbal.pivot = {pivot:g} m; must lie on the vehicle, up to"
            f" {outline.end:.4g} m behind the tip"
        )
    if design.motor.overhang or design.motor.diameter is not None:
        raise VehicleError("motor.overhang and motor.diameter: the mechanism decides both")
    if pivot < held.reach:
        raise VehicleError(
            f"gimbal.pivot = {pivot:g} m; must be {held.reach:g} m or more behind the tip, so far"
            " forward reaches the mechanism"
        )
    narrowest = min(_inside(outline, x, 0.0) for x in _between(outline, pivot - held.reach, pivot))
    if narrowest < held.tube - SLACK:
        raise VehicleError(
            f"gimbal: the mechanism was built for a bore of {2e3 * held.tube:g} mm and reaches"
            f" {1e3 * held.reach:g} mm forward of the pivot; the body is {_room(narrowest)}"
            " there: give a wider body, or another mechanism"
        )
    _check_swing(pivot, outline, held, pivot - held.forward + design.motor_data.length)


def _check_swing(pivot: float, outline: Outline, held: Carrier, nozzle: float) -> None:
    """Refuse a motor that hits the tube within its stops.

    Tilted, it takes r / cos + z tan of the radius at z aft of the pivot.
    """
    end = min(outline.tail, nozzle)
    for x in _between(outline, pivot, end):
        room = _inside(outline, x, THIN) - FREE - held.bore / 2 / math.cos(held.swing)
        most = room / math.tan(held.swing) if held.swing > 0 else math.inf
        if most < 0:
            wide = 2e3 * (held.bore / 2 / math.cos(held.swing) + FREE)
            raise VehicleError(
                f"gimbal: the motor needs {wide:.0f} mm to tilt; the body is"
                f" {_room(_inside(outline, x, THIN))} at {x:.4g} m"
            )
        if x - pivot > most + SLACK:
            raise VehicleError(
                f"gimbal.pivot = {pivot:g} m: the body reaches {1e3 * (x - pivot):.0f} mm aft of"
                f" it, where the motor hits it before the stops of the gimbal; must be at most"
                f" {1e3 * most:.0f} mm: put the pivot at"
                f" {math.ceil(1e3 * (outline.tail - most) - 1e-3)} mm or farther aft"
            )


def _between(outline: Outline, low: float, high: float) -> list[float]:
    """Stations at which the body is narrowest or widest between two [m]."""
    return [low, *(s.end for s in outline.segments if low < s.end < high), high]


def _room(radius: float) -> str:
    return f"{2e3 * radius:.4g} mm wide inside" if radius > 0.0 else "solid"


def _inside(outline: Outline, x: float, wall: float) -> float:
    """Inner radius of the body at a station, with that wall where none is given [m]."""
    radii = [
        float(s.radius(min(max(x - s.start, 0.0), s.part.length))) - (s.part.wall or wall)
        for s in outline.segments
        if s.start - SLACK <= x <= s.end + SLACK
    ]
    return max(min(radii, default=0.0), 0.0)
