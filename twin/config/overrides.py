"""Model parameters given as `NAME=VALUE` texts and JSON files: parsing only."""

import json
import math
from collections.abc import Iterable
from pathlib import Path

from twin.errors import TwinError

LARGEST_FILE = 1_000_000  # bytes


def parse(items: Iterable[str], file: Path | None = None) -> dict[str, float]:
    """Values by name from a JSON file `{"name": number}` and `NAME=VALUE` texts; the texts win.

    Raises
    ------
    TwinError : a text without `=`, a value that is not a finite number, or a file of another form
    """
    values = _from_file(file) if file else {}
    for item in items:
        name, equals, text = item.partition("=")
        if not equals:
            raise TwinError(f"--set {item!r}: must be NAME=VALUE, for example wind_speed=3")
        values[name.strip()] = _number(text, f"--set {item!r}")
    return values


def _from_file(file: Path) -> dict[str, float]:
    try:
        if file.stat().st_size > LARGEST_FILE:
            raise TwinError(f"{file} is larger than {LARGEST_FILE} bytes")
        content = json.loads(file.read_text())
    except OSError as error:
        raise TwinError(f"cannot read overrides {file}: {error.strerror}") from error
    except (ValueError, RecursionError) as error:
        if isinstance(error, TwinError):
            raise
        raise TwinError(f"{file} is not JSON: {error}") from error
    if not isinstance(content, dict):
        raise TwinError(f'{file}: must be one JSON object, {{"name": number, …}}')
    return {str(name): _number(value, f"{file}: {name}") for name, value in content.items()}


def _number(value: object, where: str) -> float:
    try:
        if isinstance(value, bool) or not isinstance(value, int | float | str):
            raise ValueError
        number = float(value)
    except (ValueError, OverflowError):
        raise TwinError(f"{where}: {str(value)[:40]!r} is not a number") from None
    if not math.isfinite(number):
        raise TwinError(f"{where}: {value} is not finite")
    return number
