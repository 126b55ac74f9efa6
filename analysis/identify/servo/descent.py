"""The loss of a bounded servo, its derivatives, and the way down from a start."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from analysis.array import Array
from analysis.identify.problem.noise import Mask, Pair, from_differences, weights
from analysis.identify.problem.problem import Problem
from analysis.identify.servo.fit import ServoFit
from analysis.identify.servo.response import servo_response
from analysis.identify.servo.starts import command_unit, limits, scaled, scales
from analysis.transfer_function.servo import Structure

_ROUNDS = 3
_DIFFERENCE = 1e-5  # of each parameter's scale: far above rounding, far below curvature
_WIDE_DIFFERENCE = 1e-3  # where dead band and play make the loss rough


def prepared(
    problem: Problem, axis: int, kept: Mask, floor: Pair
) -> tuple[Problem, Problem, float]:
    """The problem with first weights, the same free of units, and the command's unit in that."""
    first = from_differences(problem, kept, floor)
    problem = problem.weighed(weights(problem, first, kept))
    unit = command_unit(problem, axis)
    return problem, scaled(problem, axis, unit), unit


def in_units(fit: ServoFit, problem: Problem, unit: float) -> ServoFit:
    """The fit of commands over `unit`, in the commands' own unit."""
    n = fit.poles
    theta, linear, jacobian = fit.theta.copy(), fit.linear.copy(), fit.jacobian.copy()
    theta[n + 1] += np.log(unit)
    theta[n + 4 : n + 5] += np.log(unit)
    theta[n + 2 : n + 4] *= unit
    jacobian[:, n + 2 : n + 4] /= unit
    linear[0] /= unit
    jacobian[:, len(theta)] *= unit
    return replace(
        fit, problem=problem.weighed(fit.problem.weight), theta=theta, linear=linear,
        jacobian=jacobian, idle={name: value * unit for name, value in fit.idle.items()},
    )  # fmt: skip


def settled(
    problem: Problem,
    axis: int,
    structure: Structure,
    theta: Array,
    free: NDArray[np.intp],
    max_delay: float,
    kept: Mask,
    floor: Pair,
) -> ServoFit:
    """The fit from a start near it, with the noise of its own residual."""
    noise: Pair = (np.nan, np.nan)
    converged = False
    for _ in range(_ROUNDS):
        _, linear, residual = project(problem, axis, structure, theta)
        noise = _noise(problem, residual, len(theta) + len(linear), kept, floor)
        problem = problem.weighed(weights(problem, noise, kept))
        theta, converged = descend(problem, axis, structure, theta, max_delay, free)
    return fit_at(problem, axis, structure, theta, noise, converged)


def fit_at(
    problem: Problem, axis: int, structure: Structure, theta: Array, noise: Pair, converged: bool
) -> ServoFit:
    """The fit at θ, gain and offsets at their best."""
    _, linear, residual = project(problem, axis, structure, theta)
    jacobian = _jacobian(problem, axis, structure, theta, linear)
    n = problem.layout.poles
    return ServoFit(problem, structure, n, theta, linear, residual, jacobian, noise, converged)


def _noise(problem: Problem, residual: Array, paid: int, kept: Mask, floor: Pair) -> Pair:
    both = []
    for is_rate in (False, True):
        rows = kept & (problem.is_rate == is_rate)
        share = min(paid / max(int(kept.sum()), 1), 0.9)
        power = float(np.mean(residual[rows] ** 2)) / (1.0 - share) if rows.any() else np.nan
        both.append(max(float(np.sqrt(power)), floor[int(is_rate)], 1e-12) if rows.any() else power)
    return both[0], both[1]


def _columns(problem: Problem, axis: int, structure: Structure, theta: Array) -> Array:
    """Columns of gain, offsets and biases (rows, linear)."""
    both = [servo_response(p, axis, structure, problem.layout.poles, theta) for p in problem.parts]
    angle = [y[p.angle_rows] for p, (y, _) in zip(problem.parts, both, strict=True)]
    rate = [v[p.rate_rows] for p, (_, v) in zip(problem.parts, both, strict=True)]
    return np.hstack([np.concatenate(angle + rate)[:, None], problem.offsets])


def project(
    problem: Problem, axis: int, structure: Structure, theta: Array
) -> tuple[Array, Array, Array]:
    """Weighted residual, linear parameters and residual at θ."""
    phi = _columns(problem, axis, structure, theta)
    weighted = phi * problem.weight[:, None]
    target = problem.measured * problem.weight
    linear = np.asarray(np.linalg.lstsq(weighted, target, rcond=1e-12)[0], dtype=np.float64)
    residual = problem.measured - phi @ linear
    return residual * problem.weight, linear, residual


def loss_of(problem: Problem, axis: int, structure: Structure, theta: Array) -> float:
    """Weighted sum of squares at θ, gain and offsets at their best."""
    return float(np.sum(project(problem, axis, structure, theta)[0] ** 2))


def descend(
    problem: Problem,
    axis: int,
    structure: Structure,
    theta: Array,
    max_delay: float,
    free: NDArray[np.intp],
) -> tuple[Array, bool]:
    """Follow the loss down along the free parameters."""
    from scipy.optimize import least_squares

    low, high = limits(problem, max_delay, structure)
    scale = scales(problem, structure)
    start = theta.copy()
    start[free] = np.clip(theta, low, high)[free]  # others may be held beyond, as a lifted limit is

    def whole(x: Array) -> Array:
        full = start.copy()
        full[free] = x * scale[free]
        return full

    def residual_at(x: Array) -> Array:
        return project(problem, axis, structure, whole(x))[0]

    found = least_squares(
        residual_at,
        start[free] / scale[free],
        bounds=(low[free] / scale[free], high[free] / scale[free]),
        diff_step=np.full(len(free), _WIDE_DIFFERENCE if structure == "set-point" else _DIFFERENCE),
        max_nfev=60,
        ftol=1e-9,
        xtol=1e-8,
    )
    return whole(found.x), bool(found.status > 0)


def _jacobian(
    problem: Problem, axis: int, structure: Structure, theta: Array, linear: Array
) -> Array:
    """Derivatives of the weighted model output (rows, θ + linear)."""
    scale = scales(problem, structure) * 1e-3
    columns = []
    for i, step in enumerate(scale):
        shift = np.zeros(len(theta))
        shift[i] = step
        positive = problem.layout.poles + 2 <= i < problem.layout.poles + 4
        low = shift if positive and theta[i] <= step else np.zeros(len(theta))
        ahead = _columns(problem, axis, structure, theta + shift) @ linear
        behind = _columns(problem, axis, structure, theta - shift + low) @ linear
        columns.append((ahead - behind) / (2.0 * step - (low[i])))
    phi = _columns(problem, axis, structure, theta)
    return np.hstack([np.stack(columns, axis=1), phi]) * problem.weight[:, None]
