"""Single readings far from all others: a loose wire, a lost bit.

A spike stands out of the readings around it. Being far from a model is not enough: a model whose
commands are dated half a millisecond off is far from every reading of a steep flank.
"""

import numpy as np

from analysis.array import Array
from analysis.identify.problem.noise import Mask, Pair
from analysis.identify.problem.problem import Problem

_SPIKE = 6.0  # sigma; one Gaussian reading in 5e8 lies beyond
_SKIRT = 3.0  # sigma: a reading next to a spike that lies this far is part of it
_RUN = 3  # readings: a longer run is motion the model lacks, not a spike
_BESIDE = 2  # readings on either side that a spike is judged by
_WIDE = 9  # readings around that a gross one is judged by, itself among them
_BEYOND = 1.5  # of the range of the motion: no gimbal is so far from its neighbours
_TAIL = 0.03  # of the readings at either end, which that range leaves out
_SHARE = 0.02  # of all readings: more are no accidents


def outstanding(problem: Problem, sigma: Pair, kept: Mask) -> Mask:
    """Runs of up to three readings beyond six sigma outside the range of those around (rows,).

    And gross ones, which may lie beside each other or at the end of a record; they are no
    neighbours by which others are judged.
    """
    found = np.zeros(len(kept), dtype=bool)
    for rows, is_rate in _sensors(problem, kept):
        found[rows] = _stand_out(problem.measured[rows], _SPIKE * sigma[int(is_rate)])
    return found if found.sum() <= max(_RUN, _SHARE * kept.sum()) else np.zeros_like(found)


def gross(problem: Problem, sigma: Pair, kept: Mask) -> Mask:
    """Readings farther from those around than all motion reaches (rows,), by no model."""
    found = np.zeros(len(kept), dtype=bool)
    for rows, is_rate in _sensors(problem, kept):
        found[rows] = _gross(problem.measured[rows], _SPIKE * sigma[int(is_rate)])
    return found if found.sum() <= max(_RUN, _SHARE * kept.sum()) else np.zeros_like(found)


def spikes(problem: Problem, residual: Array, sigma: Pair, kept: Mask) -> Mask:
    """Outstanding readings that the model does not explain either, and neighbours they smeared."""
    far = np.zeros(len(kept), dtype=bool)
    off = np.zeros(len(kept), dtype=bool)
    for rows, is_rate in _sensors(problem, kept):
        off[rows] = np.abs(residual[rows]) > _SKIRT * sigma[int(is_rate)]
        far[rows] = np.abs(residual[rows]) > _SPIKE * sigma[int(is_rate)]
    far &= outstanding(problem, sigma, kept)
    beside = np.zeros_like(far)
    beside[1:] |= far[:-1]
    beside[:-1] |= far[1:]
    return far | (beside & off)


def _sensors(problem: Problem, kept: Mask) -> list[tuple[np.ndarray, bool]]:
    """Rows of each sensor of each record, in the order of time, and whether it is a gyro."""
    found = []
    for is_rate in (False, True):
        for index in range(len(problem.parts)):
            rows = np.flatnonzero(kept & (problem.is_rate == is_rate) & (problem.owner == index))
            if len(rows) > _RUN + 2 * _BESIDE:
                found.append((rows, is_rate))
    return found


def _gross(values: Array, limit: float) -> Mask:
    """Readings (n,) farther from the median of those around than all motion reaches."""
    if len(values) < _WIDE:
        return np.zeros(len(values), dtype=bool)
    low, high = np.quantile(values, (_TAIL, 1.0 - _TAIL))
    if np.ptp(values) <= max(limit, _BEYOND * (high - low)):
        return np.zeros(len(values), dtype=bool)
    around = np.median(np.lib.stride_tricks.sliding_window_view(values, _WIDE), axis=1)
    reach = max(limit, _BEYOND * (high - low), _BEYOND * float(np.ptp(around)))
    before, after = _WIDE // 2, _WIDE - 1 - _WIDE // 2
    return np.asarray(np.abs(values - np.pad(around, (before, after), mode="edge")) > reach)


def _stand_out(values: Array, limit: float) -> Mask:
    found = _gross(values, limit)
    kept = np.flatnonzero(~found)
    if len(kept) > _RUN + 2 * _BESIDE:
        found[kept] = _beyond_neighbours(values[kept], limit)
    return found


def _beyond_neighbours(values: Array, limit: float) -> Mask:
    found = np.zeros(len(values), dtype=bool)
    for run in range(1, _RUN + 1):
        count = len(values) - run - 2 * _BESIDE + 1
        window = np.lib.stride_tricks.sliding_window_view(values, run + 2 * _BESIDE)
        inside = window[:, _BESIDE : _BESIDE + run]
        around = np.delete(window, range(_BESIDE, _BESIDE + run), axis=1)
        above = inside.min(axis=1) > around.max(axis=1) + limit
        below = inside.max(axis=1) < around.min(axis=1) - limit
        for begin in np.flatnonzero(above | below)[:count] + _BESIDE:
            found[begin : begin + run] = True
    return found
