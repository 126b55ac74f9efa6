"""Damped least squares over poles and delays, within what the samples can tell."""

import numpy as np

from analysis.array import Array
from analysis.identify.problem.problem import Problem


def descend(
    problem: Problem, theta: Array, max_delay: float, evaluations: int, ftol: float = 1e-10
) -> tuple[Array, bool]:
    """Follow the loss down from θ; returns where it ended and whether that is a minimum."""
    from scipy.optimize import least_squares

    low, high = bounds(problem, max_delay)

    def residual(t: Array) -> Array:
        return problem.solve(t).weighted

    def jacobian(t: Array) -> Array:
        return problem.solve(t).projected

    found = least_squares(
        residual,
        np.clip(theta, low + 1e-9, high - 1e-9),
        jac=jacobian,
        bounds=(low, high),
        x_scale=scales(problem),
        max_nfev=evaluations,
        ftol=ftol,
        xtol=1e-9,
        gtol=1e-12,
    )
    return np.asarray(found.x), bool(found.status > 0)


def bounds(problem: Problem, max_delay: float) -> tuple[Array, Array]:
    """Slowest and fastest section the samples can tell, and the range of delays."""
    layout = problem.layout
    slow, fast = 0.05 / span(problem), 60.0 / period(problem)
    pairs = layout.poles // 2
    low = np.tile(np.log([1e-4 * slow, slow**2]), pairs)
    high = np.tile(np.log([2e2 * fast, fast**2]), pairs)
    if layout.poles % 2:
        low, high = np.append(low, np.log(slow)), np.append(high, np.log(fast))
    free = len(layout.free_delays)
    return (
        np.concatenate(
            [
                np.tile(low, layout.groups),
                np.full(free, -max(p.slack for p in problem.parts) - 1e-6),
            ]
        ),
        np.concatenate([np.tile(high, layout.groups), np.full(free, max_delay)]),
    )


def scales(problem: Problem) -> Array:
    """Change of each parameter that matters: a third of a pole, one sample of delay."""
    layout = problem.layout
    free = len(layout.free_delays)
    return np.concatenate(
        [np.full(layout.groups * layout.poles, 0.3), np.full(free, period(problem))]
    )


def period(problem: Problem) -> float:
    """Sampling period of the fastest record [s]."""
    return min(float(np.median(np.diff(p.time))) for p in problem.parts)


def span(problem: Problem) -> float:
    """Duration of the longest record [s]."""
    return max(float(p.time[-1] - p.time[0]) for p in problem.parts)
