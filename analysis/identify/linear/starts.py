"""Where to begin: many starts judged on a part of the samples, the best few followed down.

Every command's channel is searched by itself, on what the others leave: a start for all channels
together would have to hit all their delays at once.
"""

from collections.abc import Mapping
from dataclasses import replace
from itertools import product

import numpy as np

from analysis.array import Array
from analysis.identify.linear import srivc
from analysis.identify.linear.descent import bounds, descend, period, scales, span
from analysis.identify.problem.problem import Problem

ROWS = 6000  # samples a descent from a start sees
_JUDGED_ROWS = 2000  # samples the starts are judged on
_GUESSED_ROWS = 600  # samples that the strongest command is chosen on
_FOLLOWED = 3
_DELAYS = 13
_TURNS = 8
_FINE = 1e-6  # relative loss that a further turn must save
_ROUGH = 1e-4  # relative loss at which a descent that is only a start may stop
_AROUND = (np.linspace(-1.5, 1.5, 13), np.linspace(-0.2, 0.2, 9))  # sampling periods


def best_start(problem: Problem, max_delay: float) -> Array:
    """θ near the lowest minimum."""
    small = thinned(problem, ROWS)
    if problem.layout.inputs == 1:
        return one_channel(small, max_delay)
    return follow(small, joined(small, by_channel(small, max_delay)[0]), max_delay)


def by_channel(problem: Problem, max_delay: float) -> tuple[list[Array], dict[int, Array]]:
    """θ of each channel, the strongest first, on what those before it leave; and their motions."""
    thetas: dict[int, Array] = {}
    driven: dict[int, Array] = {}
    while len(thetas) < problem.layout.inputs:
        waiting = [j for j in range(problem.layout.inputs) if j not in thetas]
        left = {j: alone(problem, j, driven, problem.layout.zeros_of(j)) for j in waiting}
        j = waiting[0]
        if len(waiting) > 1:
            j = min(left, key=lambda k: _least_guess(left[k], max_delay))
        thetas[j] = one_channel(left[j], max_delay)
        driven[j] = response(left[j], thetas[j])
    return [thetas[j] for j in range(problem.layout.inputs)], driven


def alone(problem: Problem, j: int, driven: Mapping[int, Array], zeros: int) -> Problem:
    """The problem of one command on what the other commands' motions leave."""
    left = problem.measured - sum(d for k, d in driven.items() if k != j)
    return replace(problem.channels((j,), (zeros,)), measured=np.asarray(left))


def response(problem: Problem, theta: Array) -> Array:
    """What the commands make of every row at θ (rows,)."""
    return problem.driven(theta, problem.solve(theta).linear)


def one_channel(problem: Problem, max_delay: float) -> Array:
    """θ near the lowest minimum of a problem of one command."""
    few = thinned(problem, _JUDGED_ROWS)
    low, high = bounds(few, max_delay)
    starts = [np.clip(s, low, high) for s in _all_starts(few, max_delay)]
    ranked = sorted((few.loss(s), i) for i, s in enumerate(starts))
    chosen: list[Array] = []
    for _, i in ranked:
        if len(chosen) < _FOLLOWED and all(_differ(few, starts[i], c) for c in chosen):
            chosen.append(starts[i])
    return min((follow(problem, s, max_delay) for s in chosen), key=problem.loss)


def along_delay(problem: Problem, poles: Array, max_delay: float) -> Array:
    """θ near the lowest minimum of a problem of one command whose poles are known.

    With the poles held the loss over the delay has few minima: each is followed once.
    """
    few = thinned(problem, _JUDGED_ROWS)
    low, high = bounds(few, max_delay)
    delays = _delays(few, max_delay, 2 * _DELAYS - 1)
    starts = [np.clip(srivc.whole_theta(few, poles, float(d)), low, high) for d in delays]
    losses = np.array([few.loss(s) for s in starts])
    padded = np.pad(losses, 1, constant_values=np.inf)
    valleys = np.flatnonzero((losses <= padded[:-2]) & (losses < padded[2:]))
    best = sorted(valleys, key=lambda i: float(losses[i]))[:_FOLLOWED]
    return min((follow(problem, starts[i], max_delay) for i in best), key=problem.loss)


def follow(problem: Problem, theta: Array, max_delay: float) -> Array:
    """Descend from θ, across the stairs that a jumping rate makes of the loss over the delay."""
    theta = descend(problem, theta, max_delay, 25, _ROUGH)[0]
    if not jumps(problem):
        return theta
    for _ in range(3):
        across = _across_stairs(problem, theta, max_delay)
        if across is theta:
            break
        theta = descend(problem, across, max_delay, 25, _ROUGH)[0]
    return theta


def follow_closely(problem: Problem, theta: Array, max_delay: float) -> Array:
    """`follow` to the bottom, with the delays of jumping channels held and searched in turns.

    Where commands change at every other reading the stairs are so fine that a descent over all
    parameters comes to rest on any of them; with the delays held the loss is smooth.
    """
    for _ in range(_TURNS):
        before = problem.loss(theta)
        theta = descend(problem, theta, max_delay, 25, _FINE)[0]
        theta = _across_stairs(problem, theta, max_delay)
        theta = _with_held_delays(problem, theta, max_delay)
        if problem.loss(theta) > before * (1.0 - _FINE):
            break
    return theta


def _with_held_delays(problem: Problem, theta: Array, max_delay: float) -> Array:
    layout = problem.layout
    held = [j for j in layout.free_delays if layout.zeros_of(j) == layout.poles - 1]
    places = [layout.delay_place(j) for j in held]
    delays = tuple(
        layout.delay(theta, j) if j in held else layout.delays[j] for j in range(layout.inputs)
    )
    smooth = problem.with_layout(replace(layout, delays=delays))
    found = descend(smooth, np.delete(theta, places), max_delay, 25, _FINE)[0]
    moving = np.ones(len(theta), dtype=bool)
    moving[places] = False
    end = theta.copy()
    end[moving] = found
    return end if problem.loss(end) < problem.loss(theta) else theta


def jumps(problem: Problem) -> bool:
    """Whether the rate of some channel of free delay jumps with its command."""
    layout = problem.layout
    fast = any(layout.zeros_of(j) == layout.poles - 1 for j in layout.free_delays)
    return fast and bool((problem.is_rate & (problem.weight > 0.0)).any())


def _across_stairs(problem: Problem, theta: Array, max_delay: float) -> Array:
    """θ with the best delay of each jumping channel within some sampling periods of where it is."""
    layout = problem.layout
    low, high = bounds(problem, max_delay)
    best, least = theta, problem.loss(theta) * (1.0 - 1e-6)
    for j in layout.free_delays:
        if layout.zeros_of(j) != layout.poles - 1:
            continue
        place = layout.delay_place(j)
        for around in _AROUND:
            centre = best
            for by in around * period(problem):
                trial = centre.copy()
                trial[place] = np.clip(centre[place] + by, low[place], high[place])
                if (loss := problem.loss(trial)) < least:
                    best, least = trial, loss
    return best


def joined(problem: Problem, thetas: list[Array]) -> Array:
    """θ of all channels from those of each; a shared denominator is that of the strongest."""
    layout = problem.layout
    free = [t[layout.poles :] for t in thetas]
    if layout.own:
        return np.concatenate([*(t[: layout.poles] for t in thetas), *free])
    trials = [np.concatenate([t[: layout.poles], *free]) for t in thetas]
    return min(trials, key=problem.loss)


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
        offsets=problem.offsets[kept],
        cache={},
    )


def _all_starts(problem: Problem, max_delay: float) -> list[Array]:
    """A grid of plain sections or, of higher orders, what the instruments find."""
    delays = _delays(problem, max_delay)
    cutoffs = _cutoffs(problem)
    if problem.layout.poles > 2:
        return list(srivc.candidates(problem, delays, cutoffs))
    speeds = np.geomspace(cutoffs[0] / 2.0, cutoffs[-1], 8)
    if problem.layout.poles == 1:
        sections = [np.array([np.log(s)]) for s in speeds]
    else:
        dampings = (0.25, 0.8)
        sections = [np.log([2.0 * z * s, s**2]) for s, z in product(speeds, dampings)]
    return [srivc.whole_theta(problem, s, float(d)) for s, d in product(sections, delays)]


def _delays(problem: Problem, max_delay: float, count: int = _DELAYS) -> Array:
    free = bool(problem.layout.free_delays)
    return np.linspace(0.0, 0.9 * max_delay, count) if free else np.zeros(1)


def _least_guess(problem: Problem, max_delay: float) -> float:
    """Least loss of a few plain starts: how much of the readings a command can explain."""
    few = thinned(problem.channels((0,), (0,)), _GUESSED_ROWS)
    one = replace(few, layout=replace(few.layout, poles=1))
    return min(one.loss(s) for s in _all_starts(one, max_delay))


def _cutoffs(problem: Problem) -> Array:
    """Cut-offs from the pace of the record to that of the samples [rad/s]."""
    fast = 1.0 / period(problem)
    return np.geomspace(max(4.0 / span(problem), fast / 100.0), fast, 4)


def _differ(problem: Problem, a: Array, b: Array) -> bool:
    return bool((np.abs(a - b) > scales(problem)).any())
