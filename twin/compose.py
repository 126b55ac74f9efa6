"""One MjSpec out of a scene, a vehicle and a mechanism, each perhaps somebody else's file."""

import xml.etree.ElementTree as ET
from collections.abc import Callable
from importlib.resources import files
from pathlib import Path

import mujoco

from twin.errors import TwinError

MJCF = Path(str(files("mjcf")))
SCENES = ("flight", "bench", "turntable")
LARGEST_XML = 4_000_000  # bytes; a hand-written model is three orders smaller
DIRECTORIES = ("meshdir", "texturedir", "assetdir")


def scene_path(name: str) -> Path:
    """Path of a shipped scene by name, or of a file.

    Raises
    ------
    TwinError : neither a shipped scene nor a file
    """
    if name in SCENES:
        return MJCF / f"{name}.xml"
    path = Path(name)
    if path.suffix == ".xml" and path.is_file():
        return path.resolve()
    raise TwinError(f"no scene {name!r}; give a file ending in .xml or one of {', '.join(SCENES)}")


def compose(
    scene: str, vehicle: Path | None = None, mechanism: Path | None = None
) -> mujoco.MjSpec:
    """Uncompiled model of `scene`, vehicle and mechanism exchanged where files are given.

    The scene names its vehicle in an `<include>` and the mechanism in `<model name="mechanism">`;
    both references are rewritten in the text, since attaching happens while MuJoCo parses.

    Raises
    ------
    TwinError : a file is missing, is no MJCF, or has nowhere to put the given part
    """
    path = scene_path(scene)
    if vehicle is None and mechanism is None:
        return _parsed(path, lambda: mujoco.MjSpec.from_file(str(path)))
    root = _tree(path)
    includes: dict[str, bytes] = {}
    placed = _place_mechanism(root, mechanism)
    include = root.find("include")
    if include is not None:
        part = vehicle or path.parent / include.get("file", "")
        tree = _tree(part)
        placed |= _place_mechanism(tree, mechanism)
        include.set("file", "vehicle.xml")
        includes["vehicle.xml"] = ET.tostring(tree)
    elif vehicle is not None:
        raise TwinError(f"scene {scene!r} includes no vehicle that {vehicle} could replace")
    if mechanism is not None and not placed:
        owner = vehicle or scene
        raise TwinError(
            f'{owner} attaches no <model name="mechanism"> that {mechanism} could replace'
        )
    text = ET.tostring(root, encoding="unicode")
    return _parsed(
        vehicle or mechanism or path, lambda: mujoco.MjSpec.from_string(text, include=includes)
    )


def _parsed(path: Path, parse: Callable[[], mujoco.MjSpec]) -> mujoco.MjSpec:
    try:
        return parse()
    except ValueError as error:
        raise TwinError(f"{path} is no model MuJoCo can read: {one_line(error)}") from error


def one_line(error: Exception) -> str:
    """The text of an error with its line breaks folded."""
    return " ".join(str(error).split())


def _tree(path: Path) -> ET.Element:
    """Root element of an MJCF file, its file references made absolute."""
    if not path.is_file():
        raise TwinError(f"{path} is not a file; give an MJCF file")
    if path.stat().st_size > LARGEST_XML:
        raise TwinError(f"{path} is larger than {LARGEST_XML} bytes, which no MJCF file needs")
    try:
        root = ET.fromstring(path.read_bytes())  # noqa: S314  expat ≥ 2.4.1 bounds entity expansion
    except ET.ParseError as error:
        raise TwinError(f"{path} is not well-formed XML: {error}") from error
    if root.tag != "mujoco":
        raise TwinError(f"{path} has the root element <{root.tag}>; an MJCF file has <mujoco>")
    base = path.resolve().parent
    for compiler in root.iter("compiler"):
        for key in DIRECTORIES:
            if key in compiler.attrib:
                compiler.set(key, str(base / compiler.attrib[key]))
    for model in root.iter("model"):
        if "file" in model.attrib:
            model.set("file", str(base / model.attrib["file"]))
    return root


def _place_mechanism(root: ET.Element, mechanism: Path | None) -> bool:
    if mechanism is None:
        return False
    if not mechanism.is_file():
        raise TwinError(f"{mechanism} is not a file; give an MJCF file")
    places = [m for m in root.iter("model") if m.get("name") == "mechanism"]
    for place in places:
        place.set("file", str(mechanism.resolve()))
    return bool(places)
