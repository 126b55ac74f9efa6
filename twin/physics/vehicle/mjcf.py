"""A vehicle as MJCF text: coefficients with their sources, shapes to look at, masses."""

import math
import os
from collections.abc import Iterable
from pathlib import Path
from typing import Final
from xml.sax.saxutils import quoteattr

import numpy as np
from numpy.typing import NDArray

from twin.physics.motor.grain import Grain
from twin.physics.vehicle.built import Vehicle
from twin.physics.vehicle.carrier import mechanism_file
from twin.physics.vehicle.coefficients import INDEX, Coefficient, coefficients, foot_height
from twin.physics.vehicle.lumps import Lump
from twin.physics.vehicle.outline import PlacedFins, Segment

Array = NDArray[np.float64]
AROUND: Final = 24  # vertices of a nose around its axis
ALONG: Final = 10  # rings of them
CORNERS: Final = 24  # of a fin with a curved edge
PER_LINE: Final = 8  # numbers
SUNK: Final = 1e-3  # m; roots of the fins inside the tube, so that no gap shows
POINT: Final = 5e-3  # m; radius of the sphere that stands for a point mass


def mjcf(vehicle: Vehicle, folder: Path | None = None) -> str:
    """MJCF text of a vehicle.

    Parameters
    ----------
    folder : where the text will stand, so that the mechanism's file is named relative to it;
        named absolutely if omitted
    """
    lines = [
        *_head(vehicle),
        "",
        "  <custom>",
        f'    <numeric name="native_index" size="{INDEX}"/>',
        *(line for entry in coefficients(vehicle) for line in _numeric(entry)),
        "  </custom>",
        "",
        "  <asset>",
        *_assets(vehicle, folder),
        "  </asset>",
        "",
        *_DEFAULTS,
        "",
        "  <worldbody>",
        *_body(vehicle),
        "  </worldbody>",
        "</mujoco>",
    ]
    return "\n".join(lines) + "\n"


def _head(vehicle: Vehicle) -> list[str]:
    design, tip = vehicle.design, f"{vehicle.origin:.6g}"
    source = design.source.name if design.source is not None else "a design made in code"
    return [
        f"<mujoco model={quoteattr(design.name)}>",
        f"  <!-- Built from {_comment(source)}; docs/vehicles.md and docs/aerodynamics.md describe",
        f"       names and numerics. Frame of `vehicle`: z to the nose, origin {tip} m behind the",
        "       tip. Lengths in metres, masses in kilograms, angles in radians. -->",
        '  <compiler angle="radian" autolimits="true"/>',
        "",
        '  <option timestep="0.001" integrator="implicitfast" gravity="0 0 -9.80665"/>',
    ]


_DEFAULTS: Final = (
    "  <default>",
    '    <default class="airframe">',
    '      <geom contype="0" conaffinity="0" group="1" mass="0" rgba="0.93 0.93 0.9 1"/>',
    '      <default class="accent">',
    '        <geom type="mesh" rgba="0.85 0.2 0.12 1"/>',
    "      </default>",
    '      <default class="inside">',
    '        <geom type="cylinder" group="3" rgba="0.3 0.5 0.4 1"/>',
    "      </default>",
    "    </default>",
    "  </default>",
)


def _comment(text: str) -> str:
    return text.replace("--", "- -").replace("<", "").replace(">", "")


def _number(value: float) -> str:
    return f"{value:.9g}"


def _row(values: Iterable[float]) -> str:
    return " ".join(_number(value) for value in values)


def _numeric(entry: Coefficient) -> list[str]:
    unit = f"{entry.unit}: " if entry.unit not in ("", "-") else ""
    comment = f"    <!-- {unit}{_comment(entry.source)} -->" if entry.source else ""
    head = f'    <numeric name="{entry.name}"'
    if len(entry.values) > PER_LINE and not any(entry.values):
        return [*filter(None, [comment]), f'{head} size="{len(entry.values)}"/>']
    if len(entry.values) <= PER_LINE:
        return [*filter(None, [comment]), f'{head} data="{_row(entry.values)}"/>']
    rows = [entry.values[k : k + PER_LINE] for k in range(0, len(entry.values), PER_LINE)]
    body = [f"        {_row(row)}" for row in rows]
    return [*filter(None, [comment]), f'{head} data="', *body[:-1], f'{body[-1]}"/>']


def _assets(vehicle: Vehicle, folder: Path | None) -> list[str]:
    lines = []
    if vehicle.carrier is not None:
        file = mechanism_file(vehicle.design)
        name = str(file) if folder is None else os.path.relpath(file, folder)
        lines.append(f'    <model name="mechanism" file={quoteattr(name)}/>')
    for k, segment in enumerate(vehicle.outline.segments):
        if segment.front != segment.aft:
            lines += _mesh(f"body_{k}", _revolved(segment, vehicle.origin))
    for k, placed in enumerate(vehicle.outline.fins):
        lines += _mesh(f"fin_{k}", _plate(placed, vehicle.origin))
    return lines


def _mesh(name: str, vertices: Array) -> list[str]:
    points = [_row(np.round(vertex, 7) + 0.0) for vertex in vertices]
    rows = ["        " + "   ".join(points[k : k + 2]) for k in range(0, len(points), 2)]
    return [f'    <mesh name="{name}" vertex="', *rows[:-1], f'{rows[-1]}"/>']


def _revolved(segment: Segment, origin: float) -> Array:
    """Vertices of a nose or transition, dense where it is blunt; MuJoCo closes their hull."""
    t = np.linspace(0.0, 1.0, ALONG)
    share = t * t if segment.widening else 1.0 - t[::-1] ** 2
    x = share * segment.part.length
    angle = 2 * np.pi * np.arange(AROUND) / AROUND
    circle = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(AROUND)])
    rings = segment.radius(x)[:, None, None] * circle
    rings[:, :, 2] = (origin - segment.start - x)[:, None]
    return np.unique(rings.reshape(-1, 3).round(9), axis=0)


def _plate(placed: PlacedFins, origin: float) -> Array:
    plan = placed.plan
    keep = np.unique(np.linspace(0, plan.x.size - 1, min(plan.x.size, CORNERS)).round().astype(int))
    x, y = plan.x[keep], plan.y[keep]
    off = placed.radius + np.where(y > 0, y, -min(SUNK, placed.radius / 2))
    along = origin - placed.start - x
    half = placed.fins.thickness / 2
    sides = [np.column_stack([off, np.full_like(off, w), along]) for w in (-half, half)]
    return np.concatenate(sides)


def _body(vehicle: Vehicle) -> list[str]:
    length, centre = vehicle.outline.end, vehicle.origin - vehicle.airframe.station
    away = (0.0, -3 * length, length)
    inner = [
        '<freejoint name="vehicle"/>',
        f'<camera name="chase" mode="trackcom" pos="{_row(away)}" xyaxes="1 0 0 0 0.25 0.97"/>',
        *_inertial(vehicle),
        *_shapes(vehicle),
        f'<site name="vehicle_imu" pos="0 0 {_number(centre)}"/>',
        *_motor(vehicle),
    ]
    position, quaternion = (_row(values) for values in _pose(vehicle))
    place = f'pos="{position}" quat="{quaternion}"'
    return [
        f'    <body name="vehicle" {place} childclass="airframe">',
        *(f"      {line}" for line in inner),
        "    </body>",
    ]


def _inertial(vehicle: Vehicle) -> list[str]:
    air = vehicle.airframe
    rows = [f"<!-- airframe without motor: {air.mass:.6g} kg, of"]
    rows += [f"     {_lump(part, vehicle.origin)}" for part in vehicle.parts]
    rows[-1] += " -->"
    inertia = _row((air.transverse, air.transverse, air.axial))
    z = _number(vehicle.origin - air.station)
    return [*rows, f'<inertial pos="0 0 {z}" mass="{_number(air.mass)}" diaginertia="{inertia}"/>']


def _lump(part: Lump, origin: float) -> str:
    source = f" ({part.source})" if part.source != "given" else ""
    return _comment(f"{part.name}: {part.mass:.6g} kg at z = {origin - part.station:.5g}{source}")


def _shapes(vehicle: Vehicle) -> list[str]:
    origin, outline = vehicle.origin, vehicle.outline
    lines = []
    for k, segment in enumerate(outline.segments):
        if segment.front != segment.aft:
            kind = ' class="accent"' if segment.part.part == "nose" else ' type="mesh"'
            lines.append(f'<geom name="body_{k}"{kind} mesh="body_{k}"/>')
        else:
            place = _cylinder(segment.front, segment.part.length, origin - segment.start)
            lines.append(f'<geom name="body_{k}" type="cylinder" {place}/>')
    for k, placed in enumerate(outline.fins):
        count = round(placed.fins.count)
        for j in range(count):
            turn = f' euler="0 0 {_number(2 * math.pi * j / count)}"' if j else ""
            lines.append(f'<geom name="fin_{k}_{j}" class="accent" mesh="fin_{k}"{turn}/>')
    for k, item in enumerate(vehicle.design.masses):
        front = origin - item.position + item.length / 2
        if item.length > 0 and item.diameter > 0:
            shape = _cylinder(item.diameter / 2, item.length, front)
        else:
            shape = f'type="sphere" size="{POINT}" pos="0 0 {_number(front - item.length / 2)}"'
        lines.append(f'<geom name="inside_{k}" class="inside" {shape}/>')
    return [*lines, _hull(vehicle)]


def _cylinder(radius: float, length: float, front: float) -> str:
    size = f"{_number(radius)} {_number(length / 2)}"
    return f'size="{size}" pos="0 0 {_number(front - length / 2)}"'


def _hull(vehicle: Vehicle) -> str:
    """The one shape that meets the ground."""
    outline = vehicle.outline
    radius = outline.largest_radius
    top, low = 2 * radius, outline.tail - radius
    half = max((low - top) / 2, radius / 10)
    middle = vehicle.origin - (low + top) / 2
    return (
        f'<geom name="hull" type="capsule" size="{_number(radius)} {_number(half)}"'
        f' pos="0 0 {_number(middle)}" group="4" contype="1" conaffinity="1" rgba="0 0 0 0"/>'
    )


def _motor(vehicle: Vehicle) -> list[str]:
    if vehicle.carrier is not None:
        attach = '<attach model="mechanism" body="mount" prefix="gimbal_"/>'
        return ['<frame name="gimbal">', f"  {attach}", "</frame>"]
    motor, grain = vehicle.motor, Grain.of(vehicle.motor, vehicle.design.motor.burn)
    nozzle = vehicle.origin - vehicle.outline.nozzle
    middle = _number(nozzle + motor.length / 2)
    empty = motor.loaded_mass - motor.propellant_mass
    look = 'shellinertia="true" rgba="0.2 0.2 0.22 1"'
    casing = f'size="{_row((motor.diameter / 2, motor.length / 2))}" mass="{_number(empty)}"'
    inside = f'size="{_row((grain.radius, grain.length / 2))}" mass="{_number(grain.mass)}"'
    return [
        '<site name="gimbal_pivot"/>',
        f'<site name="gimbal_nozzle" pos="0 0 {_number(nozzle)}"/>',
        f'<body name="gimbal_motor" pos="0 0 {middle}">',
        f'  <geom name="casing" type="cylinder" {casing} {look}/>',
        "</body>",
        f'<body name="gimbal_propellant" pos="0 0 {middle}">',
        f'  <geom name="grain" type="cylinder" {inside} group="3"/>',
        "</body>",
    ]


def _pose(vehicle: Vehicle) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Position and quaternion on the ramp, as `native.bind` computes them."""
    launch = vehicle.design.launch
    lug = vehicle.origin - vehicle.buttons[0]
    level, rise = math.cos(launch.elevation), math.sin(launch.elevation)
    rail = (level * math.cos(launch.azimuth), level * math.sin(launch.azimuth), rise)
    foot = (0.0, 0.0, foot_height(vehicle))
    tilt, turn = (math.pi / 2 - launch.elevation) / 2, launch.azimuth / 2
    quaternion = (
        math.cos(turn) * math.cos(tilt),
        -math.sin(turn) * math.sin(tilt),
        math.cos(turn) * math.sin(tilt),
        math.sin(turn) * math.cos(tilt),
    )
    return tuple(f - lug * r for f, r in zip(foot, rail, strict=True)), quaternion
