"""Values of a block of rows at the times of poses and texts between them."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from twin.recorder.layout.display import GAP_NS
from twin.recorder.scene.ghost import Ghost

Floats = NDArray[np.float64]
Stamps = NDArray[np.int64]

THRUST = "vehicle/thrust"


def in_force(
    at: Stamps, time: Stamps, block: Floats, slices: Mapping[str, slice]
) -> dict[str, Floats]:
    """Values in force at the given times (n, k) of thrust and gimbal angles; NaN in a gap.

    Parameters
    ----------
    time : of the rows (m,) that `block` begins with [ns]
    slices : of the signals in a row
    """
    found = {}
    for name in (THRUST, *Ghost.signals):
        if name not in slices or not len(time):
            continue
        values = block[: len(time), slices[name]]
        # rows of sensor frames have no vehicle signals, and those of ticks no measurement
        rows = np.flatnonzero(np.isfinite(values).all(axis=1))
        if rows.size:
            row = rows[np.clip(np.searchsorted(time[rows], at, side="right") - 1, 0, None)]
            there = (np.abs(time[row] - at) < GAP_NS)[:, None]
            found[name] = np.where(there, values[row], 0.0 if name == THRUST else np.nan)
    return found


def since_1970(at: Stamps, time: Stamps, wall: Stamps, last: int) -> Stamps:
    """Time since 1970 of the first rows from `at` on (k,); `last` without rows."""
    if not len(time):
        return np.full(len(at), last)
    return wall[np.minimum(np.searchsorted(time, at), len(time) - 1)]
