"""How far estimates may be off: noise of the sensors, its colour, whole steps that disagree.

Three covariances of the parameters, each right under assumptions of its own. White noise: (JᵀJ)⁻¹.
Coloured noise: the sandwich (JᵀJ)⁻¹JᵀRJ(JᵀJ)⁻¹ with R of an autoregression of the residual. Steps
that disagree (late stamps, rounding of a quiet sensor, friction): the jackknife over whole steps.
"""

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.array import Array
from analysis.identify.problem.problem import Solution

_FEWEST_STEPS = 4  # below, leaving steps out says nothing
_ORDER = 4  # of the autoregression
_NORMAL = 1.96  # deviations of a 95 % interval, which every interval is printed with


@dataclass(frozen=True, slots=True)
class Uncertainty:
    """Covariances of all parameters (all, all) of one axis.

    Attributes
    ----------
    white : under white noise and the rounding of sensors quieter than their step
    colour : under noise as coloured as the residual, or None where that is white
    steps : over whole steps, or None with too few
    late : what the error of each step's time does to the parameters (steps, all), or None
    freedom : degrees of freedom of `colour` and of `steps`
    spread : deviation over whole steps, over that under white noise: median of the channels'
        parameters, NaN if unknown
    """

    white: Array
    colour: Array | None
    steps: Array | None
    late: Array | None
    freedom: tuple[float, float]
    spread: float

    @property
    def limit(self) -> float:
        """Ratio of deviations from which steps disagree: chance stays below in 99 of 100 cases."""
        return 1.0 + 2.3 / math.sqrt(2.0 * max(self.freedom[1], 1.0))

    @property
    def disagree(self) -> bool:
        """Whether steps disagree more than their noise explains."""
        return self.spread > self.limit

    def deviations(
        self, function: Callable[[Array], Array], at: Array, places: Sequence[int], doubt: Array
    ) -> Array:
        """Standard deviations (m,) of a function of some parameters.

        The largest of those that the readings speak for, so that 1.96 of it are a 95 % interval.

        Parameters
        ----------
        at : the parameters (places,), and where they stand
        doubt : deviations known from elsewhere (places,)
        """

        def of(cov: Array) -> Array:
            own = cov[np.ix_(places, places)] + np.diag(doubt**2)
            return np.sqrt(np.clip(np.diag(propagated(function, at, own)), 0.0, None))

        def freedom(std: Array) -> Array:
            if self.late is None:
                return np.full(len(std), self.freedom[1])
            spread = np.sqrt(np.diag(self.white)[places] + doubt**2)
            late = self.late[:, places] @ slope_of(function, at, spread).T
            return freedom_of(late, std**2, self.freedom[1])

        std = white = of(self.white)
        if self.colour is not None:
            std = np.maximum(std, of(self.colour) * few(self.freedom[0]))
        if self.steps is not None:
            steps = of(self.steps)
            far = self.disagree | (steps > self.limit * white)
            wide = steps * np.array([few(f) for f in freedom(steps).tolist()])
            std = np.where(far, np.maximum(std, wide), std)
        return np.asarray(std)

    @property
    def covariance(self) -> Array:
        """The one that covers the others on the median."""
        every = (self.white, self.colour, self.steps if self.disagree else None)
        return max((c for c in every if c is not None), key=self._over_white)

    @property
    def excess(self) -> float:
        """Variance of the parameters over that under white noise: median."""
        return max(self._over_white(self.covariance), 1.0)

    def _over_white(self, covariance: Array) -> float:
        white = np.diag(self.white)
        return float(np.median(np.diag(covariance)[white > 0.0] / white[white > 0.0]))


def uncertainty(
    jacobian: Array,
    weighted: Array,
    series: Sequence[NDArray[np.intp]],
    steps: NDArray[np.intp],
    own: Sequence[int],
    levels: tuple[NDArray[np.intp], Array],
    delays: Sequence[int],
) -> Uncertainty:
    """All covariances of a weighted fit.

    Parameters
    ----------
    jacobian : ∂model/∂parameters (rows, all)
    weighted : residual (rows,)
    series : rows of each sensor of each record, in the order of time
    steps : number of the step of each row (rows,)
    own : parameters that are no sensor's offset
    levels : group of each row that shares a rounding, and that error over sigma (rows,)
    delays : parameters that are delays
    """
    white = covariance(jacobian)
    white = white + of_levels(jacobian, white, *levels)
    colour, freedom = of_colour(jacobian, weighted, series)
    found = of_steps(jacobian, weighted, steps)
    count = len(np.unique(steps)) - 1
    spread = float("nan")
    if found is not None:
        ratio = np.sqrt(np.diag(found)[own] / np.maximum(np.diag(white)[own], 1e-300))
        spread = float(np.median(ratio))
    late = None
    if found is not None and delays:
        error = stamp_error(jacobian[:, delays[0]], weighted, steps)
        late = np.nan_to_num(error) * late_steps(jacobian, white, steps, delays)
    return Uncertainty(white, colour, found, late, (freedom, float(count)), spread)


def whole_jacobian(solution: Solution) -> Array:
    """Weighted ∂model/∂(θ, linear) (rows, all)."""
    return np.hstack([solution.slope, solution.basis])


def covariance(jacobian: Array) -> Array:
    """Covariance of the parameters of a weighted fit (all, all): (JᵀJ)⁻¹.

    With the weights of the true noise this is the Cramér–Rao bound for Gaussian noise.
    """
    scale = np.linalg.norm(jacobian, axis=0)
    scale[scale == 0.0] = 1.0
    normal = (jacobian / scale).T @ (jacobian / scale)
    return np.asarray(np.linalg.pinv(normal, rcond=1e-13, hermitian=True) / np.outer(scale, scale))


def of_levels(jacobian: Array, cov: Array, group: NDArray[np.intp], size: Array) -> Array:
    """Covariance of the parameters by errors that all readings of a group share (all, all)."""
    shared = size > 0.0
    if not shared.any():
        return np.zeros_like(cov)
    _, number = np.unique(group[shared], return_inverse=True)
    pull = np.zeros((int(number.max()) + 1, jacobian.shape[1]))
    np.add.at(pull, number, jacobian[shared] * size[shared, None])
    return np.asarray(cov @ (pull.T @ pull) @ cov)


def of_steps(jacobian: Array, weighted: Array, steps: NDArray[np.intp]) -> Array | None:
    """Covariance of the parameters by leaving out one step after the other (all, all).

    Each takes one Gauss–Newton step from the estimate; no assumption on the noise is made but that
    one step does not know of another (MacKinnon and White, J. Econometrics 29, 1985, by clusters).
    None with fewer than four.

    Parameters
    ----------
    jacobian : weighted (rows, all)
    weighted : residual (rows,)
    steps : number of the step of each row (rows,)
    """
    _, steps = np.unique(steps, return_inverse=True)
    count = int(steps.max()) + 1
    if count < _FEWEST_STEPS:
        return None
    scale = np.linalg.norm(jacobian, axis=0)
    scale[scale == 0.0] = 1.0
    order = np.argsort(steps, kind="stable")
    edges = np.searchsorted(steps[order], np.arange(count + 1))
    j, r = jacobian[order] / scale, weighted[order]
    blocks = [slice(a, b) for a, b in itertools.pairwise(edges)]
    normal = np.array([j[b].T @ j[b] for b in blocks])  # (steps, all, all)
    pull = np.array([j[b].T @ r[b] for b in blocks])  # (steps, all)
    whole = normal.sum(axis=0)
    # an offset whose record is left out has no equation: a trace of the whole keeps it in place
    anchor = 1e-6 * whole
    anchor[np.diag_indices_from(anchor)] += np.where(np.diag(anchor) == 0.0, 1.0, 1e-12)
    moves = np.linalg.solve(whole - normal + anchor, -pull[:, :, None])[:, :, 0] / scale
    spread = np.cov(moves, rowvar=False, bias=True) * (count - 1)
    return np.asarray(np.atleast_2d(spread))


def late_steps(
    jacobian: Array, cov: Array, steps: NDArray[np.intp], delays: Sequence[int]
) -> Array:
    """What commands of one step that are dated a second late do to the parameters (steps, all)."""
    shift = jacobian[:, list(delays)].sum(axis=1)
    _, steps = np.unique(steps, return_inverse=True)
    pull = np.zeros((int(steps.max()) + 1, jacobian.shape[1]))
    np.add.at(pull, steps, jacobian * shift[:, None])
    return np.asarray(pull @ cov)


def freedom_of(late: Array, variance: Array, most: float) -> Array:
    """Degrees of freedom of the variances over steps (m,), of which late stamps are a part.

    `late` (steps, m) is what each step's error does to each figure, `most` what equal steps have.
    By design, not from the residual: with a fast gimbal the delay rests on the few steps of which a
    reading falls on the flank, and where these err alike by chance their scatter does not show it
    (Bell and McCaffrey, Survey Methodology 28, 2002).
    """
    square = late**2
    own = square.sum(axis=0) ** 2 / np.maximum((square**2).sum(axis=0), 1e-300) - 1.0
    part = np.minimum(square.sum(axis=0), variance)
    spread = part**2 / np.maximum(own, 1.0) + (variance - part) ** 2 / most
    return np.asarray(variance**2 / np.maximum(spread, 1e-300))


def of_colour(
    jacobian: Array, weighted: Array, series: Sequence[NDArray[np.intp]]
) -> tuple[Array | None, float]:
    """Covariance of the parameters under noise as coloured as the residual; degrees of freedom.

    Corrected for what the fit took from the residual. None where the residual is white.

    Parameters
    ----------
    series : rows of each sensor of each record, in the order of time
    """
    cov = covariance(jacobian)
    middle = np.zeros_like(cov)
    independent, coloured = 0.0, False
    for rows in series:
        known = autoregression(weighted[rows])
        if known is None:
            middle += jacobian[rows].T @ jacobian[rows]
            independent += len(rows)
            continue
        coefficients, power, rho = known
        shaped = _shaped(jacobian[rows], coefficients)
        middle += power * shaped.T @ shaped
        independent += len(rows) * (1.0 - rho) / (1.0 + rho)
        coloured |= rho > 3.0 / np.sqrt(len(rows))
    if not coloured:
        return None, np.inf
    freedom = max(independent - jacobian.shape[1], 3.0)
    return cov @ middle @ cov * (1.0 + jacobian.shape[1] / freedom), freedom


def autoregression(values: Array) -> tuple[Array, float, float] | None:
    """Coefficients (order,), power of the innovation and first autocorrelation; None if too few."""
    from scipy.linalg import solve_toeplitz

    n = len(values)
    if n < 10 * _ORDER:
        return None
    centred = values - values.mean()
    lags = np.array([centred[k:] @ centred[: n - k] / n for k in range(_ORDER + 1)])
    if lags[0] <= 0.0:
        return None
    lags[0] *= 1.0 + 1e-9
    found = np.asarray(solve_toeplitz(lags[:-1], lags[1:]))
    rho = float(np.clip(lags[1] / lags[0], 0.0, 0.995))
    return found, float(lags[0] - found @ lags[1:]), rho


def _shaped(jacobian: Array, coefficients: Array) -> Array:
    """Lᵀ·J, where L makes noise of the autoregression out of white noise."""
    from scipy.signal import lfilter

    filtered = lfilter([1.0], np.concatenate([[1.0], -coefficients]), jacobian[::-1], axis=0)
    return np.asarray(filtered[::-1])


def few(freedom: float) -> float:
    """How much wider an interval is for a deviation that is itself estimated (Student's t)."""
    from scipy.special import stdtrit

    return max(float(stdtrit(min(max(freedom, 1.0), 1e6), 0.975)) / _NORMAL, 1.0)


def stamp_error(slope: Array, weighted: Array, steps: NDArray[np.intp]) -> float:
    """How far each step's time is off beyond what its noise explains, root mean square [s].

    Parameters
    ----------
    slope : of the weighted model over the delay (rows,)
    """
    _, steps = np.unique(steps, return_inverse=True)
    power = np.bincount(steps, slope**2)
    told = power > 0.05 * power.max()
    if told.sum() < 2:
        return float("nan")
    late = np.bincount(steps, slope * weighted)[told] / power[told]
    return float(np.sqrt(max(np.var(late, ddof=1) - np.mean(1.0 / power[told]), 0.0)))


def propagated(function: Callable[[Array], Array], at: Array, cov: Array) -> Array:
    """Covariance of a function of the parameters (m, m)."""
    slope = slope_of(function, at, np.sqrt(np.clip(np.diag(cov), 0.0, None)))
    return np.asarray(slope @ cov @ slope.T)


def slope_of(function: Callable[[Array], Array], at: Array, spread: Array) -> Array:
    """Derivative of a function of the parameters (m, n), by central differences."""
    columns = []
    for i, step in enumerate(spread):
        shift = np.zeros(len(at))
        # a parameter that is not determined may deviate by more than its exponential can hold
        shift[i] = max(min(1e-3 * step, max(abs(at[i]), 1.0)), 1e-9 * abs(at[i]), 1e-12)
        columns.append((function(at + shift) - function(at - shift)) / (2.0 * shift[i]))
    return np.stack(columns, axis=1)
