"""Motions of the gimbal's axes, interpolated but not across gaps in the readings."""

import math
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray

from analysis.array import Array

FEWEST = 16  # samples of a motion, and in common
GAP = 5.0  # periods without a reading; nothing is interpolated across
COMMON = 0.98  # of the intervals between stamps; rarer ones are gaps if they are long


def bridged(time: ArrayLike, stamps: ArrayLike, values: ArrayLike, delay: float = 0.0) -> Array:
    """Values (m,) at times `delay` after those (n,) asked for; NaN outside, and in holes.

    A hole is longer than five periods of the sparser of the two.
    """
    t, s, x = (np.asarray(v, dtype=np.float64) for v in (time, stamps, values))
    there = np.interp(t + delay, s, x, left=math.nan, right=math.nan)
    there[in_gap(t, s, delay)] = math.nan
    return there


def in_gap(t: Array, s: Array, delay: float = 0.0, margin: float = 0.0) -> NDArray[np.bool_]:
    """Which of the times (n,), moved by a delay, lie in a hole of the stamps or close to one."""
    rows = np.flatnonzero(np.diff(s) > GAP * max(_period(t), _period(s)))
    begun = np.searchsorted(s[rows] - margin, t + delay, side="left")
    ended = np.searchsorted(s[rows + 1] + margin, t + delay, side="right")
    return np.asarray(begun > ended)


def _period(t: Array) -> float:
    """Mean, or the gap between bursts of stamps where that is longer: such gaps are no holes."""
    if len(t) < 2:
        return 0.0
    common = np.quantile(np.diff(t), COMMON, method="lower")
    return max(float(t[-1] - t[0]) / (len(t) - 1), float(common))


def unbroken(t: Array, *values: Array) -> tuple[Array, ...]:
    """The longest stretch without a hole."""
    breaks = np.flatnonzero(np.diff(t) > GAP * _period(t)) + 1
    edges = [0, *breaks.tolist(), len(t)]
    a, b = max(pairwise(edges), key=lambda e: float(t[e[1] - 1] - t[e[0]]))
    return tuple(v[a:b] for v in (t, *values))
