"""Axial drag over the Mach number from a file: columns Mach, motor off and, if known, motor on."""

from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from twin.physics.vehicle.design import VehicleError
from twin.physics.vehicle.text import text_of

Array = NDArray[np.float64]
MOST: Final = 500  # rows
LARGEST_MACH, LARGEST_DRAG = 25.0, 10.0


@dataclass(frozen=True)
class DragTable:
    """Axial drag coefficients at Mach numbers, (n,) each.

    Attributes
    ----------
    thrusting : with the motor on; None where the file has two columns
    """

    mach: Array
    coasting: Array
    thrusting: Array | None


def read_drag(path: Path) -> DragTable:
    """Drag table of a CSV file; a first line without numbers is taken as its header.

    Raises
    ------
    VehicleError : unreadable, or the line and what it must be
    """
    rows = [row for row in enumerate(text_of(path, "drag table").splitlines(), 1) if row[1].strip()]
    if rows and _numbers(rows[0][1]) is None:
        rows = rows[1:]
    if not 2 <= len(rows) <= MOST:
        raise VehicleError(f"{path}: has {len(rows)} rows of numbers; must have 2 to {MOST}")
    values: list[list[float]] = []
    for line, text in rows:
        numbers = _numbers(text)
        if numbers is None or len(numbers) not in (2, 3):
            raise VehicleError(
                f"{path}, line {line}: must be Mach, drag coefficient with the motor off and, if"
                " known, on, separated by commas"
            )
        if (
            not (0 <= numbers[0] <= LARGEST_MACH and max(numbers[1:]) <= LARGEST_DRAG)
            or min(numbers) < 0
        ):
            raise VehicleError(
                f"{path}, line {line}: Mach must be 0 to {LARGEST_MACH:g}, drag coefficients 0 to"
                f" {LARGEST_DRAG:g}"
            )
        if values and len(numbers) != len(values[0]):
            raise VehicleError(f"{path}, line {line}: must have {len(values[0])} columns as before")
        if values and numbers[0] <= values[-1][0]:
            raise VehicleError(
                f"{path}, line {line}: Mach {numbers[0]:g} must be above {values[-1][0]:g} of the"
                " line before"
            )
        values.append(numbers)
    table = np.array(values).T
    return DragTable(table[0], table[1], table[2] if len(table) == 3 else None)


def _numbers(text: str) -> list[float] | None:
    try:
        numbers = [float(word) for word in text.split(",")]
    except ValueError:
        return None
    return numbers if np.isfinite(numbers).all() else None
