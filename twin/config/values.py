"""Checked conversion of untrusted values (JSON, Python, command line) to annotated settings."""

import math
import os
import types
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal, Union, get_args, get_origin

from twin.config.overrides import parse
from twin.config.types import Overrides, Range
from twin.errors import TwinError

LONGEST_PATH = 4096  # characters
LONGEST = 1000  # entries of a list, characters of a text


class SettingError(Exception):
    """A value that a setting cannot take.

    Parameters
    ----------
    value : what was given
    right : what would be accepted, for `must be ...`
    """

    def __init__(self, value: object, right: str) -> None:
        super().__init__(right)
        self.value, self.right = value, right


def converted(value: object, hint: Any) -> Any:  # noqa: ANN401  a type, and a value of it
    """Return a value as its annotation asks for.

    Whole numbers become floats, lists tuples and texts paths where the annotation asks for them;
    every number must be finite and within the annotation's `Range`.

    Raises
    ------
    SettingError : it is something else
    TwinError : overrides that cannot be parsed
    """
    if hint == Overrides:
        return _overrides(value)
    origin, arguments = get_origin(hint), get_args(hint)
    if origin is Annotated:
        return _within(converted(value, arguments[0]), arguments[1:])
    if origin in (Union, types.UnionType):
        return _either(value, arguments)
    if origin is Literal:
        if value in arguments:
            return value
        raise SettingError(value, "one of " + ", ".join(map(str, arguments)))
    if origin is tuple:
        return _tuple(value, arguments)
    if hint is Path:
        return _path(value)
    if hint in (int, float):
        return _number(value, hint)
    if isinstance(value, hint) and len(str(value)) <= LONGEST:
        return value
    raise SettingError(value, {bool: "true or false", str: "a text"}.get(hint, str(hint)))


def shown(value: object) -> str:
    """A value for a message, at most 60 characters."""
    return str(value)[:60]


def _overrides(value: object) -> tuple[tuple[str, float], ...]:
    if not isinstance(value, Mapping | list | tuple) or len(value) > LONGEST:
        raise SettingError(value, "a list of NAME=VALUE, or a mapping")
    return tuple(parse(value).items())


def _path(value: object) -> Path:
    if isinstance(value, str | os.PathLike):
        text = os.fspath(value)
        if isinstance(text, str) and 0 < len(text) <= LONGEST_PATH and "\0" not in text:
            return Path(text)
    raise SettingError(value, "a path")


def _number(value: object, kind: type) -> Any:  # noqa: ANN401
    what = "a whole number" if kind is int else "a number"
    if hasattr(value, "item") and getattr(value, "ndim", 0) == 0:
        value = value.item()  # a NumPy scalar
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise SettingError(value, what)
    if kind is int:
        if not isinstance(value, int):
            raise SettingError(value, what)
        return value
    if isinstance(value, int) and abs(value) > 2**1000:
        raise SettingError(value, what)
    if not math.isfinite(value):
        raise SettingError(value, "finite")
    return float(value)


def _within(value: Any, markers: tuple[object, ...]) -> Any:  # noqa: ANN401
    for limits in markers:
        if isinstance(limits, Range) and value not in limits:
            raise SettingError(value, str(limits))
    return value


def _either(value: object, options: tuple[Any, ...]) -> Any:  # noqa: ANN401
    if value is None and type(None) in options:
        return None
    faults = []
    for option in options:
        if option is type(None):
            continue
        try:
            return converted(value, option)
        except SettingError as fault:
            faults.append(fault.right)
    raise SettingError(value, " or ".join(faults))


def _tuple(value: object, inside: tuple[Any, ...]) -> tuple[Any, ...]:
    many = len(inside) == 2 and inside[1] is Ellipsis
    if many and isinstance(value, str | os.PathLike):  # one where several are allowed
        value = (value,)
    if hasattr(value, "tolist"):
        value = value.tolist()  # a NumPy array
    if not isinstance(value, list | tuple) or len(value) > LONGEST:
        raise SettingError(value, "a list")
    if many:
        return tuple(converted(v, inside[0]) for v in value)
    if len(value) != len(inside):
        raise SettingError(value, f"{len(inside)} values")
    return tuple(converted(v, h) for v, h in zip(value, inside, strict=True))


def refusal(flag: str, fault: SettingError) -> TwinError:
    """The message of a value that a flag cannot take."""
    given = fault.value
    text = " ".join(map(str, given)) if isinstance(given, list | tuple) else str(given)
    return TwinError(f"--{flag.replace('_', '-')} {shown(text)}: must be {fault.right}")
