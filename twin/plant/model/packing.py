"""An MJCF model as one text and the bytes of its files, for a recording that carries it."""

import os
import xml.etree.ElementTree as ET
from collections.abc import Mapping
from pathlib import Path
from typing import Final

from analysis.files import FileError, content
from twin.errors import TwinError
from twin.physics import guard
from twin.plant.model.compose import flattened

MAIN: Final = "main.xml"
PACKAGE: Final = "package:"  # begins references to a shipped model
KEYS: Final = ("file", *(f"file{side}" for side in guard.SIDES))


def packed(path: Path) -> dict[str, bytes]:
    """A model and all files that it refers to, by names that its text (`main.xml`) uses.

    Raises
    ------
    TwinError : a file cannot be read or exceeds a limit
    """
    guard.examine([path])
    found: dict[str, bytes] = {}
    _pack(path, MAIN, found)
    return found


def _pack(path: Path, name: str, found: dict[str, bytes]) -> None:
    root = flattened(path)
    for compiler in root.iter("compiler"):
        for key in ("meshdir", "texturedir", "assetdir"):
            compiler.attrib.pop(key, None)
    for element in root.iter():
        for key in KEYS if element.tag in guard.ASSETS or element.tag == "model" else ():
            if key in element.attrib:
                element.set(key, _reference(element, Path(element.attrib[key]), found))
    found[name] = ET.tostring(root)


def _reference(element: ET.Element, file: Path, found: dict[str, bytes]) -> str:
    """What the text calls a file, which is packed too unless it is a shipped model."""
    if guard.is_shipped(file):
        return PACKAGE + os.path.relpath(file.resolve(), guard.SHIPPED)
    name = f"{len(found) + 1}-{file.name}"
    found[name] = b""  # takes the number
    if element.tag == "model":
        _pack(file, name, found)
    else:
        if "name" not in element.attrib and element.tag != "flexcomp":
            element.set("name", file.stem)
        try:
            found[name] = content(file, guard.LARGEST_ASSET)
        except FileError as error:
            raise TwinError(str(error)) from None
    return name


def unpack(files: Mapping[str, bytes], main: Path) -> None:
    """Write a packed model, its text as `main`, the others beside it.

    A text may refer to files of the pack and to shipped models, and to nothing else.

    Raises
    ------
    TwinError : a name or reference leads elsewhere
    """
    for name, data in files.items():
        if name in ("", ".", "..") or Path(name).name != name or "\0" in name:
            raise TwinError(f"a packed file is called {name[:60]!r}")
        bound = _bound(data, files) if name.endswith(".xml") else data
        (main if name == MAIN else main.with_name(name)).write_bytes(bound)


def _bound(data: bytes, files: Mapping[str, bytes]) -> bytes:
    """A text with the references to shipped models as they are on this machine."""
    root = guard.document(Path(MAIN), data)
    for element in root.iter():
        for key, value in list(element.attrib.items()):
            if not (key in KEYS or key in ("meshdir", "texturedir", "assetdir")):
                continue
            if element.tag == "model" and value.startswith(PACKAGE):
                path = (guard.SHIPPED / value.removeprefix(PACKAGE)).resolve()
                if not guard.is_shipped(path):
                    raise TwinError(f"a packed model refers to {value[:60]!r}")
                element.set(key, str(path))
            elif value not in files:
                raise TwinError(f"a packed model refers to {value[:60]!r}, which it does not hold")
    return ET.tostring(root)
