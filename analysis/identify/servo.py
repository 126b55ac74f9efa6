"""Fit of a bounded servo: linear part and delay together with rate limit, dead band and backlash.

Three places for the bound are tried, because servos differ in it, and the one that predicts steps
held out best is kept. `speed`: the servo's own loop saturates (`servo_motion`). `command`: the
command is limited to ramps ahead of the linear part (`ramps`). `set-point`: as `speed`, behind a
set point of bounded speed, with a limit each way. Gain, offsets and biases enter linearly and are
solved for in every step.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from analysis.array import Array
from analysis.identify import noise as sensor_noise
from analysis.identify.dead_band import static_dead_band
from analysis.identify.errors import IdentificationError
from analysis.identify.noise import Mask, Pair, weights
from analysis.identify.problem import Problem
from analysis.identify.segments import step_folds
from analysis.identify.servo_fit import ServoFit
from analysis.identify.servo_response import servo_response
from analysis.identify.servo_starts import command_unit, grid_of_starts, limits, scaled, scales
from analysis.identify.starts import ROWS, thinned
from analysis.transfer_function.servo import Structure

_ROUNDS = 3
_FOLLOWED = 3
_FOLDS = 4
_WORTH = 0.97  # of the held-out loss: what a parameter more must save
_DIFFERENCE = 1e-5  # of each parameter's scale: far above rounding, far below curvature
_WIDE_DIFFERENCE = 1e-3  # where dead band and play make the loss rough


def search_servo(
    problem: Problem,
    axis: int,
    *,
    max_delay: float,
    structure: Structure | None = None,
    keep: Mask | None = None,
) -> ServoFit:
    """Fit a bounded servo to one axis, driven by the command of the same number.

    Raises
    ------
    IdentificationError : the layout has zeros or more than two poles, which no bounded servo here
        has
    """
    if problem.layout.zeros or problem.layout.poles not in (1, 2):
        raise IdentificationError(
            f"servo: fitted with 1 or 2 poles and no zeros, not {problem.layout.poles} and "
            f"{problem.layout.zeros}; leave zeros away or fit without the servo"
        )
    kept = np.ones(len(problem.measured), dtype=bool) if keep is None else keep
    floor = sensor_noise.quantisation(problem)
    first = sensor_noise.from_differences(problem, kept, floor)
    problem = problem.weighed(weights(problem, first, kept))
    unit = command_unit(problem, axis)
    alike = scaled(problem, axis, unit)
    tried: tuple[Structure, ...] = ("speed", "command", "set-point")
    if structure is not None:
        tried = (structure,)
    elif problem.layout.poles == 1 or not _reverses(problem, axis):
        # steps one way only do not show what becomes of small motions to and fro
        tried = ("speed", "command")
    fits = [_fit(alike, axis, s, max_delay, kept, floor) for s in tried]
    losses = {
        f.structure: loss * (1.0 if f.structure != "set-point" else 1.0 / _WORTH)
        for f, loss in fits
    }
    best = min((f for f, _ in fits), key=lambda f: losses[f.structure])
    return replace(_in_units(best, problem, unit), losses=losses)


def _in_units(fit: ServoFit, problem: Problem, unit: float) -> ServoFit:
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
        jacobian=jacobian,
    )  # fmt: skip


def _fit(
    problem: Problem, axis: int, structure: Structure, max_delay: float, kept: Mask, floor: Pair
) -> tuple[ServoFit, float]:
    """Judge a grid of starts, follow the best few, settle the noise; also the loss held out."""
    poles = problem.layout.poles
    few = thinned(problem, ROWS)
    starts = grid_of_starts(problem, max_delay, structure)
    if not _reverses(problem, axis):
        starts = [_with(s, [poles + 3], np.zeros(1)) for s in starts]
    tight = _always(problem, axis, structure)
    theta = _best(few, axis, structure, starts, max_delay, tight)
    static = static_dead_band(problem, axis)
    free, theta, held_out = _worth_having(few, axis, structure, theta, starts, max_delay, static)
    noise: Pair = (np.nan, np.nan)
    for _ in range(_ROUNDS):
        _, linear, residual = _project(problem, axis, structure, theta)
        noise = _noise(problem, residual, len(theta) + len(linear), kept, floor)
        problem = problem.weighed(weights(problem, noise, kept))
        theta, converged = _descend(problem, axis, structure, theta, max_delay, free)
    _, linear, residual = _project(problem, axis, structure, theta)
    jacobian = _jacobian(problem, axis, structure, theta, linear)
    fit = ServoFit(problem, structure, poles, theta, linear, residual, jacobian, noise, converged)
    return fit, held_out


def _best(
    problem: Problem,
    axis: int,
    structure: Structure,
    starts: list[Array],
    max_delay: float,
    free: NDArray[np.intp],
) -> Array:
    """Where the best few of the starts lead, the lowest of them."""
    ranked = sorted(starts, key=lambda t: _loss(problem, axis, structure, t))[:_FOLLOWED]
    ended = [_descend(problem, axis, structure, t, max_delay, free)[0] for t in ranked]
    return min(ended, key=lambda t: _loss(problem, axis, structure, t))


def _always(problem: Problem, axis: int, structure: Structure) -> NDArray[np.intp]:
    """Parameters that are always searched: of `set-point` all that a motion shows, else no play."""
    poles = problem.layout.poles
    if structure != "set-point":
        return np.arange(poles + 2)
    every = np.arange(poles + 6)
    return every if _reverses(problem, axis) else np.delete(every, poles + 3)


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


def _project(
    problem: Problem, axis: int, structure: Structure, theta: Array
) -> tuple[Array, Array, Array]:
    """Weighted residual, linear parameters and residual at θ."""
    phi = _columns(problem, axis, structure, theta)
    weighted = phi * problem.weight[:, None]
    target = problem.measured * problem.weight
    linear = np.asarray(np.linalg.lstsq(weighted, target, rcond=1e-12)[0], dtype=np.float64)
    residual = problem.measured - phi @ linear
    return residual * problem.weight, linear, residual


def _loss(problem: Problem, axis: int, structure: Structure, theta: Array) -> float:
    return float(np.sum(_project(problem, axis, structure, theta)[0] ** 2))


def _descend(
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
    start = np.clip(theta, low, high)

    def whole(x: Array) -> Array:
        full = start.copy()
        full[free] = x * scale[free]
        return full

    def residual_at(x: Array) -> Array:
        return _project(problem, axis, structure, whole(x))[0]

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


def _worth_having(
    problem: Problem,
    axis: int,
    structure: Structure,
    theta: Array,
    starts: list[Array],
    max_delay: float,
    static: float,
) -> tuple[NDArray[np.intp], Array, float]:
    """Which parameters to free, and where to start: dead band and backlash if they predict steps.

    On the steps it is fitted to, a second excuse for a static error always helps; so steps held
    out decide. Where the gimbal settled, the dead band is read off there (`static_dead_band`).
    Backlash shows only where the motion reverses: elsewhere it is gain by another name.
    """
    poles = problem.layout.poles
    tight = _always(problem, axis, structure)
    band, play_ = poles + 2, poles + 3
    if structure == "speed":
        theta = _with(theta, [band], np.array([static]))
    choices = [(tight, theta)]
    extra = [[band]] if structure == "speed" else []
    if structure != "set-point" and _reverses(problem, axis):
        extra += [[play_], [band, play_]] if structure == "speed" else [[play_]]
    least = scales(problem, structure)
    for more in extra:
        free = np.concatenate([tight, more])
        # settled angles fall short by a dead band or by half of a backlash: they cannot tell which
        shares = [static / len(more) if k == band else 2.0 * static / len(more) for k in more]
        values = np.maximum(shares, least[more])
        begins = [_with(_with(t, [band], np.zeros(1)), more, values) for t in (theta, *starts)]
        choices.append((free, _best(problem, axis, structure, begins, max_delay, free)))
    folds = step_folds(problem, axis, _FOLDS)
    losses = []
    for free, start in choices:
        loss = 0.0
        for fold in folds:
            training = problem.weighed(np.where(fold, 0.0, problem.weight))
            found, _ = _descend(training, axis, structure, start, max_delay, free)
            loss += _held_out(problem, _project(training, axis, structure, found)[2], fold)
        losses.append(loss)
    best = int(np.argmin(losses))
    if losses[best] >= _WORTH * losses[0]:
        best = 0
    return *choices[best], losses[best]


def _with(theta: Array, places: list[int], values: Array) -> Array:
    changed = theta.copy()
    changed[places] = values
    return changed


def _reverses(problem: Problem, axis: int) -> bool:
    """Whether the command ever turns back within a record."""
    for part in problem.parts:
        steps = np.diff(part.input[:, axis])
        if (steps > 0.0).any() and (steps < 0.0).any():
            return True
    return False


def _held_out(problem: Problem, residual: Array, fold: Mask) -> float:
    """Weighted squares of the held-out residual around each record's own offset."""
    total = 0.0
    for index in range(len(problem.parts)):
        for is_rate in (False, True):
            rows = fold & (problem.owner == index) & (problem.is_rate == is_rate)
            rows &= problem.weight > 0.0
            if rows.any():
                centred = residual[rows] - residual[rows].mean()
                total += float(np.sum((centred * problem.weight[rows]) ** 2))
    return total


def servo_jacobian(problem: Problem, axis: int, structure: Structure, theta: Array) -> Array:
    """Derivatives of the weighted output of a servo (rows, θ + linear), at its best gain."""
    return _jacobian(problem, axis, structure, theta, _project(problem, axis, structure, theta)[1])


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
