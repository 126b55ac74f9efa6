"""Which property of a gimbal changed first, and when that is certain."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from analysis.array import Array
from analysis.estimate.recursive import Information, Track

LIMIT = 3.0  # standard deviations of estimate and model together
LASTS = 4  # blocks in a row beyond the limit
FIRST = 16  # blocks before the first verdict
APART = 1.2  # explained by the best property over what the next explains


class Alarm(NamedTuple):
    """Blocks at which a change is certain and at which it began, and the property."""

    at: int
    start: int
    what: int


def first_alarm(
    info: Information, seen: Track, prior: Array, apart: Array, room: Array, begin: int
) -> Alarm | None:
    """The first change that is certain, possible and can be told from the others.

    Parameters
    ----------
    apart : standard deviations of constant differences
    room : from the level to the lowest value of each property, negative
    """
    far = (np.abs(np.maximum(seen.value, room)) / np.hypot(seen.sigma, prior)).max(axis=1)
    beyond = (far > LIMIT).astype(int)
    row = np.convolve(beyond, np.ones(LASTS, int))[: len(beyond)] == LASTS
    for at in np.flatnonzero(row):
        if at < begin + FIRST:
            continue
        gains, starts = _explained(info, prior, apart, room, begin, int(at))
        best, next_best = np.argsort(gains)[::-1][:2]
        if gains[best] > APART * gains[next_best]:
            return Alarm(int(at), int(starts[best]), int(best))
    return None


def _explained(
    info: Information, prior: Array, apart: Array, room: Array, begin: int, at: int
) -> tuple[Array, NDArray[np.int64]]:
    """What a step of each property explains at most, and the first block of that step.

    Beside constant differences of all properties.
    """
    rows = slice(begin, at + 1)
    normal, right = (np.cumsum(v[rows][::-1], axis=0)[::-1] for v in (info.normal, info.right))
    inverse = np.linalg.inv(normal[0] + np.diag(apart**-2.0))
    free = np.einsum("bkk->bk", normal) - np.einsum("bik,ij,bjk->bk", normal, inverse, normal)
    rest = right - normal @ (inverse @ right[0])
    free = np.maximum(free, prior**-2.0)
    step = np.maximum(rest / free, room)
    gain = (2.0 * rest - free * step) * step
    return gain.max(axis=0), begin + gain.argmax(axis=0)
