"""Drift of a gimbal from its model: what changed, since when, and by how much."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from analysis.array import Array
from analysis.estimate.recursive import (
    BLOCK,
    Information,
    Property,
    Track,
    fitted,
    information,
    track,
)

LIMIT = 3.0  # standard deviations of estimate and model together
LASTS = 4  # blocks in a row beyond the limit
AFTER = 16  # blocks after the alarm whose readings still count for the size of the change
FIRST = 16  # blocks before the first verdict
MOST = 6  # changes of one axis
APART = 1.2  # explained by the best property over what the next explains
LEAST = 2.0  # standard deviations of new value and model together; a smaller change is none
SETTLED = 1.0  # s after a command, in which the motion shows the properties
AROUND = 0.5  # s about a change, whose readings belong to neither side
AT_ONCE = 1.0  # s of motion; a change this early was there from the start
REFINED = 2  # Gauss-Newton steps

# motion (n,) of an axis with its properties (k,), and its derivatives by them (n, k)
Model = Callable[[Array], tuple[Array, Array]]


class _Alarm(NamedTuple):
    """Blocks at which a change is certain and at which it began, and the property."""

    at: int
    start: int
    what: int


@dataclass(frozen=True, slots=True)
class Change:
    """One property that left the interval of the model.

    Attributes
    ----------
    axis : `x` or `y`
    what : the property
    since : when it changed; 0 where it differed from the start [s]
    noticed : when that was certain [s]
    before, after : its values
    sigma : standard deviation of the new value, the model's own included
    """

    axis: str
    what: Property
    since: float
    noticed: float
    before: float
    after: float
    sigma: float

    @property
    def text(self) -> str:
        """The change on one line."""
        p = self.what
        half = 1.96 * self.sigma * p.scale
        when = f"since {self.since:.1f} s" if self.since > 0.0 else "from the start"
        old, new = p.text(self.before), p.text(self.after)
        return f"{self.axis}: {p.name} {old} → {new} ± {half:.2f}, {when}"


@dataclass(frozen=True, slots=True)
class AxisDrift:
    """An axis of a run against its model.

    Attributes
    ----------
    track : properties over time, and their standard deviations with the model's own
    changes : in the order they were noticed
    motion : of the model with its properties as they were found [rad] (n,)
    band : half width of its 95 % prediction interval [rad] (n,)
    """

    track: Track
    changes: tuple[Change, ...]
    motion: Array
    band: Array


def drift(
    axis: str,
    time: Array,
    measured: Array,
    model: Model,
    properties: Sequence[Property],
    commanded: Array | None = None,
) -> AxisDrift:
    """Estimate the properties of one axis over time and name those that leave their interval.

    After a change the model moves with the new value, so that the next is noticed beside it.

    Parameters
    ----------
    axis : its name, for the events
    time, measured : readings (n,) [s], [rad]; NaN where there are none
    model : motion at the same times and its derivatives by the properties
    commanded : when the axis's own command changes [s]; all the time where None. The rest of the
        record, where the axis only follows the other one, is left out and nothing is forgotten.

    Raises
    ------
    AnalysisError : a record shorter than ten seconds
    """
    prior = np.array([p.sigma for p in properties])
    lowest = np.array([p.lowest for p in properties])
    level = np.array([p.value for p in properties])
    levels: list[tuple[float, Array]] = [(0.0, level)]
    first, _ = model(level)
    changes: list[Change] = []
    begin = 0
    moving = np.ones(len(time), bool) if commanded is None else _moving(time, commanded)
    while True:
        motion, slope = _pieces(levels, time, model)
        residual = measured - motion
        for since, _ in levels[1:]:
            residual[np.abs(time - since) < AROUND] = np.nan
        info = _within(information(time, residual, slope), time, moving)
        seen = track(info, prior)
        room = lowest - levels[-1][1]
        alarm = _alarm(info, seen, prior, room, begin) if len(changes) < MOST else None
        if alarm is None:
            break
        at, start, k = alarm
        new, sigma = _refined(
            levels[-1][1], k, (start, at), time, measured, model, prior, lowest, moving
        )
        before, after = float(levels[-1][1][k]), float(new[k])
        begin = at
        spread = math.hypot(sigma, prior[k])
        if abs(after - before) < LEAST * spread:
            continue
        since = float(info.time[start]) - BLOCK
        since = 0.0 if since - (info.time[0] - BLOCK) <= AT_ONCE else since
        noticed = float(info.time[at])
        changes.append(Change(axis, properties[k], since, noticed, before, after, spread))
        levels.append((since, new))
    band = 1.96 * np.sqrt((slope**2) @ prior**2 + info.noise**2)
    shown = _shown(seen, prior, time)
    shown = replace(
        shown,
        value=np.maximum(shown.value + _held(levels, shown.time), lowest),
        sigma=np.hypot(shown.sigma, prior),
    )
    return AxisDrift(shown, tuple(changes), first, band)


def _moving(time: Array, commanded: Array) -> NDArray[np.bool_]:
    """Readings that follow a change of the command within `SETTLED`."""
    last = np.searchsorted(commanded, time, side="right") - 1
    return (last >= 0) & (time - commanded[np.maximum(last, 0)] <= SETTLED)


def _within(info: Information, time: Array, moving: NDArray[np.bool_]) -> Information:
    """Blocks at whose ends the axis moves."""
    rows = moving[np.minimum(np.searchsorted(time, info.time), len(time) - 1)]
    if not rows.any():
        return info
    return replace(info, time=info.time[rows], normal=info.normal[rows], right=info.right[rows])


def _shown(seen: Track, prior: Array, time: Array) -> Track:
    """Estimate after every block of the record: between motions the last one."""
    count = math.floor((time[-1] - time[0]) / BLOCK)
    ends = time[0] + BLOCK * (np.arange(count) + 1.0)
    at = np.searchsorted(seen.time, ends + 1e-9)
    value = np.vstack([np.zeros_like(prior), seen.value])
    return Track(ends, value[at], np.vstack([prior, seen.sigma])[at])


def _pieces(
    levels: Sequence[tuple[float, Array]], time: Array, model: Model
) -> tuple[Array, Array]:
    """Motion and derivatives with the properties in force at each time."""
    motion, slope = (v.copy() for v in model(levels[0][1]))
    for since, level in levels[1:]:
        rows = time >= since
        later, steeper = model(level)
        motion[rows], slope[rows] = later[rows], steeper[rows]
    return motion, slope


def _held(levels: Sequence[tuple[float, Array]], time: Array) -> Array:
    """Properties in force at times (n, k)."""
    at = np.searchsorted([since for since, _ in levels], time, side="right") - 1
    return np.array([level for _, level in levels])[np.maximum(at, 0)]


def _alarm(info: Information, seen: Track, prior: Array, room: Array, begin: int) -> _Alarm | None:
    """The first change that is certain, possible and can be told from the others.

    Parameters
    ----------
    room : from the level to the lowest value of each property, negative
    """
    far = (np.abs(np.maximum(seen.value, room)) / np.hypot(seen.sigma, prior)).max(axis=1)
    beyond = (far > LIMIT).astype(int)
    row = np.convolve(beyond, np.ones(LASTS, int))[: len(beyond)] == LASTS
    for at in np.flatnonzero(row):
        if at < begin + FIRST:
            continue
        gains, starts = _explained(info, prior, room, begin, int(at))
        best, next_best = np.argsort(gains)[::-1][:2]
        if gains[best] > APART * gains[next_best]:
            return _Alarm(int(at), int(starts[best]), int(best))
    return None


def _explained(
    info: Information, prior: Array, room: Array, begin: int, at: int
) -> tuple[Array, NDArray[np.int64]]:
    """What a step of each property explains at most, and the first block of that step.

    Beside constant differences of all properties that the model's intervals allow.
    """
    rows = slice(begin, at + 1)
    normal, right = (np.cumsum(v[rows][::-1], axis=0)[::-1] for v in (info.normal, info.right))
    inverse = np.linalg.inv(normal[0] + np.diag(prior**-2.0))
    free = np.einsum("bkk->bk", normal) - np.einsum("bik,ij,bjk->bk", normal, inverse, normal)
    rest = right - normal @ (inverse @ right[0])
    free = np.maximum(free, prior**-2.0)
    step = np.maximum(rest / free, room)
    gain = (2.0 * rest - free * step) * step
    return gain.max(axis=0), begin + gain.argmax(axis=0)


def _refined(
    level: Array,
    k: int,
    blocks: tuple[int, int],
    time: Array,
    measured: Array,
    model: Model,
    prior: Array,
    lowest: Array,
    moving: NDArray[np.bool_],
) -> tuple[Array, float]:
    """Properties with the changed one corrected, and the standard deviation of that."""
    rows = slice(blocks[0] + round(AROUND / BLOCK), blocks[1] + 1 + AFTER)
    new, sigma = level.copy(), 0.0
    free = prior.copy()
    free[k] *= 100.0  # the model says nothing about a changed one
    for _ in range(REFINED):
        motion, slope = model(new)
        info = _within(information(time, measured - motion, slope), time, moving)
        step, sigmas = fitted(info, rows, free)
        new = new.copy()
        new[k] = max(new[k] + step[k], lowest[k])
        sigma = float(sigmas[k])
    return new, sigma
