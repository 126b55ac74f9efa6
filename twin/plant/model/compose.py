"""Compose one MjSpec from a scene, a vehicle and a mechanism, each a shipped or a user's file."""

import xml.etree.ElementTree as ET
from collections.abc import Callable
from dataclasses import dataclass, replace
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING

import mujoco

from analysis.files import FileError, content
from twin.errors import TwinError
from twin.physics import guard

if TYPE_CHECKING:
    from twin.physics.vehicle import Design

MJCF = Path(str(files("mjcf")))
SCENES = ("flight", "bench", "turntable")
OPENROCKET = ".ork"
NOTE = "note_"  # texts of a model that are for the user
DIRECTORIES = ("meshdir", "texturedir", "assetdir")


def scene_path(name: str) -> Path:
    """Path of a shipped scene by name, or of a file.

    Raises
    ------
    TwinError : neither a shipped scene nor an MJCF file
    """
    if name in SCENES:
        return MJCF / f"{name}.xml"
    path = Path(name)
    if path.suffix == ".xml" and path.is_file():
        return path.resolve()
    raise TwinError(f"no scene {name!r}; give a file ending in .xml or one of {', '.join(SCENES)}")


def is_description(vehicle: Path | None) -> bool:
    """Whether a vehicle's MJCF is built from its file: a TOML description, or a design."""
    return vehicle is not None and vehicle.suffix.lower() in (".toml", OPENROCKET)


def design_of(vehicle: Path, motor: Path | None = None) -> tuple["Design", tuple[str, ...]]:
    """Design of a description or an OpenRocket file, and what it lacks of that, one line each.

    With its motor, or `motor` in its place.

    Raises
    ------
    TwinError : a file that cannot be used, or an OpenRocket design without a motor's file
    """
    from twin.physics import openrocket
    from twin.physics import vehicle as vehicles

    if vehicle.suffix.lower() != OPENROCKET:
        return vehicles.read(vehicle, motor), ()
    found = openrocket.described(vehicle)
    if motor is None:
        raise TwinError(
            f"{vehicle}: its motor ({found.motor or 'none'}) comes without a thrust curve; give its"
            " file with --motor FILE.eng to twin fly, or import the design (twin vehicle import)"
        )
    left_out = tuple(f"left out: {item}" for item in found.left_out)
    return vehicles.with_motor(found.design, motor), (*found.warnings, *left_out)


def described_files(vehicle: Path) -> dict[str, Path]:
    """Files that a vehicle's description names, by what they are; none of other files."""
    if vehicle.suffix.lower() != ".toml":
        return {}
    from twin.physics import vehicle as vehicles

    design = vehicles.described(vehicle)
    found = {}
    if (motor := vehicles.motor_path(design)) is not None:
        found["motor"] = motor
    if design.gimbal is not None and design.gimbal.mechanism:
        found["mechanism"] = vehicles.mechanism_file(design)
    if design.drag_table:
        found["drag_table"] = vehicle.parent / design.drag_table
    if design.launch.profile:
        found["profile"] = vehicle.parent / design.launch.profile
    return found


@dataclass(frozen=True)
class Composed:
    """An uncompiled model.

    Attributes
    ----------
    left_out : what a vehicle built from its file lacks of it, one line each
    traced : whether every file it is made of is shipped, or was read by `analysis.files.content`
    """

    spec: mujoco.MjSpec
    left_out: tuple[str, ...] = ()
    traced: bool = False


def compose(
    scene: str,
    vehicle: Path | None = None,
    mechanism: Path | None = None,
    motor: Path | None = None,
) -> Composed:
    """Uncompiled model of `scene`, with vehicle and mechanism replaced where files are given.

    A vehicle that is a description or an OpenRocket design is built here, with `motor` in place of
    its own.

    The scene names its vehicle in its `<include>`, the mechanism is the model asset `mechanism`;
    both references are rewritten in the text, since attaching happens while MuJoCo parses.

    Raises
    ------
    TwinError : a file is missing, is not MJCF, or has no place for the given part
    """
    path = scene_path(scene)
    if vehicle is None and mechanism is None and guard.is_shipped(path):
        spec = _parsed(path, lambda: mujoco.MjSpec.from_file(str(path)))
        return Composed(spec, traced=scene in SCENES)
    part, traced = None, mechanism is None
    left_out: tuple[str, ...] = ()
    if vehicle is not None and is_description(vehicle):
        design, left_out = design_of(vehicle, motor)
        traced = traced and (design.gimbal is None or not design.gimbal.mechanism)
        part = _built(design, mechanism)
    if mechanism is not None:
        from twin.physics.vehicle.carrier import check_is_model

        check_is_model(mechanism)
    given = (path, vehicle if part is None else None, mechanism)
    guard.examine(file for file in given if file is not None)
    if part is None:
        _refuse_scene("--vehicle", vehicle)
    _refuse_scene("--mechanism", mechanism)
    root = _tree(path, vehicle, part=part)
    if mechanism is not None:
        _place_mechanism(root, mechanism, vehicle or path)
    try:
        text = ET.tostring(root, encoding="unicode")
    except RecursionError:
        raise TwinError(f"{vehicle or mechanism} nests its elements too deeply") from None
    name = vehicle or mechanism or path
    named = [Path(model.get("file", "")) for model in root.iter("model")]
    foreign = guard.examine(f for f in (*given, *named) if f is not None)
    guard.approve(foreign, name, text=text)
    spec = _parsed(name, lambda: mujoco.MjSpec.from_string(text))
    return Composed(spec, left_out, traced and not foreign)


def _refuse_scene(flag: str, file: Path | None) -> None:
    """Refuse a file with a ground, which cannot stand in another scene."""
    if file is None:
        return
    if _root(file, included=False).find("worldbody/geom[@type='plane']") is not None:
        raise TwinError(f"{flag} {file}: is a scene, with a ground; give it as --scene {file}")


def _parsed(path: Path, parse: Callable[[], mujoco.MjSpec]) -> mujoco.MjSpec:
    try:
        return parse()
    except (ValueError, RecursionError) as error:
        raise TwinError(f"{path}: MuJoCo cannot read it: {one_line(error)}") from error


def one_line(error: Exception) -> str:
    """The text of an error with its line breaks folded."""
    return " ".join(str(error).split())


def flattened(path: Path) -> ET.Element:
    """Root element of an MJCF file, includes resolved and file references absolute.

    Raises
    ------
    TwinError : a file is missing or is not MJCF
    """
    return _tree(path)


def _tree(
    path: Path,
    vehicle: Path | None = None,
    main: Path | None = None,
    part: ET.Element | None = None,
) -> ET.Element:
    """Root element of an MJCF file, includes resolved and file references made absolute.

    A given `vehicle` replaces the file's `<include>` and its mechanism. An included file is looked
    for in the folder of the file that includes it, then in `main`, the folder of the outermost
    file, as MuJoCo does.
    `part` is the root element of a vehicle that is not read from its file.
    """
    root = _root(path, included=main is not None)
    if vehicle is not None:
        if root.find("include") is None:
            raise TwinError(f"{path}: has no <include> that {vehicle} could replace")
        for asset in root.findall("asset"):
            for model in asset.findall("model[@name='mechanism']"):
                asset.remove(model)
    own = path.resolve().parent
    main = main or own
    for parent in list(root.iter()):
        for include in parent.findall("include"):
            if vehicle is not None:
                content = _tree(vehicle) if part is None else part
                vehicle = None
            else:
                name = include.get("file", "")
                beside = own / name if (own / name).is_file() else main / name
                content = _tree(beside, main=main)
            at = list(parent).index(include)
            parent.remove(include)
            for offset, element in enumerate(content):
                parent.insert(at + offset, element)
    return root


def _built(design: "Design", mechanism: Path | None) -> ET.Element:
    """Root element of a vehicle that is described."""
    from twin.physics import vehicle as vehicles

    if mechanism is not None and design.gimbal is not None:
        held = replace(design.gimbal, mechanism=str(mechanism.resolve()))
        design = replace(design, gimbal=held)
    built = vehicles.Vehicle.of(design)
    root = ET.fromstring(vehicles.mjcf(built))  # noqa: S314  written here
    for k, note in enumerate(built.notes):
        ET.SubElement(ET.SubElement(root, "custom"), "text", name=f"{NOTE}{k}", data=note)
    return root


def _root(path: Path, *, included: bool) -> ET.Element:
    """Root element of one MJCF file, its own file references made absolute."""
    try:
        root = guard.document(path, content(path, guard.LARGEST_XML))
    except FileError as error:
        raise TwinError(f"{error}; give an MJCF file") from None
    if root.tag != "mujoco" and not included:  # an included file may have any root element
        raise TwinError(f"{path}: the root element is <{root.tag}>; must be <mujoco>")
    base = path.resolve().parent
    for compiler in root.iter("compiler"):
        for key in DIRECTORIES:
            if key in compiler.attrib:
                compiler.set(key, str(base / compiler.attrib[key]))
    for model in root.iter("model"):
        if "file" in model.attrib:
            model.set("file", str(base / model.attrib["file"]))
    for tag, kind in guard.ASSETS.items():
        folder = base / guard.directory(root, kind)
        for asset in root.iter(tag):
            if "file" in asset.attrib:
                asset.set("file", str(folder / asset.attrib["file"]))
    return root


def _place_mechanism(root: ET.Element, mechanism: Path, owner: Path) -> None:
    if not mechanism.is_file():
        raise TwinError(f"{mechanism}: not a file; give an MJCF file")
    places = root.findall("asset/model[@name='mechanism']")
    if not places:
        raise TwinError(f"{owner}: has no model asset 'mechanism' that {mechanism} could replace")
    for place in places:
        place.set("file", str(mechanism.resolve()))
