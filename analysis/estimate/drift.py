"""Drift of a gimbal during a run: what changed, since when, and by how much.

A gimbal is compared with its model where it is within the model's intervals at first, and with its
own beginning where it is not. What the model cannot follow widens the intervals.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from analysis.array import Array
from analysis.estimate.alarm import LIMIT, first_alarm
from analysis.estimate.recursive import (
    BLOCK,
    Information,
    Property,
    Track,
    fitted,
    information,
    scatter,
    track,
)

AFTER = 16  # blocks after the alarm whose readings still count for the size of the change
BEGINNING = 20  # blocks of motion that show how a gimbal differs from its model from the start
UNFITTED = 10.0  # times the model's interval that a gimbal which it was not fitted to may differ
MOST = 6  # changes of one axis
LEAST = 2.0  # standard deviations of new value and model together; a smaller change is none
SETTLED = 1.0  # s after a command, in which the motion shows the properties
AROUND = 0.5  # s about a change, whose readings belong to neither side
REFINED = 2  # Gauss-Newton steps

# motion (n,) of an axis with its properties (k,), and its derivatives by them (n, k)
Model = Callable[[Array], tuple[Array, Array]]


@dataclass(frozen=True, slots=True)
class Change:
    """One property that changed during a run.

    Attributes
    ----------
    axis : `x` or `y`
    what : the property
    since : when it changed [s]
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
        old, new = p.text(self.before), p.text(self.after)
        return f"{self.axis}: {p.name} {old} → {new} ± {half:.2f}, since {self.since:.1f} s"


@dataclass(frozen=True, slots=True)
class AxisDrift:
    """An axis of a run against its model.

    Attributes
    ----------
    track : properties over time, and their standard deviations with the model's own
    changes : in the order they were noticed
    motion : of the model with its properties as they were found [rad] (n,)
    band : half width of its 95 % prediction interval [rad] (n,)
    differs : properties outside the model's intervals from the start, one line each
    """

    track: Track
    changes: tuple[Change, ...]
    motion: Array
    band: Array
    differs: tuple[str, ...] = ()


def drift(
    axis: str,
    time: Array,
    measured: Array,
    model: Model,
    properties: Sequence[Property],
    commanded: Array | None = None,
) -> AxisDrift:
    """Estimate the properties of one axis over time and name those that change during the run.

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
    given = _Given(
        time, measured, model, properties,
        np.ones(len(time), bool) if commanded is None else _moving(time, commanded),
    )  # fmt: skip
    prior, lowest = given.prior, given.lowest
    level = np.array([p.value for p in properties])
    first, _ = model(level)
    start, spreads = given.beginning(level)
    # a model that was not fitted allows constant differences of any size
    apart = prior if np.array_equal(start, level) else UNFITTED * prior
    levels: list[tuple[float, Array]] = [(0.0, start)]
    changes: list[Change] = []
    begin = 0
    while True:
        info, slope = given.beside(levels)
        seen = track(info, prior)
        room = lowest - levels[-1][1]
        alarm = first_alarm(info, seen, prior, apart, room, begin) if len(changes) < MOST else None
        if alarm is None:
            break
        at, begun, k = alarm
        rows = slice(begun + round(AROUND / BLOCK), at + 1 + AFTER)
        new, sigma = given.refined(levels[-1][1], [k], rows)
        before, after = float(levels[-1][1][k]), float(new[k])
        begin = at
        spread = math.hypot(float(sigma[k]), prior[k])
        if abs(after - before) < LEAST * spread:
            continue
        since, noticed = float(info.time[begun]) - BLOCK, float(info.time[at])
        changes.append(Change(axis, properties[k], since, noticed, before, after, spread))
        levels.append((since, new))
    band = 1.96 * np.sqrt((slope**2) @ prior**2 + info.noise**2)
    shown, bias = _shown(seen, prior, time), np.array([p.bias for p in properties])
    shown = replace(
        shown,
        value=np.maximum(shown.value + _held(levels, shown.time), lowest),
        sigma=np.hypot(np.hypot(shown.sigma, prior), bias),
    )
    spreads = np.hypot(spreads, bias)
    differs = tuple(
        f"{axis}: {p.name} {p.text(v)} ± {1.96 * s * p.scale:.2f} ({p.text(p.value)} in the model)"
        for p, v, s in zip(properties, start.tolist(), spreads.tolist(), strict=True)
        if abs(v - p.value) > LIMIT * s
    )
    return AxisDrift(shown, tuple(changes), first, band, differs)


class _Given:
    """Readings of one axis and its model; parameters as of `drift`."""

    def __init__(
        self,
        time: Array,
        measured: Array,
        model: Model,
        properties: Sequence[Property],
        moving: NDArray[np.bool_],
    ) -> None:
        self._time, self._measured, self._model, self._moving = time, measured, model, moving
        self.prior = np.array([p.sigma for p in properties])
        self.lowest = np.array([p.lowest for p in properties])

    def beginning(self, level: Array) -> tuple[Array, Array]:
        """Properties at the beginning of the run, and their standard deviations with the model's.

        They are the model's where the readings are within its intervals.
        """
        rows = slice(0, BEGINNING)
        info, _ = self.beside([(0.0, level)])
        value, sigma = fitted(info, rows, UNFITTED * self.prior)
        if np.any(np.abs(value) > LIMIT * np.hypot(sigma, self.prior)):
            level, sigma = self.refined(level, range(len(level)), rows)
        return level, np.hypot(sigma, self.prior)

    def beside(self, levels: Sequence[tuple[float, Array]]) -> tuple[Information, Array]:
        """What the readings show beside the properties in force, and the derivatives (n, k)."""
        motion, slope = _pieces(levels, self._time, self._model)
        residual = self._measured - motion
        for since, _ in levels[1:]:
            residual[np.abs(self._time - since) < AROUND] = np.nan
        info = _within(information(self._time, residual, slope), self._time, self._moving)
        return info.widened(scatter(info, UNFITTED * self.prior)), slope

    def refined(self, level: Array, free: Sequence[int], rows: slice) -> tuple[Array, Array]:
        """Properties with the free ones fitted to some blocks, and their standard deviations."""
        new, sigma = level.copy(), self.prior
        columns = list(free)
        prior = self.prior.copy()
        prior[columns] *= 100.0 if len(columns) == 1 else UNFITTED
        for _ in range(REFINED):
            info, _ = self.beside([(0.0, new)])
            step, sigma = fitted(info, rows, prior)
            new = new.copy()
            new[columns] = np.maximum(new[columns] + step[columns], self.lowest[columns])
        return new, sigma


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
