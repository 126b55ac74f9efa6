"""A vehicle's description from an OpenRocket design, and what of it was left out."""

import math
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Final
from xml.etree.ElementTree import Element

from twin.physics.openrocket.configuration import Configuration
from twin.physics.openrocket.container import document
from twin.physics.openrocket.shapes import body, fin_set
from twin.physics.openrocket.tree import BODY, FINS, OUTSIDE, RINGS, Part, tree
from twin.physics.openrocket.weigh import Piece, pieces
from twin.physics.vehicle.barrowman import centre_of_pressure
from twin.physics.vehicle.design import (
    FEWEST_FINS,
    MOST_FINS,
    Body,
    Chute,
    Design,
    FinSet,
    Launch,
    Mass,
    VehicleError,
)
from twin.physics.vehicle.lumps import Lump, lumps, total
from twin.physics.vehicle.outline import Outline
from twin.physics.vehicle.planform import PlanForm
from twin.physics.vehicle.read import parse, printable
from twin.physics.vehicle.write import toml

SAME: Final = 1e-5  # m, between two centres that count as one
GRAM: Final = 1e-6  # kg; lighter parts are left out
ROUGHNESS: Final = {  # m, of OpenRocket's surface finishes
    "rough": 500e-6, "roughunfinished": 250e-6, "unfinished": 150e-6, "normal": 60e-6,
    "smooth": 20e-6, "polished": 2e-6,
}  # fmt: skip
CHUTE_DRAG: Final = 0.8  # OpenRocket's for an automatic coefficient


@dataclass(frozen=True)
class Imported:
    """A design, and what it says less than its file.

    Attributes
    ----------
    motor : maker, designation and size of the motor that the file chooses; empty without one
    left_out : parts and settings that the description cannot have
    warnings : what of the design does not fit together, and what to do
    """

    design: Design
    motor: str
    left_out: tuple[str, ...]
    warnings: tuple[str, ...]

    @property
    def outline(self) -> Outline:
        """Outer surface, without the motor."""
        return Outline.of(self.design)

    @property
    def centre_of_pressure(self) -> float:
        """Station of the centre of pressure at small angles of attack, without the motor [m]."""
        return centre_of_pressure(self.outline)

    @property
    def airframe(self) -> Lump:
        """Mass, centre and inertia without the motor."""
        return total(lumps(self.design, self.outline))


def imported(root: Element) -> Imported:
    """Vehicle of an OpenRocket document.

    Raises
    ------
    VehicleError : the part that a vehicle cannot have, by its name
    """
    return _Import(root).result()


def described(path: Path) -> Imported:
    """Vehicle of an OpenRocket file, with the numbers that its written description would have.

    Raises
    ------
    VehicleError : a file that cannot be read, or the part that a vehicle cannot have
    """
    root = document(path)
    try:
        found = imported(root)
    except VehicleError as error:
        raise VehicleError(f"{path}: {error}") from None
    return replace(found, design=parse(toml(found.design), str(path), path))


class _Import:
    """Collects the description's tables and what was left out."""

    def __init__(self, root: Element) -> None:
        self._root = root
        self._rocket = tree(root)
        self._configuration = Configuration(self._rocket)
        self._parts = list(self._rocket.walk())
        self._bodies = [part for part in self._parts if part.tag in BODY]
        self._tail = self._bodies[-1].start + self._bodies[-1].length
        self._width = 2 * max(max(part.front, part.outer) for part in self._bodies)
        self._left: list[str] = []
        self._masses: list[Mass] = []
        self._shells: list[Body] = []
        self._fins: list[FinSet] = []

    def result(self) -> Imported:
        for piece in pieces(self._rocket):
            self._weigh(piece)
        mount, motor, wrong = self._configuration.motor(self._bodies[-1])
        buttons = self._buttons()
        for before, part in pairwise(self._bodies):
            if part.front < before.outer - SAME and part.front < part.outer - SAME:
                raise VehicleError(  # a cone behind the tail that stands for base drag
                    f"{part.name}: widens behind a part that is wider than its front, and its"
                    " centre of pressure has no meaning; leave it out of the design"
                )
        for part in self._parts:
            self._note(part)
        design = Design(
            name=printable(self._rocket.element.findtext("name") or "vehicle"),
            body=tuple(self._shells),
            fins=tuple(self._fins),
            masses=tuple(self._masses),
            parachutes=tuple(self._chutes()),
            motor=mount,
            launch=self._launch(),
            rail_buttons=buttons,
            drag=self._drag(),
            roughness=ROUGHNESS.get(self._bodies[0].word("finish", "normal"), ROUGHNESS["normal"]),
        )
        return Imported(design, motor, tuple(dict.fromkeys(self._left)), wrong)

    def _weigh(self, piece: Piece) -> None:
        """Give a part its mass, or make it a mass of its own where its centre is elsewhere."""
        part, name = piece.part, printable(piece.part.element.findtext("name") or "")
        if part.tag in BODY:
            centre = piece.station - part.start
            fits = 0 <= centre <= part.length
            shell = replace(body(part), name=name, mass=piece.mass if fits else 0.0)
            self._shells.append(replace(shell, centre=centre) if fits else shell)
            piece = replace(piece, mass=0.0) if fits else piece
        elif part.tag in FINS:
            fins = fin_set(part)
            if not FEWEST_FINS <= fins.count <= MOST_FINS:
                raise VehicleError(
                    f"{part.name}: {fins.count:g} fins; a set has {FEWEST_FINS} to {MOST_FINS}"
                )
            fits = abs(part.start + PlanForm.of(fins).centroid() - piece.station) < SAME
            self._fins.append(replace(fins, name=name, mass=piece.mass if fits else 0.0))
            piece = replace(piece, mass=0.0) if fits else piece
        if piece.mass >= GRAM:
            self._masses.append(self._mass(piece, name))

    def _mass(self, piece: Piece, name: str) -> Mass:
        """A cylinder on the axis, within the vehicle."""
        part, at = piece.part, piece.station
        if not 0 <= at <= self._tail:
            self._left.append(f"{part.name}: its centre, {at:.4g} m, is moved onto the vehicle")
            at = min(max(at, 0.0), self._tail)
        length = 0.0 if part.tag in (*FINS, *OUTSIDE) else part.length
        radius = part.outer if part.tag in RINGS else part.size("packedradius")
        return Mass(
            name=name,
            mass=piece.mass,
            position=at,
            length=max(min(length, 2 * at, 2 * (self._tail - at)), 0.0),
            diameter=min(2 * radius, self._width),
            hollow=part.tag in RINGS and part.inner > 0.5 * part.outer,
        )

    def _chutes(self) -> list[Chute]:
        found = []
        for part in self._parts:
            if part.tag not in ("parachute", "streamer"):
                continue
            width = part.size("diameter")
            if part.tag == "streamer":  # a circle of the strip's area
                width = math.sqrt(4 / math.pi * part.size("striplength") * part.size("stripwidth"))
            opens = self._configuration.deployment(part)
            event, delay = opens.word("deployevent", "ejection"), opens.size("deploydelay")
            if width <= 0 or event not in ("apogee", "altitude", "ejection"):
                self._left.append(f"{part.name}: opens at {event[:40]!r}, not in this description")
                continue
            if event != "ejection" and delay > 0:
                self._left.append(f"{part.name}: opens {delay:g} s later")
            found.append(
                Chute(
                    name=printable(part.element.findtext("name") or ""),
                    diameter=width,
                    drag=part.size("cd", CHUTE_DRAG),
                    position=min(max(part.start, 0.0), self._tail),
                    height=opens.size("deployaltitude") if event == "altitude" else None,
                    delay=self._configuration.delay() + delay if event == "ejection" else None,
                )
            )
        return found

    def _buttons(self) -> tuple[float, ...]:
        """Stations of the foremost and the last launch lug or rail button."""
        stations = []
        for part in self._parts:
            if part.tag in OUTSIDE:
                first = part.start + part.length / 2
                step = part.number("instanceseparation")
                stations += [first, first + (part.count - 1) * step]
        inside = [x for x in stations if 0 <= x <= self._tail]
        return (min(inside), max(inside)) if inside and max(inside) - min(inside) > SAME else ()

    def _launch(self) -> Launch:
        """Rail of the first stored simulation."""
        found = self._root.find("simulations/simulation/conditions")
        if found is None:
            return Launch()
        ramp = Part(found, "launch conditions")
        lean = math.radians(ramp.number("launchrodangle"))
        north = math.radians(ramp.number("launchroddirection"))
        if ramp.flag("launchintowind") and ramp.word("windmodeltype", "average") == "average":
            north = ramp.number("winddirection", north)
        if (wind := ramp.number("windaverage")) > 0:
            came = ramp.number("winddirection", math.pi / 2)  # from, from north over east
            to = math.remainder(-math.pi / 2 - came, math.tau)
            self._left.append(
                f"the wind of its simulations: --set wind_speed={wind:g} --set"
                f" wind_azimuth={to:.4g} adds it"
            )
        return Launch(
            elevation=min(max(math.pi / 2 - abs(lean), 0.0), math.pi / 2),
            azimuth=math.remainder(math.pi / 2 - north + (math.pi if lean < 0 else 0), math.tau),
            rail=ramp.size("launchrodlength", 2.0),
            altitude=min(max(ramp.number("launchaltitude"), -500.0), 2e4),
        )

    def _drag(self) -> float | None:
        """Drag coefficient that the designer gave for the whole vehicle."""
        for part in self._parts[:2]:
            if part.element.find("overridecd") is not None:
                return part.size("overridecd")
        return None

    def _note(self, part: Part) -> None:
        """Name settings of a part that have no effect here."""
        if part.element.find("overridecd") is not None and part.tag not in ("rocket", "stage"):
            self._left.append(f"{part.name}: its drag coefficient")
        if part.flag("shapeclipped") and part.front > 0 and part.word("shape") != "conical":
            self._left.append(f"{part.name}: the clip of its shape")
        shaped = part.word("shape") == "ogive" and part.tag in BODY
        if shaped and part.number("shapeparameter", 1.0) != 1.0:
            self._left.append(f"{part.name}: a secant ogive, taken as a tangent one")
        if part.number("radialposition") != 0 and part.size("mass", 1.0) > 0:
            self._left.append(f"{part.name}: its distance from the axis")
