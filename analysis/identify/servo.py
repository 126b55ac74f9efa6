"""Fit of a bounded servo: linear part and delay together with rate limit, dead band and backlash.

Two places for the bound are tried, because servos differ in it. `speed`: the servo's own loop
saturates (`servo_motion`). `command`: the command is limited to ramps ahead of the linear part
(`ramps`). Gain, offsets and biases enter linearly and are solved for in every step.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from analysis.array import Array
from analysis.identify import noise as sensor_noise
from analysis.identify.dead_band import static_dead_band
from analysis.identify.errors import IdentificationError
from analysis.identify.noise import Mask, Pair, weights
from analysis.identify.problem import Problem
from analysis.identify.segments import step_folds
from analysis.identify.servo_response import servo_response
from analysis.identify.servo_starts import command_unit, grid_of_starts, limits, scaled, scales
from analysis.transfer_function.servo import Structure

_ROUNDS = 3
_FOLLOWED = 3
_FOLDS = 4
_WORTH = 0.97  # of the held-out loss: what a parameter more must save
_DIFFERENCE = 1e-5  # of each parameter's scale: far above rounding, far below curvature


@dataclass(frozen=True, slots=True)
class ServoFit:
    """A bounded servo as found on one axis.

    Attributes
    ----------
    structure : where the rate is bounded
    poles : 1 or 2
    theta : denominator (as `basis.denominator`), delay [s], ln rate limit, dead band, backlash
    linear : gain, offsets, biases
    residual : measured − model (rows,)
    jacobian : of the weighted residual in θ and the linear parameters (rows, all)
    noise : of angle [rad] and rate [rad/s]
    """

    problem: Problem
    structure: Structure
    poles: int
    theta: Array
    linear: Array
    residual: Array
    jacobian: Array
    noise: Pair
    converged: bool

    @property
    def gain(self) -> float:
        """Output per command at rest."""
        return float(self.linear[0])

    @property
    def delay(self) -> float:
        """Transport delay [s]."""
        return float(self.theta[self.poles])

    @property
    def rate_limit(self) -> float:
        """Fastest change of the command's side of the gain [rad/s]."""
        return float(np.exp(self.theta[self.poles + 1]))

    @property
    def dead_band(self) -> float:
        """Half width, on the command's side [rad]."""
        return float(self.theta[self.poles + 2])

    @property
    def backlash(self) -> float:
        """Total width at the output [rad]."""
        return float(self.theta[self.poles + 3] * abs(self.gain))

    @property
    def cost(self) -> float:
        """Half the sum of squared residuals at the noise of the first guess: for comparing."""
        sigma = np.where(self.problem.is_rate, self.noise[1], self.noise[0])
        return float(np.sum(np.log(sigma[self.problem.weight > 0.0])))


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
    tried: tuple[Structure, ...] = ("speed", "command") if structure is None else (structure,)
    fits = [_fit(alike, axis, s, max_delay, kept, floor) for s in tried]
    return _in_units(min(fits, key=lambda f: f.cost), problem, unit)


def _in_units(fit: ServoFit, problem: Problem, unit: float) -> ServoFit:
    """The fit of commands over `unit`, in the commands' own unit."""
    n = fit.poles
    theta, linear, jacobian = fit.theta.copy(), fit.linear.copy(), fit.jacobian.copy()
    theta[n + 1] += np.log(unit)
    theta[n + 2 :] *= unit
    jacobian[:, n + 2 : n + 4] /= unit
    linear[0] /= unit
    jacobian[:, len(theta)] *= unit
    return replace(
        fit, problem=problem.weighed(fit.problem.weight), theta=theta, linear=linear,
        jacobian=jacobian,
    )  # fmt: skip


def _fit(
    problem: Problem, axis: int, structure: Structure, max_delay: float, kept: Mask, floor: Pair
) -> ServoFit:
    """Judge a grid of starts, follow the best few, settle the noise."""
    poles = problem.layout.poles
    starts = grid_of_starts(problem, max_delay)
    ranked = sorted(range(len(starts)), key=lambda i: _loss(problem, axis, structure, starts[i]))
    tight = np.arange(poles + 2)  # neither dead band nor backlash
    ended = [
        _descend(problem, axis, structure, starts[i], max_delay, tight) for i in ranked[:_FOLLOWED]
    ]
    theta, converged = min(ended, key=lambda e: _loss(problem, axis, structure, e[0]))
    free, theta = _worth_having(problem, axis, structure, theta, starts, max_delay, kept)
    noise: Pair = (np.nan, np.nan)
    for _ in range(_ROUNDS):
        _, linear, residual = _project(problem, axis, structure, theta)
        noise = _noise(problem, residual, len(theta) + len(linear), kept, floor)
        problem = problem.weighed(weights(problem, noise, kept))
        theta, converged = _descend(problem, axis, structure, theta, max_delay, free)
    _, linear, residual = _project(problem, axis, structure, theta)
    jacobian = _jacobian(problem, axis, structure, theta, linear)
    return ServoFit(problem, structure, poles, theta, linear, residual, jacobian, noise, converged)


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
    return np.hstack([np.concatenate(angle + rate)[:, None], problem.offsets()])


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

    low, high = limits(problem, max_delay)
    scale = scales(problem)
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
        diff_step=np.full(len(free), _DIFFERENCE),
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
    kept: Mask,
) -> tuple[NDArray[np.intp], Array]:
    """Which parameters to free, and where to start: dead band and backlash if they predict steps.

    On the steps it is fitted to, a second excuse for a static error always helps; so steps held
    out decide. Where the gimbal settled, the dead band is read off there (`static_dead_band`).
    Backlash shows only where the motion reverses: elsewhere it is gain by another name.
    """
    poles = problem.layout.poles
    tight = np.arange(poles + 2)
    band, play_ = poles + 2, poles + 3
    static = static_dead_band(problem, axis)
    if structure == "speed":
        theta = _with(theta, [band], np.array([static]))
    choices = [(tight, theta)]
    extra = [[band]] if structure == "speed" else []
    if _reverses(problem, axis):
        extra += [[play_], [band, play_]] if structure == "speed" else [[play_]]
    least = scales(problem)
    for more in extra:
        free = np.concatenate([tight, more])
        # settled angles fall short by a dead band or by half of a backlash: they cannot tell which
        shares = [static / len(more) if k == band else 2.0 * static / len(more) for k in more]
        values = np.maximum(shares, least[more])
        begins = [_with(_with(t, [band], np.zeros(1)), more, values) for t in (theta, *starts)]
        begins = sorted(begins, key=lambda t: _loss(problem, axis, structure, t))[:_FOLLOWED]
        ended = [_descend(problem, axis, structure, b, max_delay, free)[0] for b in begins]
        choices.append((free, min(ended, key=lambda t: _loss(problem, axis, structure, t))))
    folds = step_folds(problem, axis, _FOLDS)
    losses = []
    for free, start in choices:
        loss = 0.0
        for fold in folds:
            training = problem.weighed(np.where(fold | ~kept, 0.0, problem.weight))
            found, _ = _descend(training, axis, structure, start, max_delay, free)
            loss += _held_out(problem, _project(training, axis, structure, found)[2], fold & kept)
        losses.append(loss)
    best = int(np.argmin(losses))
    return choices[best] if losses[best] < _WORTH * losses[0] else choices[0]


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
            if rows.any():
                centred = residual[rows] - residual[rows].mean()
                total += float(np.sum((centred * problem.weight[rows]) ** 2))
    return total


def _jacobian(
    problem: Problem, axis: int, structure: Structure, theta: Array, linear: Array
) -> Array:
    """Derivatives of the weighted model output (rows, θ + linear)."""
    scale = scales(problem) * 1e-3
    columns = []
    for i, step in enumerate(scale):
        shift = np.zeros(len(theta))
        shift[i] = step
        low = np.zeros(len(theta)) if i < len(theta) - 2 or theta[i] > step else shift
        ahead = _columns(problem, axis, structure, theta + shift) @ linear
        behind = _columns(problem, axis, structure, theta - shift + low) @ linear
        columns.append((ahead - behind) / (2.0 * step - (low[i])))
    phi = _columns(problem, axis, structure, theta)
    return np.hstack([np.stack(columns, axis=1), phi]) * problem.weight[:, None]
