"""A vehicle as its builder describes it: parts, masses, motor, gimbal and launch; SI units.

Stations are distances from the tip of the nose towards the tail [m]. Every field that a file may
set is declared once here, with its kind; `read` takes names, kinds and limits from these classes.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Final, Literal, get_type_hints

from analysis.units import Kind
from twin.errors import TwinError
from twin.physics.motor import Motor
from twin.physics.vehicle.profile import SHAPES, Shape

Part = Literal["nose", "tube", "transition"]
Plan = Literal["trapezoid", "ellipse", "points"]
Section = Literal["square", "rounded", "airfoil"]
Burn = Literal["core", "end"]
PARTS: Final = ("nose", "tube", "transition")
PLANS: Final = ("trapezoid", "ellipse", "points")
SECTIONS: Final = ("square", "rounded", "airfoil")
FEWEST_FINS, MOST_FINS = 3, 8  # fewer have no axial symmetry; more have no published interference
LARGEST: Final = 100.0  # m
HEAVIEST: Final = 8000.0  # kg/m³, steel: denser parts have grams given as kilograms
THICKEST: Final = 0.5  # of a fin's root chord


class VehicleError(TwinError):
    """A vehicle description that cannot be built."""


@dataclass(frozen=True)
class Allowed:
    """Values a field may have.

    Attributes
    ----------
    kind : of quantity, for its unit
    low, high : smallest and largest value [SI]; `low` itself is allowed unless `above`
    above : whether `low` itself is too small
    words : valid texts, for a field that is a text
    """

    kind: Kind | Literal["word", "text", "flag", "points", "lengths", "path"]
    low: float = -math.inf
    high: float = math.inf
    above: bool = False
    words: tuple[str, ...] = ()


SIZE: Final = Allowed("length", 0.0, LARGEST, above=True)
DISTANCE: Final = Allowed("length", 0.0, LARGEST)
STATION: Final = Allowed("length", -LARGEST, LARGEST)
MASS: Final = Allowed("mass", 0.0, 1e5)
DENSITY: Final = Allowed("density", 1.0, 2.5e4)
NAME: Final = Allowed("text")


@dataclass(frozen=True, kw_only=True)
class Body:
    """A nose, a tube or a transition; parts follow each other from the tip to the tail.

    Attributes
    ----------
    part : `nose`, `tube` or `transition`
    length : [m]
    diameter : outer, at the aft end; that of the part before if omitted [m]
    shape : see `profile.SHAPES`; a nose is an ogive and a transition a cone if omitted
    parameter : of the shape: exponent of `power`, C of `haack`, K' of `parabola`
    mass : [kg]; else from `density` and `wall`
    wall : thickness [m]; the mass lies on the surface if omitted
    density : of the material [kg/m³]
    solid : whether the part is filled
    centre : of mass, behind the part's front [m]; from the shape if omitted
    """

    part: Annotated[Part, Allowed("word", words=PARTS)]
    length: Annotated[float, SIZE]
    diameter: Annotated[float | None, SIZE] = None
    shape: Annotated[Shape | None, Allowed("word", words=SHAPES)] = None
    parameter: Annotated[float | None, Allowed("number", 0.0, 1.0)] = None
    mass: Annotated[float | None, MASS] = None
    wall: Annotated[float | None, SIZE] = None
    density: Annotated[float | None, DENSITY] = None
    solid: Annotated[bool, Allowed("flag")] = False
    centre: Annotated[float | None, DISTANCE] = None
    name: Annotated[str, NAME] = ""


@dataclass(frozen=True, kw_only=True)
class FinSet:
    """A set of equal fins.

    Attributes
    ----------
    count : of fins, evenly spaced
    root, tip : chords [m]
    span : from the body to the tip, of one fin [m]
    sweep : leading edge of the tip behind that of the root [m]
    shape : plan form, `trapezoid`, `ellipse` or `points`
    points : plan form as corners (behind the root's leading edge, off the body) [m]
    thickness : [m]
    position : station of the root's leading edge; flush with the tail if omitted [m]
    cant : angle of the fins to the axis; positive turns the vehicle to the right, seen from behind
    section : shape of the edges
    mass : of the whole set [kg]; else from `density`
    density : of the material [kg/m³]
    """

    count: Annotated[float, Allowed("number", FEWEST_FINS, MOST_FINS)]
    thickness: Annotated[float, SIZE]
    span: Annotated[float | None, SIZE] = None
    root: Annotated[float | None, SIZE] = None
    tip: Annotated[float | None, DISTANCE] = None
    sweep: Annotated[float, STATION] = 0.0
    shape: Annotated[Plan, Allowed("word", words=PLANS)] = "trapezoid"
    points: Annotated[tuple[tuple[float, float], ...], Allowed("points")] = ()
    position: Annotated[float | None, DISTANCE] = None
    cant: Annotated[float, Allowed("angle", -math.pi / 6, math.pi / 6)] = 0.0
    section: Annotated[Section, Allowed("word", words=SECTIONS)] = "square"
    mass: Annotated[float | None, MASS] = None
    density: Annotated[float | None, DENSITY] = None
    name: Annotated[str, NAME] = ""


@dataclass(frozen=True, kw_only=True)
class Mass:
    """Something inside: a cylinder on the axis, or a point.

    Attributes
    ----------
    mass : [kg]
    position : station of its middle [m]
    length, diameter : of the cylinder; a point if omitted [m]
    hollow : whether the mass lies on the cylinder's surface
    """

    mass: Annotated[float, MASS]
    position: Annotated[float, DISTANCE]
    length: Annotated[float, DISTANCE] = 0.0
    diameter: Annotated[float, DISTANCE] = 0.0
    hollow: Annotated[bool, Allowed("flag")] = False
    name: Annotated[str, NAME] = ""


@dataclass(frozen=True, kw_only=True)
class Chute:
    """A parachute or streamer; its mass is one of `masses`.

    Attributes
    ----------
    diameter : of the canopy laid flat [m]
    drag : coefficient, referred to the area of that circle; 0.75 to 0.8 of a flat round canopy
        (Knacke, Parachute Recovery Systems Design Manual, 1991), 0.05 to 0.4 of a streamer
    delay : opens so long after burnout [s]
    height : opens on the way down below this height above the ground [m]; at the apogee if neither
        is given
    position : station that it pulls at; the aft end of the nose if omitted [m]
    """

    diameter: Annotated[float, SIZE]
    drag: Annotated[float, Allowed("number", 0.0, 10.0)] = 0.75
    delay: Annotated[float | None, Allowed("time", 0.0, 1e4)] = None
    height: Annotated[float | None, Allowed("length", 0.0, 1e5)] = None
    position: Annotated[float | None, DISTANCE] = None
    name: Annotated[str, NAME] = ""


@dataclass(frozen=True, kw_only=True)
class Mount:
    """Where the motor sits.

    Attributes
    ----------
    file : motor file, or FILE:NAME; relative to the vehicle's file
    overhang : how far the nozzle exit is behind the tail [m]; without a gimbal only
    diameter : widest motor that fits [m]; the motor's own if omitted
    burn : how the grain burns, `end` or `core`; from the burn time if omitted
    """

    file: Annotated[str, Allowed("path")] = ""
    overhang: Annotated[float, STATION] = 0.0
    diameter: Annotated[float | None, SIZE] = None
    burn: Annotated[Burn | None, Allowed("word", words=("core", "end"))] = None


@dataclass(frozen=True, kw_only=True)
class Gimbal:
    """A gimbal that carries the motor.

    Attributes
    ----------
    pivot : station at which both axes meet [m]
    mechanism : MJCF file, relative to the vehicle's file; the shipped mechanism if omitted
    """

    pivot: Annotated[float, DISTANCE]
    mechanism: Annotated[str, Allowed("path")] = ""


@dataclass(frozen=True, kw_only=True)
class Launch:
    """The ramp.

    Attributes
    ----------
    elevation : above the horizon [rad]
    azimuth : from east to north [rad]
    rail : travel of a rail button on the rail [m]; 0 launches without a rail
    height : of the rail's foot above ground, where the lower button rests [m]
    altitude : of the ground above mean sea level [m]
    profile : CSV file of wind and temperature over height (`sounding`), relative to the vehicle's
        file; wind by `wind_speed` in the standard atmosphere if omitted
    stiffness : of the rail at each button [N/m]; 0: rigid
    damping : of an elastic rail at each button [N s/m]
    """

    elevation: Annotated[float, Allowed("angle", 0.0, math.pi / 2)] = math.radians(85.0)
    azimuth: Annotated[float, Allowed("angle", -math.pi, math.pi)] = 0.0
    rail: Annotated[float, DISTANCE] = 2.0
    height: Annotated[float | None, DISTANCE] = None
    altitude: Annotated[float, Allowed("length", -500.0, 2e4)] = 0.0
    profile: Annotated[str, Allowed("path")] = ""
    stiffness: Annotated[float, Allowed("number", 0.0, 1e9)] = 0.0
    damping: Annotated[float, Allowed("number", 0.0, 1e7)] = 0.0


@dataclass(frozen=True, kw_only=True)
class Design:
    """A whole vehicle.

    Attributes
    ----------
    body : parts from the tip to the tail
    rail_buttons : stations of the two buttons [m]; on the aft half of the body if omitted
    drag : axial drag coefficient, referred to the largest cross-section; from the shape if omitted
    drag_table : CSV file of it over the Mach number (`drag_table`), relative to the vehicle's file
    crossflow_drag : of the body across its axis; from the slenderness if omitted
    roughness : of the surface, for the drag [m]
    origin : station of the vehicle's frame [m]; with a gimbal it is the pivot
    motor_data : the motor that the mount's file names
    source : file it was read from; None for one made in code
    """

    body: tuple[Body, ...]
    fins: tuple[FinSet, ...] = ()
    masses: tuple[Mass, ...] = ()
    parachutes: tuple[Chute, ...] = ()
    motor: Mount = field(default_factory=Mount)
    gimbal: Gimbal | None = None
    launch: Launch = field(default_factory=Launch)
    name: Annotated[str, NAME] = "vehicle"
    rail_buttons: Annotated[tuple[float, ...], Allowed("lengths")] = ()
    drag: Annotated[float | None, Allowed("number", 0.0, 10.0)] = None
    drag_table: Annotated[str, Allowed("path")] = ""
    crossflow_drag: Annotated[float | None, Allowed("number", 0.0, 3.0)] = None
    roughness: Annotated[float, DISTANCE] = 60e-6
    origin: Annotated[float | None, STATION] = None
    motor_data: Motor | None = None
    source: Path | None = None

    def beside(self, name: str) -> Path:
        """Path of a file that the description names, relative to its own file."""
        return (self.source.parent if self.source is not None else Path()) / name


def allowed(kind: type) -> Mapping[str, Allowed]:
    """What a file may set of a class, by field name."""
    if kind not in _ALLOWED:
        marked = get_type_hints(kind, include_extras=True)
        found = {name: getattr(hint, "__metadata__", (None,))[0] for name, hint in marked.items()}
        _ALLOWED[kind] = {k: v for k, v in found.items() if isinstance(v, Allowed)}
    return _ALLOWED[kind]


_ALLOWED: dict[type, Mapping[str, Allowed]] = {}
