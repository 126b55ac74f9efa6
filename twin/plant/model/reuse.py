"""Models built before in this process, while the files that they came from are unchanged."""

import copy
import os
from collections import OrderedDict
from collections.abc import Hashable, Iterator, Mapping
from dataclasses import dataclass, replace
from hashlib import sha256
from pathlib import Path
from typing import Final

from analysis.files import FileError, content, noted
from twin.physics.guard import LARGEST_ASSET, SHIPPED
from twin.plant.model.build import Built, ModelConfig, build, of_backlash

MOST: Final = 4  # models; 5 MB each
_Stamp = tuple[str, int, int, int, int]


@dataclass(frozen=True)
class _Kept:
    """A built model and what it came from: shipped files by their stamps, others by digests."""

    built: Built
    shipped: tuple[_Stamp, ...]
    files: Mapping[str, bytes]


_models: OrderedDict[Hashable, _Kept] = OrderedDict()


def reused(config: ModelConfig) -> Built:
    """The model of `build`, copied where this process has built it from the same files.

    Models with MJCF files that are not shipped are built anew: MuJoCo itself reads what these
    refer to.

    Raises
    ------
    TwinError : as `build`
    """
    key, shipped = _key(config), tuple(_stamps(str(SHIPPED)))
    kept = _models.get(key)
    if kept is None or kept.shipped != shipped or not _unchanged(kept.files):
        with noted() as files:
            built = build(config)
        if not built.traced:
            return built
        kept = _Kept(built, shipped, files)
    _models[key] = kept  # again, since another thread may have put it out meanwhile
    _models.move_to_end(key)
    while len(_models) > MOST:
        _models.popitem(last=False)
    return replace(kept.built, mj=copy.copy(kept.built.mj))


def forget() -> None:
    """Build all models anew from now on."""
    _models.clear()


def _key(config: ModelConfig) -> Hashable:
    """All settings that `build` uses."""
    return (
        config.scene, config.gimbal, config.transfer_function, config.vehicle,
        _real(config.vehicle), config.mechanism, config.motor, config.dt,
        tuple(of_backlash(config.overrides).items()),
    )  # fmt: skip


def _real(file: Path | None) -> str:
    """Where a path leads; empty where `build` refuses it."""
    try:
        return "" if file is None else os.path.realpath(file)
    except ValueError:
        return ""


def _stamps(folder: str) -> Iterator[_Stamp]:
    with os.scandir(folder) as entries:
        for entry in entries:
            if entry.name == "__pycache__":
                continue
            if entry.is_dir():
                yield from _stamps(entry.path)
            else:
                s = entry.stat()
                yield entry.path, s.st_ino, s.st_size, s.st_mtime_ns, s.st_ctime_ns


def _unchanged(files: Mapping[str, bytes]) -> bool:
    try:
        return all(sha256(content(f, LARGEST_ASSET)).digest() == d for f, d in files.items())
    except FileError:
        return False
