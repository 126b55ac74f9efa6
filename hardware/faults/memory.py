"""State of an estimator read back from JSON, which may come from an untrusted file."""

from dataclasses import fields
from enum import StrEnum
from typing import Any, TypeVar

T = TypeVar("T")
LONGEST_TEXT = 40
LARGEST = 1e16  # µs of a device's clock over 300 years; sums and squares stay finite


def number(value: Any) -> float:  # noqa: ANN401  whatever JSON holds
    """Return a JSON value as a number of sensible size.

    Raises
    ------
    TypeError, ValueError : it is not one
    """
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise TypeError(f"{str(value)[:LONGEST_TEXT]!r} is not a number")
    if not abs(value) <= LARGEST:  # NaN neither
        raise ValueError("a number out of range")
    return float(value)


def filled(kind: type[T], values: Any) -> T:  # noqa: ANN401
    """Return a dataclass of numbers, texts and pairs of numbers with these values.

    Each value must be of the type of the field's default.

    Raises
    ------
    KeyError, TypeError, ValueError : a value is missing or of another type
    """
    if not isinstance(values, dict):
        raise TypeError("not an object")
    made = kind(**({"index": 0} if "index" in values else {}))
    for f in fields(made):  # type: ignore[arg-type]
        setattr(made, f.name, _alike(getattr(made, f.name), values[f.name]))
    return made


def _alike(example: Any, value: Any) -> Any:  # noqa: ANN401
    if isinstance(example, StrEnum):
        return type(example)(value)
    if isinstance(example, str):
        if not isinstance(value, str) or len(value) > LONGEST_TEXT:
            raise TypeError("not a short text")
        return value
    if isinstance(example, list):
        if not isinstance(value, list) or len(value) != len(example):
            raise TypeError(f"not a list of {len(example)}")
        return [number(v) for v in value]
    return type(example)(number(value))
