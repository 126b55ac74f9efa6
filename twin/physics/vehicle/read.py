"""A vehicle's TOML file, validated key by key."""

import math
from collections.abc import Mapping
from dataclasses import MISSING, fields, replace
from difflib import get_close_matches
from pathlib import Path
from typing import Any, Final

from analysis import toml
from analysis.units import SI, UnitError, quantity
from twin.physics import motor
from twin.physics.motor import Motor
from twin.physics.vehicle.design import (
    Allowed,
    Body,
    Chute,
    Design,
    FinSet,
    Gimbal,
    Launch,
    Mass,
    Mount,
    VehicleError,
    allowed,
)
from twin.physics.vehicle.text import text_of

MOST: Final = 200  # parts of one kind
LONGEST: Final = 200  # characters of a text
TABLES: Final = {"motor": Mount, "gimbal": Gimbal, "launch": Launch}
LISTS: Final = {"body": Body, "fins": FinSet, "masses": Mass, "parachutes": Chute}
NAME: Final = frozenset(" _-.()+/#")  # besides letters and digits


def read(path: Path, motor_file: str | Path | None = None) -> Design:
    """Design of a vehicle's TOML file, with its motor.

    Parameters
    ----------
    motor_file : motor file, or FILE:NAME, in place of the one that the design names

    Raises
    ------
    VehicleError : unreadable, or the key, its value and what would be right
    MotorError : the motor file cannot be used
    """
    return with_motor(described(path), motor_file)


def with_motor(design: Design, motor_file: str | Path | None = None) -> Design:
    """A design with its motor, or another in its place; see `read`."""
    if motor_file is not None:
        like = None if not design.motor.file else _own_motor(design).figures
        return replace(design, motor_data=motor.load(motor_file, like=like))
    return replace(design, motor_data=_own_motor(design)) if design.motor.file else design


def described(path: Path) -> Design:
    """Design of a vehicle's TOML file, without its motor.

    Raises
    ------
    VehicleError : unreadable, or the key, its value and what would be right
    """
    return parse(text_of(path, "vehicle"), str(path), path)


def motor_path(design: Design) -> Path | None:
    """Motor file that a design names, without the motor's name; None where it names none."""
    return motor.split_name(str(design.beside(design.motor.file)))[0] if design.motor.file else None


def _own_motor(design: Design) -> Motor:
    return motor.load(str(design.beside(design.motor.file)))


def parse(text: str, name: str = "vehicle", source: Path | None = None) -> Design:
    """Design of a TOML text, without its motor; `name` is used in messages.

    Raises
    ------
    VehicleError : not TOML, or the key, its value and what would be right
    """
    tables = tables_of(text, name)
    try:
        return replace(_design(tables), source=source)
    except VehicleError as error:
        raise VehicleError(f"{name}: {error}") from None


def tables_of(text: str, name: str) -> dict[str, Any]:
    """Content of a TOML text; `name` is used in messages.

    Raises
    ------
    VehicleError : not TOML
    """
    try:
        return toml.parsed(text)
    except ValueError as error:
        reason = " ".join(str(error).split())[:LONGEST]
        raise VehicleError(f"{name} is not valid TOML: {reason}") from None


def _design(content: Mapping[str, Any]) -> Design:
    own = allowed(Design)
    values: dict[str, Any] = {}
    for key, value in content.items():
        if key in LISTS:
            values[key] = tuple(_items(key, value))
        elif key in TABLES:
            values[key] = table(TABLES[key], value, key)
        elif key in own:
            values[key] = _value(own[key], value, key)
        else:
            raise VehicleError(_unknown("", key, [*LISTS, *TABLES, *own]))
    if "body" not in values:
        raise VehicleError("body is missing: a list of parts, nose first")
    return Design(**values)


def _items(key: str, value: Any) -> list[Any]:  # noqa: ANN401  whatever a file holds
    if not isinstance(value, list) or len(value) > MOST:
        raise VehicleError(f"{key}: must be a list of at most {MOST} tables")
    return [table(LISTS[key], item, f"{key}[{k}]") for k, item in enumerate(value)]


def table(kind: type, value: Any, where: str) -> Any:  # noqa: ANN401
    """A table of a file as an object whose fields are marked with `Allowed`.

    Raises
    ------
    VehicleError : the key, its value and what would be right
    """
    if not isinstance(value, dict):
        raise VehicleError(f"{where}: must be a table of {', '.join(allowed(kind))}")
    limits = allowed(kind)
    for key in value:
        if key not in limits:
            raise VehicleError(_unknown(where, key, list(limits)))
    for f in fields(kind):
        if f.name in limits and f.default is MISSING and f.name not in value:
            raise VehicleError(f"{where}: {f.name} is missing")
    return kind(
        **{k: _value(limits[k], v, f"{where}.{k}" if where else k) for k, v in value.items()}
    )


def _unknown(where: str, key: str, valid: list[str]) -> str:
    near = get_close_matches(key, valid, n=1)
    hint = f"did you mean {near[0]}? " if near else ""
    owner = f"{where}: " if where else ""
    return f"{owner}no key {key[:60]!r}; {hint}valid: {', '.join(valid)}"


def _value(limits: Allowed, value: Any, where: str) -> Any:  # noqa: ANN401
    if limits.kind == "word":
        if value not in limits.words:
            raise VehicleError(f"{where} = {_shown(value)}: must be {' or '.join(limits.words)}")
        return value
    if limits.kind == "flag":
        if not isinstance(value, bool):
            raise VehicleError(f"{where} = {_shown(value)}: must be true or false")
        return value
    if limits.kind in ("text", "path"):
        return _checked_text(value, where, path=limits.kind == "path")
    if limits.kind == "lengths":
        many = _list(value, where)
        return tuple(_number(Allowed("length"), v, f"{where}[{k}]") for k, v in enumerate(many))
    if limits.kind == "points":
        return tuple(_point(point, f"{where}[{k}]") for k, point in enumerate(_list(value, where)))
    return _number(limits, value, where)


def _list(value: Any, where: str) -> list[Any]:  # noqa: ANN401
    if not isinstance(value, list) or len(value) > MOST:
        raise VehicleError(f"{where}: must be a list of at most {MOST} values")
    return value


def _point(value: Any, where: str) -> tuple[float, float]:  # noqa: ANN401
    if not isinstance(value, list) or len(value) != 2:
        raise VehicleError(f"{where}: must be two lengths, behind the root and off the body")
    x, y = (_number(Allowed("length", -100.0, 100.0), v, where) for v in value)
    return x, y


def _number(limits: Allowed, value: Any, where: str) -> float:  # noqa: ANN401
    kind = limits.kind
    assert kind in SI
    try:
        number = quantity(value, kind)  # type: ignore[arg-type]
    except UnitError as error:
        raise VehicleError(f"{where} = {_shown(value)}: {error}") from None
    low = number > limits.low if limits.above else number >= limits.low
    if low and number <= limits.high * (1 + 1e-12):
        return min(number, limits.high)
    raise VehicleError(f"{where} = {_shown(value)}: must be {_range(limits)}{_unit(value, kind)}")


def _unit(value: Any, kind: str) -> str:  # noqa: ANN401
    """What a number without a unit was taken for, and how to write it with one."""
    usual = {"length": "mm", "angle": "°", "mass": "g"}.get(kind)
    if usual is None or isinstance(value, str) or value <= 0:
        return ""
    space = "" if usual == "°" else " "
    return f'; without a unit it is in {SI[kind]}: write "{value:g}{space}{usual}"?'


def _range(limits: Allowed) -> str:
    unit = f" {SI[limits.kind]}" if SI.get(limits.kind) else ""
    if limits.kind == "angle":
        low, high = math.degrees(limits.low), math.degrees(limits.high)
        return f"from {low:.4g}° to {high:.4g}°"
    if limits.above and limits.low == 0:
        return f"positive, at most {limits.high:g}{unit}"
    return f"from {limits.low:g} to {limits.high:g}{unit}"


def _checked_text(value: Any, where: str, *, path: bool) -> str:  # noqa: ANN401
    if not isinstance(value, str) or not 0 < len(value) <= LONGEST or not value.isprintable():
        raise VehicleError(
            f"{where} = {_shown(value)}: must be a text of 1 to {LONGEST} characters"
        )
    if not path and not all(c.isalnum() or c in NAME for c in value):
        raise VehicleError(
            f"{where} = {_shown(value)}: may have letters, digits, space and _-.()+/#"
        )
    return value


def printable(text: str) -> str:
    """A text from elsewhere as a name that a description may have; other characters left out."""
    kept = "".join(c if c.isalnum() or c in NAME else " " for c in text[:LONGEST])
    return " ".join(kept.split())


def _shown(value: Any) -> str:  # noqa: ANN401
    text = ascii(value) if not isinstance(value, str) else repr(value)
    return text if len(text) <= 60 else text[:57] + "..."
