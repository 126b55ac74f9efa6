"""What an estimator remembers, read back from JSON that may be anybody's."""

from dataclasses import fields
from enum import StrEnum
from typing import Any, TypeVar

T = TypeVar("T")
LONGEST_WORD = 40
LARGEST = 1e16  # µs of a device's clock over 300 years; sums and squares stay finite


def number(value: Any) -> float:  # noqa: ANN401  whatever JSON holds
    """Return a JSON value as a number of sensible size.

    Raises
    ------
    TypeError, ValueError : it is none
    """
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise TypeError(f"{str(value)[:LONGEST_WORD]!r} is no number")
    if not abs(value) <= LARGEST:  # NaN neither
        raise ValueError("a number beyond anything an estimator remembers")
    return float(value)


def filled(kind: type[T], values: Any) -> T:  # noqa: ANN401
    """Return a dataclass of numbers, words and pairs of numbers with these values.

    Each value must be of the kind that the field's default is.

    Raises
    ------
    KeyError, TypeError, ValueError : a value is missing or of another kind
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
        if not isinstance(value, str) or len(value) > LONGEST_WORD:
            raise TypeError("not a word")
        return value
    if isinstance(example, list):
        if not isinstance(value, list) or len(value) != len(example):
            raise TypeError(f"not a list of {len(example)}")
        return [number(v) for v in value]
    return type(example)(number(value))
