"""Numbers with units from text files: `150 mm`, `40 g`, `5°`; a bare number is in SI units."""

import math
import re
from typing import Final, Literal

Kind = Literal["length", "mass", "angle", "density", "time", "speed", "number"]

UNITS: Final[dict[Kind, dict[str, float]]] = {
    "length": {
        "m": 1.0,
        "mm": 1e-3,
        "cm": 1e-2,
        "um": 1e-6,
        "µm": 1e-6,
        "in": 0.0254,
        "ft": 0.3048,
    },
    "mass": {"kg": 1.0, "g": 1e-3, "lb": 0.45359237, "oz": 0.028349523125},
    "angle": {"rad": 1.0, "deg": math.pi / 180, "°": math.pi / 180},
    "density": {"kg/m3": 1.0, "kg/m³": 1.0, "g/cm3": 1e3, "g/cm³": 1e3},
    "time": {"s": 1.0, "ms": 1e-3},
    "speed": {"m/s": 1.0, "km/h": 1 / 3.6},
    "number": {"": 1.0},
}
SI: Final = {
    "length": "m",
    "mass": "kg",
    "angle": "rad",
    "density": "kg/m3",
    "time": "s",
    "speed": "m/s",
    "number": "",
}
_TEXT = re.compile(r"\s*([-+]?[0-9]*\.?[0-9]+(?:[eE][-+]?[0-9]+)?)\s*(\S*)\s*")
LONGEST: Final = 60  # characters


class UnitError(ValueError):
    """A value that is not a number of the expected kind; the text is what it must be."""


def quantity(value: object, kind: Kind) -> float:
    """Value in SI units of a number, or of a text with number and unit.

    Raises
    ------
    UnitError : neither, not finite, or a unit of another kind
    """
    units = UNITS[kind]
    if isinstance(value, str) and len(value) <= LONGEST and (match := _TEXT.fullmatch(value)):
        number, unit = float(match[1]), match[2]
        if unit not in units:
            raise UnitError(f"must have one of the units {', '.join(u for u in units if u)}")
        number *= units[unit]
    elif isinstance(value, int | float) and not isinstance(value, bool):
        number = float(value) if abs(value) < 1e300 else math.inf
    else:
        raise UnitError(_wanted(kind))
    if not math.isfinite(number):
        raise UnitError("must be finite")
    return number


def of_any_kind(text: str) -> float:
    """Value in SI units of a text with a number and any unit of `UNITS`, or none.

    Raises
    ------
    UnitError : neither
    """
    unit = match[2] if len(text) <= LONGEST and (match := _TEXT.fullmatch(text)) else None
    for kind, units in UNITS.items():
        if unit in units:
            return quantity(text, kind)
    raise UnitError("is not a number, nor one with a unit such as 270° or 8 m/s")


def is_number(text: str) -> bool:
    """Whether a text is one number without a unit; also `nan` and `inf`, but not `1_0` or `１`."""
    if "_" in text or not text.isascii():
        return False
    try:
        float(text)
    except ValueError:
        return False
    return True


def _wanted(kind: Kind) -> str:
    if kind == "number":
        return "must be a number"
    examples = {"length": "150 mm", "mass": "40 g", "angle": "5°", "density": "680 kg/m3"}
    return f'must be a number in {SI[kind]}, or a text such as "{examples[kind]}"'
