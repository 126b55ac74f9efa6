"""The fit of one axis: each sensor weighed by its own noise, single spikes set aside."""

from dataclasses import dataclass, replace

import numpy as np

from analysis.array import Array
from analysis.identify import noise as sensor_noise
from analysis.identify.descent import descend
from analysis.identify.noise import Mask, Pair, typical, weights
from analysis.identify.problem import Problem, Solution
from analysis.identify.starts import best_start, follow

_ROUNDS = 5  # of noise estimation; two or three settle it to a percent
_SPIKE = 6.0  # sigma; one Gaussian reading in 5e8 lies beyond
_SKIRT = 3.0  # sigma: a reading next to a spike that lies this far is part of it
_SPIKE_RUN = 3  # readings: a longer run is motion the model lacks, not a spike
_SPIKE_SHARE = 0.02  # of all readings


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
    noise: Pair
    spikes: Mask
    kept: Mask
    converged: bool


def search(
    problem: Problem, *, max_delay: float, start: Array | None = None, keep: Mask | None = None
) -> AxisFit:
    """Fit one axis; readings outside `keep` (rows,) do not count."""
    kept = np.ones(len(problem.measured), dtype=bool) if keep is None else keep
    floor = sensor_noise.quantisation(problem)
    first = sensor_noise.from_differences(problem, kept, floor)
    problem = problem.weighed(weights(problem, first, kept))
    theta = best_start(problem, max_delay) if start is None else start
    fit = _settle(problem, theta, kept, floor, max_delay)
    far = _far(fit, floor)
    if not far.any() or far.sum() > max(_SPIKE_RUN, 3.0 * _SPIKE_SHARE * kept.sum()):
        return fit
    return _without_spikes(fit, problem, floor, max_delay)


def _settle(problem: Problem, theta: Array, kept: Mask, floor: Pair, max_delay: float) -> AxisFit:
    """Descend and estimate the noise in turns until the noise stays."""
    noise, converged = (np.nan, np.nan), False
    counted = problem.weight > 0.0
    for _ in range(_ROUNDS):
        theta, converged = descend(problem, theta, max_delay, 60)
        last = noise
        noise = sensor_noise.from_residual(problem, problem.solve(theta), counted, floor)
        problem = problem.weighed(weights(problem, noise, counted))
        change = [abs(a / b - 1.0) for a, b in zip(noise, last, strict=True) if np.isfinite(a)]
        if np.isfinite(change).all() and max(change) < 0.01:
            break
    return AxisFit(problem, problem.solve(theta), noise, kept & ~counted, kept, converged)


def _far(fit: AxisFit, floor: Pair) -> Mask:
    """Readings far outside what the others agree on."""
    far = np.zeros(len(fit.kept), dtype=bool)
    for is_rate in (False, True):
        rows = fit.kept & (fit.problem.is_rate == is_rate)
        if rows.any():
            limit = _SPIKE * typical(fit.solution.residual[rows], floor[int(is_rate)])
            far |= rows & (np.abs(fit.solution.residual) > limit)
    return far


def _without_spikes(fit: AxisFit, first: Problem, floor: Pair, max_delay: float) -> AxisFit:
    """Refit without far readings, unless they are motion the model lacks rather than spikes."""
    theta = follow(first, best_start(first, max_delay, robust=True), max_delay, robust=True)
    trial = replace(fit, problem=first, solution=first.solve(theta))
    spikes = np.zeros(len(fit.kept), dtype=bool)
    for _ in range(6):
        far = _far(trial, floor)
        if spikes.any():  # the noise is known by now
            far = _with_skirts(far, trial)
        if not _isolated(far) or far.sum() > max(_SPIKE_RUN, _SPIKE_SHARE * fit.kept.sum()):
            return fit
        if (far == spikes).all():
            break
        spikes = far
        problem = first.weighed(np.where(far, 0.0, first.weight))
        trial = _settle(problem, trial.solution.theta, fit.kept, floor, max_delay)
    return trial


def _with_skirts(spikes: Mask, fit: AxisFit) -> Mask:
    """Spikes and the neighbours they pulled along: what disturbs one reading may smear the next."""
    sigma = np.where(fit.problem.is_rate, fit.noise[1], fit.noise[0])
    off = fit.kept & (np.abs(fit.solution.residual) > _SKIRT * sigma)
    beside = np.zeros_like(spikes)
    beside[1:] |= spikes[:-1]
    beside[:-1] |= spikes[1:]
    return spikes | (beside & off)


def _isolated(far: Mask) -> bool:
    """No run of far readings is longer than a spike."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], far.astype(int), [0]])))
    return bool((edges[1::2] - edges[::2] <= _SPIKE_RUN).all()) if len(edges) else True
