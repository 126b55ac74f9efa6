"""MJCF files of unknown origin: counted before MuJoCo sees them, then compiled in a process first.

MuJoCo follows references and expands counts without a limit: two files that name each other crash
it, a count of a thousand million never ends, and no signal is seen meanwhile.
"""

import hashlib
import json
import math
import os
import re
import xml.etree.ElementTree as ET
from collections.abc import Iterable, Mapping
from contextlib import suppress
from importlib.metadata import version
from importlib.resources import files
from pathlib import Path
from typing import Final

import numpy as np

from analysis import limited
from analysis.array import Array
from analysis.files import FileError, content
from twin.errors import TwinError
from twin.physics import safe_xml

SHIPPED: Final = Path(str(files("mjcf"))).resolve()
LARGEST_XML: Final = 4_000_000  # bytes; a hand-written model is three orders smaller
LARGEST_ASSET: Final = 20_000_000  # bytes, as of a mesh in `meshes.stl`
LARGEST_SUM: Final = 60_000_000  # bytes of all files
DEEPEST: Final = 8  # files that refer to the next
MOST_ELEMENTS: Final = 20_000  # after replication; the largest shipped scene has 400
# MuJoCo's mass matrix has the square of these; 3000 free bodies took 26 s to load, 200 take 2 s.
# The largest shipped scene has 20 bodies and 25 degrees of freedom.
MOST_FREEDOMS: Final = 1200
MOST_BODIES: Final = 2000
MOST_VALUES: Final = 4_000_000  # cells of height fields, texels, entries of arrays
MOST_PIXELS: Final = 20_000_000  # of all pictures; 4096 x 4096 are 17 million
SECONDS: Final = 4.0  # of a processor to compile; as much again follows in this process
MEGABYTES: Final = 700
TRIAL: Final = "2"  # of `twin.physics.trial`; another one tries every model again
ASSETS: Final = {
    "mesh": "meshdir", "hfield": "meshdir", "skin": "meshdir", "flexcomp": "meshdir",
    "texture": "texturedir",
}  # fmt: skip
COUNTED: Final = ("replicate", "flexcomp", "composite")  # elements that stand for `count` others
FREEDOMS: Final = {"freejoint": 6, "free": 6, "ball": 3, "flexcomp": 3, "composite": 3}
SIZED: Final = {"hfield": ("nrow", "ncol"), "texture": ("width", "height"), "numeric": ("size",)}
SIDES: Final = ("right", "left", "up", "down", "front", "back")

_NAN: Final = re.compile(r"(?i)(?<!\S)[-+]?nan(?!\S)")
_COMMENT: Final = re.compile(rb"<!--.*?-->", re.DOTALL)
Digests = Mapping[Path, str]
_approved: set[str] = set()  # in this process


def is_shipped(path: Path) -> bool:
    """Whether a file is one of the package's own."""
    return path.resolve().is_relative_to(SHIPPED)


def examine(paths: Iterable[Path]) -> Digests:
    """Count what files and all files they refer to expand to; shipped ones are not looked at.

    Returns the SHA-256 of every file that is not shipped.

    Raises
    ------
    TwinError : the file and the limit it exceeds, or the files that refer to each other
    """
    walk = _Walk()
    for path in paths:
        walk.elements(path, path.resolve().parent)
    return walk.digests


def approve(digests: Digests, name: Path, *, text: str | None = None) -> None:
    """Compile a model in a process with limits, once for each content.

    Parameters
    ----------
    digests : of `examine`; nothing happens where there are none
    name : of the file, for messages
    text : of the model; that of the file if omitted

    Raises
    ------
    TwinError : it crashes MuJoCo, takes too long, or takes too much memory
    """
    if not digests:
        return
    parts = [version("mujoco"), TRIAL, text or str(name), *(f"{p} {d}" for p, d in digests.items())]
    key = hashlib.sha256("\n".join(parts).encode(errors="replace")).hexdigest()
    mark = _folder() / key
    if key in _approved or mark.is_file():
        return
    request = json.dumps({"text": text, "path": str(name.resolve())}).encode()
    try:
        limited.run("twin.physics.trial", request, seconds=SECONDS, megabytes=MEGABYTES)
    except limited.LimitError as error:
        raise TwinError(f"{name}: {error}") from None
    _approved.add(key)
    with suppress(OSError):  # without a cache it is compiled again in the next process
        mark.parent.mkdir(parents=True, exist_ok=True)
        mark.touch()


def _folder() -> Path:
    cache = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")  # noqa: PTH111
    return Path(cache) / "tvc-twin" / "models"


class _Walk:
    """Goes through files and what they refer to, each once."""

    def __init__(self) -> None:
        self.digests: dict[Path, str] = {}
        self._sizes: dict[Path, Array] = {}
        self._open: list[Path] = []
        self._bytes = 0
        self._values = 0.0
        self._pixels = 0

    def elements(self, path: Path, main: Path) -> Array:
        """What a file holds (3,) with all that it includes and attaches, replicated.

        Elements, bodies and degrees of freedom.
        """
        path = Path(os.path.realpath(path))
        if is_shipped(path) or (self._open and not path.exists()):  # it may be replaced
            return np.zeros(3)
        if path in self._open:
            through = " and ".join(p.name for p in self._open[self._open.index(path) :])
            raise TwinError(f"{path}: refers to itself, through {through}")
        if path not in self._sizes:
            self._open.append(path)
            if len(self._open) > DEEPEST:
                raise TwinError(f"{path}: is referred to through more than {DEEPEST} files")
            root = document(path, self._content(path, LARGEST_XML))
            self._sizes[path] = self._expanded(root, self._models(root, path), path, main)
            self._assets(root, path)
            self._open.pop()
        whole = ("elements", "bodies", "degrees of freedom")
        most = (MOST_ELEMENTS, MOST_BODIES, MOST_FREEDOMS)
        for count, limit, what in zip(self._sizes[path], most, whole, strict=True):
            if not count <= limit:
                raise TwinError(f"{path}: expands to more than {limit} {what}")
        return self._sizes[path]

    def _content(self, path: Path, largest: int) -> bytes:
        try:
            data = content(path, largest)
        except FileError as error:
            raise TwinError(str(error)) from None
        self._bytes += len(data)
        if self._bytes > LARGEST_SUM:
            raise TwinError(f"{path}: with the files before it larger than {LARGEST_SUM} bytes")
        self.digests[path] = hashlib.sha256(data).hexdigest()
        return data

    def _models(self, root: ET.Element, path: Path) -> dict[str, Array]:
        """What the models hold that a file may attach, by name (3,)."""
        sizes = {}
        for model in root.iter("model"):
            if "file" in model.attrib:
                file = path.parent / model.attrib["file"]
                name = model.get("name") or file.stem
                sizes[name] = self.elements(file, file.resolve().parent)
        return sizes

    def _expanded(
        self, element: ET.Element, models: Mapping[str, Array], path: Path, main: Path
    ) -> Array:
        """What an element stands for (3,), itself included."""
        for key, value in element.attrib.items():
            if key != "name" and _NAN.search(value):  # MuJoCo only warns
                raise TwinError(f"{path}: <{element.tag} {key}> is NaN; numbers must be finite")
        inside = np.zeros(3)
        for child in element:
            inside += self._expanded(child, models, path, main)
        if element.tag == "include" and "file" in element.attrib:
            name = element.attrib["file"]
            beside = path.parent / name
            inside += self.elements(beside if beside.exists() else main / name, main)
        if element.tag == "attach":
            inside += models.get(element.get("model", ""), np.zeros(3))
        sizes = [element.get(key, "1") for key in SIZED.get(element.tag, ())]
        self._values += _product(" ".join(sizes)) if sizes else 0
        if self._values > MOST_VALUES:
            raise TwinError(
                f"{path}: its arrays, textures and height fields have more than {MOST_VALUES}"
                " values"
            )
        count = _product(element.get("count", "1")) if element.tag in COUNTED else 1
        if element.tag == "default":  # of joints that stand elsewhere
            return np.array([1.0 + inside[0], 0.0, 0.0])
        free = FREEDOMS.get(element.tag, 0)
        if element.tag == "joint" and not {"joint", "joint1"} & set(
            element.keys()
        ):  # no tendon, equality
            free = FREEDOMS.get(element.get("type", ""), 1)
        moving = element.tag in ("body", "flexcomp", "composite")
        own = np.array([1.0, float(moving), float(free)])
        with np.errstate(invalid="ignore", over="ignore"):  # infinite times none
            return np.nan_to_num(count * (own + inside), nan=0.0, posinf=math.inf)

    def _assets(self, root: ET.Element, path: Path) -> None:
        for tag, kind in ASSETS.items():
            folder = path.parent / directory(root, kind)
            for asset in root.iter(tag):
                for name in (asset.get(f"file{side}") for side in ("", *SIDES)):
                    # what is named otherwise MuJoCo finds, or not, within the limits
                    if name and (file := folder / name).exists() and not is_shipped(file):
                        self._pixels += _pixels(self._content(file, LARGEST_ASSET))
                        if self._pixels > MOST_PIXELS:
                            raise TwinError(f"{file}: has more than {MOST_PIXELS} pixels")


def _pixels(data: bytes) -> int:
    """Pixels that a PNG says it has, which a few bytes may stand for; 0 of other files."""
    # W3C, Portable Network Graphics, 11.2.2: signature, length, IHDR, width, height
    if data[:8] != b"\x89PNG\r\n\x1a\n" or len(data) < 24:
        return 0
    return int.from_bytes(data[16:20], "big") * int.from_bytes(data[20:24], "big")


def document(path: Path, data: bytes) -> ET.Element:
    """Root element of an MJCF file, with what MuJoCo accepts in comments and XML does not (`--`).

    Raises
    ------
    TwinError : not well-formed, or with a document type or entities
    """
    bare = _COMMENT.sub(lambda comment: b"\n" * comment[0].count(b"\n"), data)
    try:
        return safe_xml.parsed(bare, LARGEST_XML)
    except safe_xml.XmlError as error:
        raise TwinError(f"{path}: {error}") from None


def directory(root: ET.Element, kind: str) -> str:
    """Folder of a kind of asset by the file's compiler element; empty where it names none."""
    for name in (kind, "assetdir"):
        for compiler in root.iter("compiler"):
            if name in compiler.attrib:
                return compiler.attrib[name]
    return ""


def _product(text: str) -> float:
    """Product of numbers at least one; infinite where they are none, 1 for what MuJoCo refuses."""
    try:
        numbers = [abs(float(word)) for word in text.split()]
    except ValueError:
        return 1.0
    return math.prod(max(n, 1.0) if math.isfinite(n) else math.inf for n in numbers)
