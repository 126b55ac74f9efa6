"""A bounded servo in a second: what it takes to see what a record says of the bounds."""

import numpy as np
from numpy.typing import NDArray

from analysis.array import Array
from analysis.identify.linear.starts import thinned
from analysis.identify.problem.noise import from_differences, quantisation, weights
from analysis.identify.problem.problem import Problem
from analysis.identify.problem.segments import series_of, step_folds
from analysis.identify.problem.spikes import gross
from analysis.identify.servo.dead_band import static_dead_band
from analysis.identify.servo.descent import (
    descend,
    fit_at,
    in_units,
    loss_of,
    prepared,
    project,
    settled,
)
from analysis.identify.servo.fit import ServoFit
from analysis.identify.servo.reached import without_idle_limits
from analysis.identify.servo.starts import (
    fastest,
    grid_of_starts,
    limits,
    reverses,
    scales,
    with_values,
)

_FOLLOWED = 2
_ROWS = 1500  # readings the search sees; derivatives and residual are those of all
_FOLDS = 4
_STEPS = (1.0, 0.5, 0.0)  # of a Gauss-Newton step: the best is taken
_WORTH = 0.97  # of the held-out loss: what dead band or backlash must save

Free = NDArray[np.intp]


def short_search(
    problem: Problem, axis: int, section: Array, delay: float, *, max_delay: float
) -> ServoFit:
    """The best of a few short searches of a `speed` servo.

    Parameters
    ----------
    section, delay : denominator and delay of a linear fit, where a search may begin
    """
    kept = np.ones(len(problem.measured), dtype=bool)
    floor = quantisation(problem)
    kept = ~gross(problem, from_differences(problem, kept, floor), kept)
    problem, alike, unit = prepared(problem, axis, kept, floor)
    few = thinned(alike, _ROWS)
    n = few.layout.poles
    linear = [*section, max(delay, 0.0)]
    begins = [np.array([*linear, np.log(x * fastest(few)), 0.0, 0.0]) for x in (0.8, 1.1)]
    begins += grid_of_starts(few, max_delay, "speed")
    turns = reverses(few, axis)
    static, least = static_dead_band(alike, axis), scales(few, "speed")[n + 2 : n + 4]
    shares = [np.maximum(static * np.array(s), least) for s in ((1.0, 0.0), (0.5, 1.0))]
    begins = [with_values(b, [n + 2, n + 3], s * [1.0, turns]) for b in begins for s in shares]
    begins = sorted(begins, key=lambda b: loss_of(few, axis, "speed", b))[:_FOLLOWED]
    every = np.arange(n + 4 if turns else n + 3)
    ended = [descend(few, axis, "speed", b, max_delay, every)[0] for b in begins]
    theta = min(ended, key=lambda e: loss_of(few, axis, "speed", e))
    free, theta = _worth_having(few, axis, theta, every, static, max_delay)
    counted = few.weight > 0.0
    found = settled(few, axis, "speed", theta, free, max_delay, counted, floor)
    whole = alike.weighed(weights(alike, found.noise, kept))
    fit = fit_at(whole, axis, "speed", found.theta, found.noise, found.converged)
    return in_units(without_idle_limits(fit, axis, max_delay), problem, unit)


def _worth_having(
    problem: Problem, axis: int, theta: Array, every: Free, static: float, max_delay: float
) -> tuple[Free, Array]:
    """Which parameters to free, and where they end: dead band and backlash if they predict steps.

    The evidence of the whole fit (`servo`), but every fold is left out by a Gauss-Newton step.
    """
    n = problem.layout.poles
    tight, more = every[: n + 2], every[n + 2 :]
    choices = [(tight, with_values(theta, [n + 2, n + 3], np.array([static, 0.0])))]
    for k in more:
        rest = [m for m in (n + 2, n + 3) if m != k]
        choices.append((np.append(tight, k), with_values(theta, rest, np.zeros(1))))
    if len(more) > 1:
        choices.append((every, theta))
    ends, losses = [], []
    for free, begin in choices:
        end = descend(problem, axis, "speed", begin, max_delay, free)[0]
        ends.append((free, end))
        losses.append(_held_out(problem, axis, end, free, max_delay))
    best = int(np.argmin(losses))
    return ends[best if losses[best] < _WORTH * losses[0] else 0]


def _held_out(problem: Problem, axis: int, theta: Array, free: Free, max_delay: float) -> float:
    """Weighted squares of every fold's residual without it, around each record's own offset."""
    fit = fit_at(problem, axis, "speed", theta, (np.nan, np.nan), True)
    columns = np.append(free, np.arange(len(theta), fit.jacobian.shape[1]))
    low, high = limits(problem, max_delay, "speed")
    series, total = series_of(problem), 0.0
    for fold in step_folds(problem, axis, _FOLDS):
        slope, left = fit.jacobian[~fold][:, columns], fit.weighted[~fold]
        move = np.linalg.lstsq(slope, left, rcond=1e-10)[0][: len(free)]
        training = problem.weighed(np.where(fold, 0.0, problem.weight))
        tried = [with_values(theta, list(free), theta[free] + x * move) for x in _STEPS]
        solved = [project(training, axis, "speed", np.clip(t, low, high)) for t in tried]
        _, _, residual = min(solved, key=lambda s: float(s[0] @ s[0]))
        weighted = residual * problem.weight
        own = [weighted[rows[fold[rows]]] for rows in series]
        total += float(sum(np.sum((e - e.mean()) ** 2) for e in own if len(e)))
    return total
