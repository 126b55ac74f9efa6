"""Stamps of loggers: counters that overflow, and few rows that are out of order or repeated."""

from bisect import bisect_left

import numpy as np

from analysis.array import Array

TURN = 2.0**32  # of a counter such as micros()


def unwrapped(stamps: Array) -> Array:
    """Stamps (n,) of a counter of 32 bits through its overflows: `micros()` has one in 72 min."""
    over = (np.diff(stamps, prepend=stamps[:1]) < -0.99 * TURN) & (stamps < TURN)
    return stamps + TURN * np.cumsum(over) if over.any() else stamps


def increasing(stamps: Array, most: float) -> Array | None:
    """Rows (n,) that leave the longest strictly increasing column.

    None where more than `most` rows would be lost.
    """
    if (np.diff(stamps) <= 0.0).sum() > most:
        return None
    # Fredman 1975, Discrete Mathematics 11, 29-35: the least last stamp of every length
    lasts: list[float] = []
    rows: list[int] = []
    before = np.full(len(stamps), -1)
    for k, stamp in enumerate(stamps.tolist()):
        at = bisect_left(lasts, stamp)
        if at < len(lasts) and lasts[at] == stamp:
            continue  # the first of one stamp stays
        before[k] = rows[at - 1] if at else -1
        lasts[at : at + 1] = [stamp]
        rows[at : at + 1] = [k]
    if len(stamps) - len(rows) > most:
        return None
    kept = np.zeros(len(stamps), dtype=bool)
    row = rows[-1] if rows else -1
    while row >= 0:
        kept[row] = True
        row = int(before[row])
    return kept
