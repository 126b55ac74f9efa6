"""How noisy each sensor is, and the weights that follow."""

import numpy as np
from numpy.typing import NDArray

from analysis.array import Array
from analysis.identify.problem.problem import Problem, Solution

Mask = NDArray[np.bool_]
Pair = tuple[float, float]  # of angle [rad] and rate [rad/s]; NaN where not measured

_NORMAL = 1.4826  # sigma per median absolute deviation of a Gaussian


def resolution(values: Array) -> float:
    """Step of a quantised signal, 0 if it is not visibly quantised: the smallest gap of its levels.

    Levels far apart are those that a fast motion left out.
    """
    levels = np.unique(values)
    if len(levels) < 2 or len(levels) > len(values) / 3:
        return 0.0
    gaps = np.diff(levels)
    return float(gaps[gaps > 1e-9 * np.ptp(levels)].min())


def quantisation(problem: Problem) -> Pair:
    """Noise below which no sensor is believed: half its quantisation noise (step/√12)."""
    both = []
    for is_rate in (False, True):
        values = problem.measured[problem.is_rate == is_rate]
        both.append(resolution(values) / np.sqrt(12.0) / 2.0 if len(values) else 0.0)
    return both[0], both[1]


def level_errors(problem: Problem, noise: Pair) -> tuple[NDArray[np.intp], Array]:
    """Group of each reading that shares its rounding, and that error over sigma (rows,).

    A sensor quieter than its step reads the same value at every return to an angle: its rounding
    is an error of that value, not noise of each reading. Noise makes it one (L. Schuchman, IEEE
    Trans. Commun. Technol. 12, 1964): by the factor exp(−2π²(σ/step)²).
    """
    group = np.arange(len(problem.measured))
    size = np.zeros(len(problem.measured))
    for is_rate in (False, True):
        rows = problem.is_rate == is_rate
        step = resolution(problem.measured[rows]) if rows.any() else 0.0
        if step > 0.0:
            dither = max(noise[int(is_rate)] ** 2 / step**2 - 1.0 / 12.0, 0.0)
            _, number = np.unique(problem.measured[rows], return_inverse=True)
            group[rows] = len(group) * (1 + int(is_rate)) + number
            size[rows] = step / np.sqrt(12.0) * np.exp(-2.0 * np.pi**2 * dither)
    return group, size * problem.weight


def weights(problem: Problem, noise: Pair, counted: Mask) -> Array:
    """One over sigma of every reading, zero where it does not count (rows,)."""
    sigma = np.where(problem.is_rate, noise[1], noise[0])
    return np.where(counted, 1.0 / sigma, 0.0)


def from_differences(problem: Problem, kept: Mask, floor: Pair) -> Pair:
    """Noise from second differences: a start, too large where the motion is fast."""
    both = []
    for is_rate in (False, True):
        found = []
        for index in range(len(problem.parts)):
            rows = kept & (problem.is_rate == is_rate) & (problem.owner == index)
            if rows.sum() > 4:
                found.append(clipped_rms(np.diff(problem.measured[rows], 2) / np.sqrt(6.0)))
        values = problem.measured[kept & (problem.is_rate == is_rate)]
        least = 1e-6 * float(np.ptp(values)) if len(values) else 0.0
        both.append(max(float(np.median(found)), floor[int(is_rate)], least) if found else np.nan)
    return both[0], both[1]


def from_residual(problem: Problem, solution: Solution, counted: Mask, floor: Pair) -> Pair:
    """Root mean square of each sensor's residual, corrected for the parameters it paid for."""
    share = (len(solution.theta) + len(solution.linear)) / max(int(counted.sum()), 1)
    both = []
    for is_rate in (False, True):
        rows = counted & (problem.is_rate == is_rate)
        if not rows.any():
            both.append(np.nan)
            continue
        power = float(np.mean(solution.residual[rows] ** 2)) / max(1.0 - share, 0.1)
        both.append(max(float(np.sqrt(power)), floor[int(is_rate)], 1e-12))
    return both[0], both[1]


def clipped_rms(bend: Array) -> float:
    """Root mean square of second differences over √6 (n,), the few of fast motion cut off."""
    cap = 5.0 * max(_NORMAL * float(np.median(np.abs(bend))), 0.2 * float(np.std(bend)))
    return float(np.sqrt(np.mean(np.clip(bend**2, 0.0, cap**2))))
