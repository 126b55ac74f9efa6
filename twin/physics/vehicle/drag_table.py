"""Axial drag over the Mach number from a file: columns Mach, motor off and, if known, motor on."""

from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from twin.physics.vehicle.design import VehicleError
from twin.physics.vehicle.text import numbers_of

Array = NDArray[np.float64]
COLUMNS: Final = "Mach, drag coefficient with the motor off and, if known, on"
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
    mach = (0.0, LARGEST_MACH)
    rows = numbers_of(path, "drag table", COLUMNS, (2, 3), (mach, *2 * [(0.0, LARGEST_DRAG)]))
    for (line, now), (_, before) in zip(rows[1:], rows, strict=False):
        if now[0] <= before[0]:
            raise VehicleError(
                f"{path}, line {line}: Mach {now[0]:g} must be above {before[0]:g} of the line"
                " before"
            )
    table = np.array([numbers for _, numbers in rows]).T
    return DragTable(table[0], table[1], table[2] if len(table) == 3 else None)
