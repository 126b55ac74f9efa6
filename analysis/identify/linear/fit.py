"""The fit of one axis: each sensor weighed by its own noise, single spikes set aside."""

from dataclasses import dataclass

import numpy as np

from analysis.array import Array
from analysis.identify.linear.descent import descend
from analysis.identify.linear.starts import best_start, follow_closely, jumps
from analysis.identify.problem import noise as sensor_noise
from analysis.identify.problem.noise import Mask, Pair, weights
from analysis.identify.problem.problem import Problem, Solution
from analysis.identify.problem.spikes import outstanding, spikes

_ROUNDS = 5  # of noise estimation; two or three settle it to a percent


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
    problem, aside = prepared(problem, kept)
    return settled(
        problem, best_start(problem, max_delay) if start is None else start, kept, aside, max_delay
    )


def prepared(problem: Problem, kept: Mask) -> tuple[Problem, Mask]:
    """The problem weighed by a first guess of the noise, outstanding readings set aside."""
    floor = sensor_noise.quantisation(problem)
    noise = sensor_noise.from_differences(problem, kept, floor)
    aside = outstanding(problem, noise, kept)
    return problem.weighed(weights(problem, noise, kept & ~aside)), aside


def settled(problem: Problem, theta: Array, kept: Mask, aside: Mask, max_delay: float) -> AxisFit:
    """Descend from θ, estimate the noise and set spikes aside in turns until both stay."""
    floor = sensor_noise.quantisation(problem)
    noise: Pair = (np.nan, np.nan)
    converged = False
    for turn in range(_ROUNDS):
        if jumps(problem):
            theta = follow_closely(problem, theta, max_delay)
        theta, converged = descend(problem, theta, max_delay, 60)
        solution = problem.solve(theta)
        last, before = noise, aside
        noise = sensor_noise.from_residual(problem, solution, kept & ~aside, floor)
        aside = spikes(problem, solution.residual, noise, kept)
        problem = problem.weighed(weights(problem, noise, kept & ~aside))
        change = [abs(a / b - 1.0) for a, b in zip(noise, last, strict=True) if np.isfinite(a)]
        if turn and (aside == before).all() and max(change) < 0.01:
            break
    return AxisFit(problem, problem.solve(theta), noise, aside, kept, converged)
