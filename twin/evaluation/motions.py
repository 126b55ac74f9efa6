"""Motions later, or behind a lag: effects that need no other simulation."""

import math

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

Array = NDArray[np.float64]

LATER = 5e-3  # s; difference over which the derivatives by delay and lag are taken


def later(stamps: Array, motion: Array, by: float) -> Array:
    """A motion (n, 2) that comes later by a time [s]."""
    return np.column_stack([np.interp(stamps - by, stamps, m) for m in motion.T])


def lagging(motion: Array, by: float, period: float) -> Array:
    """A motion (n, 2) behind a first-order lag [s]; ahead of it by as much where negative."""
    if by == 0.0:
        return motion
    keep = math.exp(-period / abs(by))
    start = keep * motion[:1]  # at rest
    lagged = np.asarray(lfilter([1.0 - keep], [1.0, -keep], motion, axis=0, zi=start)[0])
    return lagged if by > 0.0 else 2.0 * motion - lagged
