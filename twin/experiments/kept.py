"""The files of a run inside its recording, and a run from nothing but its recording."""

import base64
import hashlib
import zlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, fields, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, TypeVar

from analysis.files import FileError, content
from analysis.recording import Recording
from twin.config import Run
from twin.errors import TwinError
from twin.physics.motor import split_name
from twin.plant.model.compose import OPENROCKET, SCENES, described_files, is_description
from twin.plant.model.packing import MAIN, packed, unpack

R = TypeVar("R", bound=Run)
LARGEST_KEPT = 200_000  # bytes of a text
LARGEST_PACK = 4_000_000  # bytes of a model with its meshes, or of an OpenRocket design
LARGEST_READ = 100_000_000  # bytes of a file of which only the digest is kept
RESULTS = ("out", "json", "force")
EXECUTED = "controller"  # never restored, since it would be executed
NESTED = Path("1/2/3/4")  # a description may name files some folders above it
OF_VEHICLE = "vehicle_"  # begins the names of files that a vehicle's description names


@dataclass(frozen=True)
class Origin:
    """What a repeated run records in place of the temporary files that it is given.

    Attributes
    ----------
    files : as the recording has them
    names : settings that name files, as the recording has them
    """

    files: Mapping[str, object]
    names: Mapping[str, object]


def files_of(config: Run) -> dict[str, object]:
    """Digest of each file that decides what a run does, by its setting, and its content.

    Short files are kept as they are, models with everything they refer to.
    """
    named = _named(config)
    if (own := getattr(config, "controller_file", None)) is not None:
        named[EXECUTED] = own
    return {name: _kept(path) for name, path in named.items()}


def _named(config: Run) -> dict[str, Path]:
    """Files by the setting that names them."""
    values = {f.name: getattr(config, f.name) for f in fields(config) if f.name not in RESULTS}
    named = {name: value for name, value in values.items() if isinstance(value, Path)}
    if config.scene not in SCENES:
        named["scene"] = Path(config.scene)
    if "motor" in named:
        named["motor"] = split_name(named["motor"])[0]
    if "vehicle" in named:
        own = described_files(named["vehicle"])
        named |= {OF_VEHICLE + name: path for name, path in own.items()}
    return named


def _kept(path: Path) -> dict[str, Any]:
    try:
        data = content(path, LARGEST_READ)
    except FileError:
        return {}
    kept: dict[str, Any] = {"sha256": hashlib.sha256(data).hexdigest(), "name": path.name}
    if len(data) <= (LARGEST_PACK if path.suffix.lower() == OPENROCKET else LARGEST_KEPT):
        try:
            kept["text"] = data.decode()
        except UnicodeDecodeError:
            kept["packed"] = {MAIN: _shrunk(data)}
    if path.suffix.lower() == ".xml":
        try:
            pack = packed(path)
        except TwinError:  # the run itself says what is wrong
            return kept
        kept.pop("packed", None)
        if sum(map(len, pack.values())) <= LARGEST_PACK:
            kept["packed"] = {name: _shrunk(data) for name, data in pack.items()}
    return kept


def _shrunk(data: bytes) -> str:
    return base64.b64encode(zlib.compress(data, 9)).decode()


def origin(recording: Recording, config: Run) -> Origin:
    """What a repetition of a recorded run records about its files."""
    return Origin(_files(recording), _settings(config))


def repeated(properties: Mapping[str, Any], origin: Origin) -> dict[str, Any]:
    """Properties of a run with its files as those that it repeats has them."""
    own = {k: v for k, v in properties["files"].items() if k == EXECUTED}
    others = {k: v for k, v in origin.files.items() if k != EXECUTED}
    settings = {
        name: origin.names.get(name, value) if value is not None else None
        for name, value in properties["configuration"].items()
    }
    return {**properties, "files": others | own, "configuration": settings}


def _settings(config: Run) -> dict[str, str]:
    """Settings that name a file, but for a controller's, and the name."""
    named = {f.name: getattr(config, f.name) for f in fields(config) if f.name not in RESULTS}
    paths = {name: str(value) for name, value in named.items() if isinstance(value, Path)}
    return paths if config.scene in SCENES else {**paths, "scene": config.scene}


def _files(recording: Recording) -> dict[str, Any]:
    files = recording.properties.get("files")
    return dict(files) if isinstance(files, dict) else {}


@contextmanager
def restored(recording: Recording, config: R, name: Path, *, force: bool) -> Iterator[R]:
    """A recorded run with its files as the recording has them, in a temporary folder.

    Parameters
    ----------
    name : of the recording, for messages
    force : use files of this machine where the recording has only their names

    Raises
    ------
    TwinError : the recording lacks a file that its run was given, or holds an invalid one
    """
    files = _files(recording)
    with TemporaryDirectory(prefix="tvc-twin-") as folder:
        changes: dict[str, object] = {}
        for setting, value in _settings(config).items():
            place = Path(folder, setting, NESTED)
            place.mkdir(parents=True)
            try:
                changes[setting] = _written(files, setting, value, place)
            except _MissingError as missing:
                if not force:
                    raise TwinError(
                        f"{name} names {missing} and does not contain it; --force uses the file of"
                        " this machine"
                    ) from None
            except TwinError as error:
                raise TwinError(f"{name}: {error}") from None
        yield replace(config, **changes)  # type: ignore[arg-type]


class _MissingError(Exception):
    """A file that the recording does not contain."""


def _written(files: Mapping[str, Any], setting: str, value: str, place: Path) -> str:
    """Write the file of a setting; returns what the setting becomes."""
    kept = files.get(setting)
    kept = kept if isinstance(kept, dict) else {}
    name = Path(value).name
    file, colon, chosen = name.rpartition(":")
    named = setting == "motor" and colon and kept.get("name", file) == file
    path = place / (file if named else name)
    _write(kept, path, f"the {setting} {value}")
    if setting == "vehicle" and is_description(path):
        for part, target in described_files(path).items():
            if not Path(target).resolve().is_relative_to(place.parents[3].resolve()):
                raise TwinError(f"its vehicle names the {part} {str(target)[:60]!r} elsewhere")
            target.parent.mkdir(parents=True, exist_ok=True)
            own = files.get(OF_VEHICLE + part)
            _write(own if isinstance(own, dict) else {}, target, f"the vehicle's {part}")
    return f"{path}:{chosen}" if named else str(path)


def _write(kept: Mapping[str, Any], path: Path, what: str) -> None:
    pack, text = kept.get("packed"), kept.get("text")
    if isinstance(pack, dict):
        found = {str(name): _grown(data) for name, data in pack.items()}
        if path.suffix.lower() == ".xml":
            unpack(found, path)
        else:
            path.write_bytes(found.get(MAIN, b""))
    elif isinstance(text, str) and path.suffix.lower() != ".xml":
        path.write_bytes(text.encode(errors="replace"))
    else:
        raise _MissingError(what)


def _grown(data: object) -> bytes:
    try:
        return zlib.decompressobj().decompress(base64.b64decode(str(data)), LARGEST_PACK)
    except (ValueError, zlib.error):
        raise TwinError("a packed file cannot be unpacked") from None
