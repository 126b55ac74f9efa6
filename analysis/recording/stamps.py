"""Stamps of loggers: counters that overflow, and few rows that are out of order or repeated."""

from bisect import bisect_left

import numpy as np
from numpy.typing import NDArray

from analysis.array import Array

TURN = 2.0**32  # of a counter such as micros()
_SHORT = (2.0**16, 2.0**24)  # of counters of fewer bits
# the same where a program counts in s or ms what the counter has in µs or ms
_DIVIDED = (2.0**16 * 1e-3, 2.0**32 * 1e-6, 2.0**32 * 1e-3)
_EVEN = 0.5  # of the median spacing, within which an overflow leaves the others' spacing
_FEWEST = 8  # stamps by which a spacing is judged


def turn_of(stamps: Array) -> float:
    """Range of the counter that stamps (n,) are of, by its overflows; 0 where they show none.

    Counters of 32 bits have one in 72 min of `micros()`. Of others, of 16 and 24 bits and of those
    that a program divided by a thousand or a million, every step back must be an overflow to a
    spacing as the others': a row out of order, or a board that began anew, leaves another.
    """
    back = np.diff(stamps) < 0.0
    if not back.any():
        return 0.0
    if _over(stamps, TURN).any():
        return TURN
    whole = not (stamps % 1.0).any()
    for turn in _SHORT if whole else _DIVIDED:
        if len(stamps) < _FEWEST:
            break
        apart = np.diff(stamps) % turn
        usual = float(np.median(apart))
        within = stamps.min() >= 0.0 or stamps.max() < turn / 2.0
        near = np.abs(apart[back] - usual) <= _EVEN * usual
        if np.ptp(stamps) < turn and within and 0.0 < usual < turn / 2.0 and near.all():
            return turn
    return 0.0


def unwrapped(stamps: Array) -> Array:
    """Stamps (n,) of a counter of 16, 24 or 32 bits through its overflows."""
    turn = turn_of(stamps)
    if turn == 0.0:
        return stamps
    return stamps + turn * np.cumsum(_over(stamps, turn))


def _over(stamps: Array, turn: float) -> NDArray[np.bool_]:
    """Where a counter overflowed (n,); one of 32 bits may have rows out of order beside it."""
    back = np.diff(stamps, prepend=stamps[:1])
    return (back < (-0.99 * turn if turn == TURN else 0.0)) & (stamps < turn)


def restarts(stamps: Array) -> str:
    """What steps back in stamps (n,) may come from, for a message; empty where nothing is plain."""
    back = np.flatnonzero(np.diff(stamps) < 0.0)
    if len(back) == len(stamps) - 1:
        return "; sort the rows by time"
    same = int(np.sum(np.diff(stamps) == 0.0))
    if 2 * same > len(stamps):
        return "; rows share their stamps: record them finer than the sampling"
    near = 0.1 * np.ptp(stamps)
    begins = stamps[back + 1]
    if not len(back) or not ((np.abs(begins - stamps[0]) <= near) | (np.abs(begins) <= near)).all():
        return ""
    return "; where it starts again another run begins: give each a file, or one clock to all"


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
