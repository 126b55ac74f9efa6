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
# of compound units: factor to SI, and powers of kg, m, s, rad and A
_Unit = tuple[float, tuple[int, ...]]
_POWERS: Final[dict[Kind, tuple[int, ...]]] = {
    "mass": (1, 0, 0, 0, 0), "length": (0, 1, 0, 0, 0), "time": (0, 0, 1, 0, 0),
    "angle": (0, 0, 0, 1, 0),
}  # fmt: skip
_SYMBOLS: Final[dict[str, _Unit]] = {
    **{s: (f, power) for kind, power in _POWERS.items() for s, f in UNITS[kind].items()},
    "min": (60.0, (0, 0, 1, 0, 0)),
    "h": (3600.0, (0, 0, 1, 0, 0)),
    "km": (1000.0, (0, 1, 0, 0, 0)),
    "N": (1.0, (1, 1, -2, 0, 0)),
    "Nm": (1.0, (1, 2, -2, 0, 0)),
    "A": (1.0, (0, 0, 0, 0, 1)),
    "V": (1.0, (1, 2, -3, 0, -1)),
    "Ω": (1.0, (1, 2, -3, 0, -2)),
    "%": (0.01, (0, 0, 0, 0, 0)),
    "1": (1.0, (0, 0, 0, 0, 0)),
}
_SYMBOL = re.compile(r"([^\d²³⁴^]+|1)\^?([1-4²³⁴]?)")
_COMPOUND = re.compile(r"\s*([-+]?[0-9]*\.?[0-9]+(?:[eE][-+]?[0-9]+)?)\s*(.*?)\s*")
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


def in_unit(text: str, unit: str | None) -> float:
    """Value in SI units of a text with a number and a unit, compound ones such as N m/rad too.

    Parameters
    ----------
    unit : SI unit that the text's has to be convertible to; "-" for a number without one, None to
        take any

    Raises
    ------
    UnitError : no number, no such unit, or one of another kind
    """
    match = _COMPOUND.fullmatch(text) if len(text) <= LONGEST else None
    wanted = None if unit is None else _compound(unit.strip("-"))
    given = None if match is None else _compound(match[2])
    if match is None or (given is None and wanted is None):
        raise UnitError("is not a number, nor one with a unit such as 270° or 8 m/s")
    if given is None or (match[2] and wanted is not None and given[1] != wanted[1]):
        raise UnitError(
            f"must be in {unit}, or in a unit that converts to it"
            if wanted is None or any(wanted[1])
            else "must be a number without a unit"
        )
    return float(match[1]) * given[0]


def _compound(text: str) -> _Unit | None:
    """Factor and powers of a unit; None where it has a symbol that is not known."""
    factor, powers = 1.0, [0, 0, 0, 0, 0]
    for sign, part in zip((1, -1), text.split("/", 1), strict=False):
        for word in re.split(r"[\s·*]+", part) if part.strip() else ():
            match = _SYMBOL.fullmatch(word)
            if match is None or match[1] not in _SYMBOLS:
                return None
            scale, of = _SYMBOLS[match[1]]
            power = sign * int(match[2].translate(_RAISED) or 1)
            factor *= scale**power
            powers = [p + power * q for p, q in zip(powers, of, strict=True)]
    return factor, tuple(powers)


_RAISED = str.maketrans("²³⁴", "234")


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
