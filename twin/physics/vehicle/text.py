"""Text files that describe a vehicle, read within limits."""

from collections.abc import Sequence
from pathlib import Path
from typing import Final

import numpy as np

from analysis.files import FileError, content
from twin.physics.vehicle.design import VehicleError

LARGEST_FILE: Final = 200_000  # bytes
MOST_ROWS: Final = 500


def text_of(path: Path, what: str) -> str:
    """Text of a file in UTF-8; `what` it is stands in messages.

    Raises
    ------
    VehicleError : it cannot be read, is too large, or not a text
    """
    try:
        return content(path, LARGEST_FILE).decode("utf-8-sig")
    except FileError as error:
        raise VehicleError(f"cannot read {what} {error}") from None
    except UnicodeDecodeError:
        raise VehicleError(f"{path} is not a text in UTF-8") from None


def numbers_of(
    path: Path,
    what: str,
    columns: str,
    counts: tuple[int, int],
    limits: Sequence[tuple[float, float]],
) -> list[tuple[int, list[float]]]:
    """Line numbers and numbers of a CSV file; a first line without numbers is its header.

    Parameters
    ----------
    what, columns : the file and its columns, for messages
    counts : fewest and most columns
    limits : smallest and largest value of each column

    Raises
    ------
    VehicleError : unreadable, or the line and what it must be
    """
    rows = [row for row in enumerate(text_of(path, what).splitlines(), 1) if row[1].strip()]
    if rows and "," not in rows[-1][1]:
        line, row = rows[-1]
        raise VehicleError(
            f"{path}, line {line}: {row[:40]!r} has no commas; must be {columns}, separated by"
            " commas"
        )
    if rows and _numbers(rows[0][1]) is None:
        rows = rows[1:]
    if not 2 <= len(rows) <= MOST_ROWS:
        raise VehicleError(f"{path}: has {len(rows)} rows of numbers; must have 2 to {MOST_ROWS}")
    found: list[tuple[int, list[float]]] = []
    for line, text in rows:
        numbers = _numbers(text)
        if numbers is None or not counts[0] <= len(numbers) <= counts[1]:
            raise VehicleError(f"{path}, line {line}: must be {columns}, separated by commas")
        for k, (number, (low, high)) in enumerate(zip(numbers, limits, strict=False), 1):
            if not low <= number <= high:
                raise VehicleError(
                    f"{path}, line {line}: column {k} = {number:g}; must be {low:g} to {high:g}"
                )
        if found and len(numbers) != len(found[0][1]):
            raise VehicleError(
                f"{path}, line {line}: must have {len(found[0][1])} columns as before"
            )
        found.append((line, numbers))
    return found


def _numbers(text: str) -> list[float] | None:
    try:
        numbers = [float(word) for word in text.split(",")]
    except ValueError:
        return None
    return numbers if np.isfinite(numbers).all() else None
