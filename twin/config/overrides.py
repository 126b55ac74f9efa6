"""Values of named model parameters, from `NAME=VALUE` texts, a mapping or a JSON file."""

import json
import math
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from analysis.files import FileError, content
from analysis.units import UnitError, in_unit, is_number
from twin.errors import TwinError

LARGEST_FILE = 1_000_000  # bytes


def parse(
    given: Mapping[str, float] | Sequence[str | tuple[str, float]], file: Path | None = None
) -> dict[str, float]:
    """Return overrides by name.

    Parameters
    ----------
    given : `NAME=VALUE` texts, pairs, or a mapping; they take precedence over the file
    file : JSON object of `{"name": number}`

    Raises
    ------
    TwinError : a text without `=`, a value that is not a finite number, a file that is not such
        JSON
    """
    values = _from_file(file) if file else {}
    for name, value in _pairs(given):
        values[name.strip()] = _number(name.strip(), value, f"--set {name}={value}")
    return values


def _pairs(
    given: Mapping[str, float] | Sequence[str | tuple[str, float]],
) -> Iterable[tuple[str, object]]:
    if isinstance(given, Mapping):
        yield from given.items()
        return
    if isinstance(given, str):
        raise TwinError(f"--set {given!r}: must be a list of NAME=VALUE, or a mapping")
    texts: set[str] = set()
    for item in given:
        if isinstance(item, list | tuple) and len(item) == 2 and isinstance(item[0], str):
            yield item[0], item[1]
            continue
        name, equals, text = item.partition("=") if isinstance(item, str) else ("", "", "")
        if not equals:
            raise TwinError(f"--set {str(item)[:60]!r}: must be NAME=VALUE, such as wind_speed=3")
        if name.strip() in texts:
            raise TwinError(f"--set {str(item)[:60]}: {name.strip()} is given twice; give it once")
        texts.add(name.strip())
        yield name, text


def _from_file(file: Path) -> dict[str, float]:
    try:
        values = json.loads(content(file, LARGEST_FILE), object_pairs_hook=_once)
    except FileError as error:
        raise TwinError(f"cannot read overrides {error}") from None
    except (ValueError, RecursionError) as error:
        raise TwinError(f"{file} is not JSON: {error}") from None
    if not isinstance(values, dict):
        raise TwinError(f'{file}: overrides are one JSON object, {{"name": number, …}}')
    return {str(name): _number(name, value, f"{file}: {name}") for name, value in values.items()}


def _once(pairs: list[tuple[str, object]]) -> dict[str, object]:
    values = dict(pairs)
    if len(values) < len(pairs):
        names = [name for name, _ in pairs]
        twice = next(n for n in names if names.count(n) > 1)
        raise ValueError(f"{twice[:60]!r} is given twice")
    return values


def _number(name: str, value: object, where: str) -> float:
    """Return a finite number; a text may have a unit that converts to the parameter's.

    Raises
    ------
    TwinError : it is not one, beginning with `where`
    """
    try:
        if isinstance(value, bool) or not isinstance(value, int | float | str):
            raise ValueError
        if isinstance(value, str) and not is_number(value):
            value = in_unit(value, _unit(name))
        result = float(value)
    except UnitError as error:
        raise TwinError(f"{where}: {str(value)[:40]!r} {error}") from None
    except (ValueError, OverflowError):
        raise TwinError(f"{where}: {str(value)[:40]!r} is not a number") from None
    if not math.isfinite(result):
        raise TwinError(f"{where}: {value} is not finite")
    return result


def _unit(name: str) -> str | None:
    """Unit of a parameter, None where it is not known; loaded late, since physics takes long."""
    from twin.config.parameters import unit_and_meaning

    known = unit_and_meaning(name)
    return known[0] if known else None
