"""Where to begin: many starts judged on a part of the samples, the best few followed down."""

from dataclasses import replace

import numpy as np

from analysis.array import Array
from analysis.identify import srivc
from analysis.identify.descent import bounds, descend, period, scales, span
from analysis.identify.problem import Problem

_ROWS = 6000  # samples the starts are judged on
_INSTRUMENT_ROWS = 3000  # samples the instruments see
_FOLLOWED = 3
_DELAYS = 13
_REWEIGHTINGS = 3


def best_start(problem: Problem, max_delay: float, *, robust: bool = False) -> Array:
    """θ near the lowest minimum; with `robust`, of a loss that a few spikes cannot rule."""
    small = thinned(problem, _ROWS)
    shared = small.with_layout(replace(small.layout, own=False))
    low, high = bounds(shared, max_delay)
    starts = [np.clip(s, low, high) for s in _all_starts(shared, max_delay)]
    ranked = sorted((_judge(shared, s, robust), i) for i, s in enumerate(starts))
    chosen: list[Array] = []
    for _, i in ranked:
        if len(chosen) < _FOLLOWED and all(_differ(shared, starts[i], c) for c in chosen):
            chosen.append(starts[i])
    ended = [follow(shared, s, max_delay, robust=robust) for s in chosen]
    best = min(ended, key=lambda t: _judge(shared, t, robust))
    if not (problem.layout.own and problem.layout.inputs > 1):
        return best
    poles = problem.layout.poles
    own = np.concatenate([np.tile(best[:poles], problem.layout.groups), best[poles:]])
    return follow(small, own, max_delay, robust=robust)


def follow(problem: Problem, theta: Array, max_delay: float, *, robust: bool) -> Array:
    """Descend from θ; with `robust`, in turns with weights that shrink far readings (Cauchy)."""
    if not robust:
        return descend(problem, theta, max_delay, 25)[0]
    for _ in range(8):
        theta, _ = descend(_shrunk(problem, theta), theta, max_delay, 10)
    return theta


def thinned(problem: Problem, rows: int) -> Problem:
    """Every k-th reading of each sensor; the exact simulation needs no even spacing."""
    stride = int(np.ceil(len(problem.measured) / rows))
    if stride == 1:
        return problem
    parts, angles, rates = [], [], []
    for part in problem.parts:
        # by sensor: of two that are read in turn, every second stamp is one sensor alone
        chosen = np.zeros(len(part.time), dtype=bool)
        for own in (part.angle_rows, part.rate_rows):
            chosen[own[::stride]] = True
        number = np.cumsum(chosen) - 1
        angle, rate = chosen[part.angle_rows], chosen[part.rate_rows]
        angle_rows, rate_rows = number[part.angle_rows[angle]], number[part.rate_rows[rate]]
        parts.append(
            replace(part, time=part.time[chosen], angle_rows=angle_rows, rate_rows=rate_rows)
        )
        angles.append(angle)
        rates.append(rate)
    kept = np.concatenate(angles + rates)
    return replace(
        problem,
        parts=tuple(parts),
        measured=problem.measured[kept],
        is_rate=problem.is_rate[kept],
        owner=problem.owner[kept],
        time=problem.time[kept],
        weight=problem.weight[kept],
        cache={},
    )


def _all_starts(problem: Problem, max_delay: float) -> list[Array]:
    free = bool(problem.layout.free_delays)
    delays = np.linspace(0.0, 0.9 * max_delay, _DELAYS) if free else np.zeros(1)
    cutoffs = _cutoffs(problem)
    guesses = _guesses(problem, delays[::2], cutoffs)
    few = thinned(problem, _INSTRUMENT_ROWS)
    return [*srivc.candidates(few, delays[:: 2 if guesses else 1], cutoffs), *guesses]


def _cutoffs(problem: Problem) -> Array:
    """Cut-offs from the pace of the record to that of the samples [rad/s]."""
    fast = 1.0 / period(problem)
    return np.geomspace(max(4.0 / span(problem), fast / 100.0), fast, 4)


def _guesses(problem: Problem, delays: Array, cutoffs: Array) -> list[Array]:
    """Plain sections over the grid, for where instruments fail."""
    poles = problem.layout.poles
    if poles > 2:
        return []
    found = []
    for speed in np.geomspace(cutoffs[0] / 2.0, cutoffs[-1], 7):
        section = [np.log(1.4 * speed), np.log(speed**2)] if poles == 2 else [np.log(speed)]
        found += [srivc.whole_theta(problem, np.array(section), float(d)) for d in delays]
    return found


def _judge(problem: Problem, theta: Array, robust: bool) -> float:
    fitted = problem
    for _ in range(_REWEIGHTINGS if robust else 0):
        fitted = _shrunk(problem, theta, fitted)
    weighted = fitted.solve(theta).residual * problem.weight
    return float(np.log1p(weighted**2 / 2.0).sum()) if np.isfinite(weighted).all() else np.inf


def _shrunk(problem: Problem, theta: Array, fitted: Problem | None = None) -> Problem:
    """The problem with far readings weighing less, as seen from the fit at θ."""
    weighted = (fitted or problem).solve(theta).residual * problem.weight
    return problem.weighed(problem.weight / np.sqrt(1.0 + weighted**2 / 2.0))


def _differ(problem: Problem, a: Array, b: Array) -> bool:
    return bool((np.abs(a - b) > scales(problem)).any())
