"""Motor files of every format, and the choice of one motor in a file of several."""

import codecs
from collections.abc import Mapping
from os import PathLike
from pathlib import Path
from typing import Final

from analysis.files import FileError, content, foreign
from twin.physics.motor import eng, rse, table
from twin.physics.motor.curve import Motor
from twin.physics.motor.entry import Entry
from twin.physics.motor.figures import MotorError

LARGEST_FILE: Final = 4_000_000  # bytes; thrustcurve.org's whole collection is smaller
MOST_NAMES: Final = 8  # listed in a message
TABLES: Final = (".csv", ".tsv", ".txt")


def split_name(path: str | PathLike[str]) -> tuple[Path, str | None]:
    """File and motor name of `FILE:NAME`; no name where the whole is a file or has none."""
    whole = Path(path)
    file, colon, name = str(path).rpartition(":")
    if colon and not whole.is_file() and Path(file).is_file():
        return Path(file), name
    return whole, None


def load(
    path: str | PathLike[str], name: str | None = None, like: Mapping[str, float] | None = None
) -> Motor:
    """Motor of a file: the only one in it, or the one called `name`.

    Parameters
    ----------
    path : a file, or FILE:NAME
    name : designation, or maker and designation
    like : figures of the motor that a thrust table replaces, see `motor.table`

    Raises
    ------
    MotorError : unreadable, malformed, no motor of that name or several, or several and no name
    """
    file, chosen = split_name(path)
    name = chosen if name is None else name
    found = entries(file, like)
    matching = [entry for entry in found if name is None or entry.is_called(name)]
    if not matching:
        raise MotorError(f"{file}: no motor {name!r}; the file holds {_names(found)}")
    if len(matching) > 1:
        called = "" if name is None else f" called {name!r}"
        raise MotorError(
            f"{file} holds {len(matching)} motors{called}: {_names(matching)}; give"
            f"{_example(file, matching)} a file with one of them"
        )
    if matching[0].motor is None:
        raise MotorError(matching[0].fault)
    return matching[0].motor


def read(path: Path) -> list[Motor]:
    """All motors of a file, in order.

    Raises
    ------
    MotorError : unreadable, or one of them malformed
    """
    found = entries(path)
    for entry in found:
        if entry.motor is None:
            raise MotorError(entry.fault)
    return [entry.motor for entry in found if entry.motor is not None]


def entries(path: Path, like: Mapping[str, float] | None = None) -> list[Entry]:
    """All motors of a file, usable or not, in order.

    RockSim files are recognised by their first character, thrust tables by the ending .csv, .tsv
    or .txt; everything else is read as RASP. `like` is used as in `load`.

    Raises
    ------
    MotorError : unreadable, too large, or without a motor
    """
    data = _content(path)
    text = _text(data)
    if what := foreign(data[:64]):
        raise MotorError(f"{path}: is {what}")
    begin = text.lstrip("\ufeff \t\r\n")
    if begin.startswith(("<?xml", "<engine") if _is_rasp(path) else "<"):
        return rse.entries(data, str(path), LARGEST_FILE)
    if path.suffix.lower() in TABLES:
        return table.entries(text, str(path), path.stem, like)
    return eng.entries(text, str(path))


def _is_rasp(path: Path) -> bool:
    return path.suffix.lower() == ".eng"


def _content(path: Path) -> bytes:
    try:
        return content(path, LARGEST_FILE)
    except FileError as error:
        raise MotorError(f"cannot read motor {error}") from None


def _text(data: bytes) -> str:
    if data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return data.decode("utf-16", errors="replace")
    if len(data) > 7 and not any(data[1:64:2]) and all(data[0:64:2]):  # UTF-16 without its mark
        return data.decode("utf-16-le", errors="replace")
    return data.decode("utf-8-sig", errors="replace")


def _names(found: list[Entry]) -> str:
    """Designations, with their makers where these tell them apart."""
    makers: dict[str, set[str]] = {}
    for entry in found:
        makers.setdefault(entry.name, set()).add(entry.maker)
    shown = [
        (f"{entry.maker} {entry.name}" if len(makers[entry.name]) > 1 else entry.name)
        + ("" if entry.motor is not None else " (not usable)")
        for entry in found[:MOST_NAMES]
    ]
    return ", ".join(shown) + (", …" if len(found) > MOST_NAMES else "")


def _example(file: Path, found: list[Entry]) -> str:
    """How to choose one of the motors by its name, where a name is enough."""
    names = [entry.name for entry in found if entry.motor is not None]
    single = [name for name in names if sum(entry.name == name for entry in found) == 1]
    return f" one by its name as {file}:{single[0]}, or" if single else ""
