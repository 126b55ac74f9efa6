"""The search: starts, damped least squares, each sensor weighed by its own noise, spikes set aside."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from analysis.identify import srivc
from analysis.identify.problem import Layout, Part, Problem, Solution

Array = NDArray[np.float64]

_ROUNDS = 5  # of noise estimation; two or three settle it to a percent
_START_ROWS = 6000  # samples the starts are judged on
_STARTS = 4  # that are followed to the bottom
_SPIKE = 6.0  # sigma; one Gaussian reading in 5e8 lies beyond
_SPIKE_RUN = 3  # readings: a longer run is motion the model lacks, not a spike
_SPIKE_SHARE = 0.02  # of all readings
_NORMAL = 1.4826  # sigma per median absolute deviation of a Gaussian


@dataclass(frozen=True, slots=True)
class AxisFit:
    """The model of one axis as found.

    Attributes
    ----------
    problem : with the final weights
    solution : at the minimum
    noise : standard deviation of angle [rad] and rate [rad/s] readings, NaN where not measured
    spikes : readings set aside (rows,)
    kept : readings the fit was allowed to see (rows,)
    converged : the search ended at a minimum
    """

    problem: Problem
    solution: Solution
    noise: tuple[float, float]
    spikes: NDArray[np.bool_]
    kept: NDArray[np.bool_]
    converged: bool


def resolution(values: Array) -> float:
    """Step of a quantised signal, 0 if it is not visibly quantised."""
    levels = np.unique(values)
    if len(levels) < 2 or len(levels) > len(values) / 3:
        return 0.0
    gaps = np.diff(levels)
    return float(np.median(gaps[gaps > 1e-3 * gaps.max()]))


def search(
    problem: Problem, *, max_delay: float, start: Array | None = None, keep: Array | None = None
) -> AxisFit:
    """Fit one axis; readings outside `keep` (rows,) do not count."""
    kept = np.ones(len(problem.measured), dtype=bool) if keep is None else keep.astype(bool)
    floor = _noise_floor(problem)
    guess = _first_noise(problem, kept, floor)
    problem = problem.weighed(_weights(problem, guess, kept))
    theta = _best_start(problem, max_delay) if start is None else start
    if problem.layout.own and problem.layout.inputs > 1 and start is None:
        theta = _freed(problem, theta, max_delay)
    fit = _settle(problem, theta, kept, floor, max_delay)
    spikes = _spikes(fit, floor)
    if not spikes.any():
        return fit
    return _without_spikes(fit, floor, max_delay)


def descend(
    problem: Problem, theta: Array, max_delay: float, evaluations: int
) -> tuple[Array, bool]:
    """Follow the loss down from θ; returns where it ended and whether that is a minimum."""
    from scipy.optimize import least_squares

    low, high = bounds(problem, max_delay)
    found = least_squares(
        lambda t: problem.solve(t).weighted,
        np.clip(theta, low + 1e-9, high - 1e-9),
        jac=lambda t: problem.solve(t).projected,
        bounds=(low, high),
        x_scale=_scales(problem),
        max_nfev=evaluations,
        ftol=1e-10,
        xtol=1e-9,
        gtol=1e-12,
    )
    return np.asarray(found.x), bool(found.status > 0)


def bounds(problem: Problem, max_delay: float) -> tuple[Array, Array]:
    """Slowest and fastest section the samples can tell, and the range of delays."""
    layout = problem.layout
    span = max(p.time[-1] - p.time[0] for p in problem.parts)
    period = min(float(np.median(np.diff(p.time))) for p in problem.parts)
    slow, fast = 0.05 / span, 60.0 / period
    pairs = layout.poles // 2
    low = np.tile(np.log([1e-4 * slow, slow**2]), pairs)
    high = np.tile(np.log([2e2 * fast, fast**2]), pairs)
    if layout.poles % 2:
        low, high = np.append(low, np.log(slow)), np.append(high, np.log(fast))
    free = len(layout.free_delays)
    return (
        np.concatenate([np.tile(low, layout.groups), np.full(free, -1e-6)]),
        np.concatenate([np.tile(high, layout.groups), np.full(free, max_delay)]),
    )


def _scales(problem: Problem) -> Array:
    layout = problem.layout
    period = min(float(np.median(np.diff(p.time))) for p in problem.parts)
    return np.concatenate(
        [np.full(layout.groups * layout.poles, 0.3), np.full(len(layout.free_delays), period)]
    )


def _settle(
    problem: Problem,
    theta: Array,
    kept: NDArray[np.bool_],
    floor: tuple[float, float],
    max_delay: float,
) -> AxisFit:
    """Descend and estimate the noise in turns until the noise stays."""
    noise, converged = (np.nan, np.nan), False
    counted = problem.weight > 0.0
    for _ in range(_ROUNDS):
        theta, converged = descend(problem, theta, max_delay, 60)
        solution = problem.solve(theta)
        last, noise = noise, _noise(problem, solution, counted, floor)
        problem = problem.weighed(_weights(problem, noise, counted))
        change = [abs(a / b - 1.0) for a, b in zip(noise, last, strict=True) if np.isfinite(a)]
        if np.isfinite(change).all() and max(change) < 0.01:
            break
    solution = problem.solve(theta)
    return AxisFit(problem, solution, noise, np.zeros(len(kept), dtype=bool), kept, converged)


def _noise(
    problem: Problem, solution: Solution, counted: NDArray[np.bool_], floor: tuple[float, float]
) -> tuple[float, float]:
    """Root mean square of each sensor's residual, corrected for the parameters it paid for."""
    total = counted.sum()
    share = (len(solution.theta) + len(solution.linear)) / total
    both = []
    for is_rate in (False, True):
        rows = counted & (problem.is_rate == is_rate)
        if not rows.any():
            both.append(np.nan)
            continue
        power = float(np.mean(solution.residual[rows] ** 2)) / max(1.0 - share, 0.1)
        both.append(max(float(np.sqrt(power)), floor[int(is_rate)], 1e-12))
    return both[0], both[1]


def _weights(problem: Problem, noise: tuple[float, float], counted: NDArray[np.bool_]) -> Array:
    sigma = np.where(problem.is_rate, noise[1], noise[0])
    return np.where(counted, 1.0 / sigma, 0.0)


def _noise_floor(problem: Problem) -> tuple[float, float]:
    """Quantisation noise of each sensor: its step over √12, halved where dither may average it."""
    both = []
    for is_rate in (False, True):
        values = problem.measured[problem.is_rate == is_rate]
        both.append(resolution(values) / np.sqrt(12.0) / 2.0 if len(values) else 0.0)
    return both[0], both[1]


def _first_noise(
    problem: Problem, kept: NDArray[np.bool_], floor: tuple[float, float]
) -> tuple[float, float]:
    """Noise of each sensor from its second differences: too large where the motion is fast."""
    both = []
    for is_rate in (False, True):
        found = []
        for index in range(len(problem.parts)):
            rows = kept & (problem.is_rate == is_rate) & (problem.owner == index)
            if rows.sum() > 4:
                bend = np.diff(problem.measured[rows], 2) / np.sqrt(6.0)
                found.append(float(np.sqrt(np.mean(np.clip(bend**2, 0.0, _cap(bend))))))
        values = problem.measured[kept & (problem.is_rate == is_rate)]
        least = 1e-6 * float(np.ptp(values)) if len(values) else 0.0
        both.append(max(float(np.median(found)), floor[int(is_rate)], least) if found else np.nan)
    return both[0], both[1]


def _cap(bend: Array) -> float:
    return float((5.0 * max(_NORMAL * np.median(np.abs(bend)), 0.2 * np.std(bend))) ** 2)


def _best_start(problem: Problem, max_delay: float) -> Array:
    """Judge many starts on a part of the samples, follow the best few down, keep the lowest."""
    small = _shared_denominator(_thinned(problem, _START_ROWS))
    delays, cutoffs = _delays(small, max_delay), _cutoffs(small)
    starts = [*srivc.candidates(small, delays, cutoffs), *_guesses(small, delays[::2], cutoffs)]
    low, high = bounds(small, max_delay)
    starts = [np.clip(s, low, high) for s in starts if len(s) == small.layout.size]
    ranked = sorted(((_judge(small, s), i) for i, s in enumerate(starts)))
    chosen: list[Array] = []
    for _, i in ranked:
        if len(chosen) < _STARTS and all(_differ(small, starts[i], c) for c in chosen):
            chosen.append(starts[i])
    ended = [descend(small, s, max_delay, 25)[0] for s in chosen]
    return min(ended, key=lambda t: _judge(small, t))


def _freed(problem: Problem, theta: Array, max_delay: float) -> Array:
    """Give every channel the shared denominator as a start, and one descent on few samples."""
    layout = problem.layout
    start = np.concatenate([np.tile(theta[: layout.poles], layout.groups), theta[layout.poles :]])
    return descend(_thinned(problem, _START_ROWS), start, max_delay, 25)[0]


def _shared_denominator(problem: Problem) -> Problem:
    return problem.with_layout(replace(problem.layout, own=False))


def _judge(problem: Problem, theta: Array) -> float:
    """Loss that a few spikes cannot rule (Cauchy)."""
    weighted = problem.solve(theta).weighted
    return float(np.log1p(weighted**2 / 2.0).sum()) if np.isfinite(weighted).all() else np.inf


def _differ(problem: Problem, a: Array, b: Array) -> bool:
    return bool((np.abs(a - b) > _scales(problem)).any())


def _guesses(problem: Problem, delays: Array, cutoffs: Array) -> list[Array]:
    """Plain second-order-like sections over the grid, where instruments may have failed."""
    poles = problem.layout.poles
    if poles > 2:
        return []
    found = []
    for speed in np.geomspace(cutoffs[0] / 2.0, cutoffs[-1], 7):
        section = [np.log(1.4 * speed), np.log(speed**2)] if poles == 2 else [np.log(speed)]
        found += [srivc.whole_theta(problem, np.array(section), float(d)) for d in delays]
    return found


def _delays(problem: Problem, max_delay: float) -> Array:
    if not problem.layout.free_delays:
        return np.zeros(1)
    return np.linspace(0.0, 0.9 * max_delay, 13)


def _cutoffs(problem: Problem) -> Array:
    """Cut-offs from the pace of the commands to that of the samples [rad/s]."""
    period = min(float(np.median(np.diff(p.time))) for p in problem.parts)
    span = max(p.time[-1] - p.time[0] for p in problem.parts)
    fast = 1.0 / period
    return np.geomspace(max(4.0 / span, fast / 100.0), fast, 4)


def _thinned(problem: Problem, rows: int) -> Problem:
    """Every k-th sample; the exact simulation does not mind the gaps."""
    stride = int(np.ceil(len(problem.measured) / rows))
    if stride == 1:
        return problem
    parts, keep = [], []
    for part in problem.parts:
        chosen = np.arange(len(part.time)) % stride == 0
        renumber = np.cumsum(chosen) - 1
        a, r = chosen[part.angle_rows], chosen[part.rate_rows]
        parts.append(
            Part(
                part.time[chosen],
                part.input_time,
                part.input,
                renumber[part.angle_rows[a]],
                renumber[part.rate_rows[r]],
                part.free,
            )
        )
        keep.append((a, r))
    rows_kept = np.concatenate([a for a, _ in keep] + [r for _, r in keep])
    return replace(
        problem,
        parts=tuple(parts),
        measured=problem.measured[rows_kept],
        is_rate=problem.is_rate[rows_kept],
        owner=problem.owner[rows_kept],
        time=problem.time[rows_kept],
        weight=problem.weight[rows_kept],
        cache={},
    )


def _spikes(fit: AxisFit, floor: tuple[float, float]) -> NDArray[np.bool_]:
    """Readings far outside what their neighbours agree on."""
    far = np.zeros(len(fit.kept), dtype=bool)
    for is_rate in (False, True):
        rows = fit.kept & (fit.problem.is_rate == is_rate)
        if not rows.any():
            continue
        residual = np.abs(fit.solution.residual)
        busy = residual[rows][residual[rows] > 1e-3 * residual[rows].max(initial=0.0)]
        typical = _NORMAL * float(np.median(busy)) if len(busy) else 0.0
        far |= rows & (residual > _SPIKE * max(typical, 2.0 * floor[int(is_rate)], 1e-12))
    return far


def _without_spikes(fit: AxisFit, floor: tuple[float, float], max_delay: float) -> AxisFit:
    """Refit with shrinking influence of far readings; give up where they are motion, not spikes."""
    problem, theta = fit.problem, fit.solution.theta
    counted = fit.kept.copy()
    for _ in range(4):
        theta = _robust(problem, theta, max_delay, floor, fit.kept)
        trial = replace(fit, solution=problem.solve(theta))
        far = _spikes(trial, floor)
        if not _isolated(far, problem) or far.sum() > _SPIKE_SHARE * fit.kept.sum():
            return fit
        if (counted == (fit.kept & ~far)).all():
            break
        counted = fit.kept & ~far
    problem = problem.weighed(_weights(problem, fit.noise, counted))
    settled = _settle(problem, theta, fit.kept, floor, max_delay)
    return replace(settled, spikes=fit.kept & ~counted)


def _robust(
    problem: Problem,
    theta: Array,
    max_delay: float,
    floor: tuple[float, float],
    kept: NDArray[np.bool_],
) -> Array:
    """A few rounds of Tukey's biweight from a fresh start that ignores what looks far."""
    residual = np.abs(problem.solve(theta).residual)
    for turn in range(6):
        weight = np.zeros(len(residual))
        for is_rate in (False, True):
            rows = kept & (problem.is_rate == is_rate)
            if rows.any():
                busy = residual[rows][residual[rows] > 1e-3 * residual[rows].max()]
                sigma = max(_NORMAL * float(np.median(busy)), 2.0 * floor[int(is_rate)], 1e-12)
                bell = np.clip(1.0 - (residual[rows] / (4.685 * sigma)) ** 2, 0.0, 1.0)
                weight[rows] = bell / sigma
        trial = problem.weighed(weight)
        start = _best_start(trial, max_delay) if turn == 0 and not problem.layout.own else theta
        theta, _ = descend(trial, start, max_delay, 30)
        residual = np.abs(trial.solve(theta).residual)
    return theta


def _isolated(far: NDArray[np.bool_], problem: Problem) -> bool:
    """No run of far readings of one sensor in one record is longer than a spike."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], far.astype(int), [0]])))
    return bool((edges[1::2] - edges[::2] <= _SPIKE_RUN).all()) if len(edges) else True
