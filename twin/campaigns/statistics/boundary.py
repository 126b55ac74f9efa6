"""The region of parameters in which a measure holds: its boundary, with its uncertainty."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from twin.campaigns.statistics.statistic import Estimate

Array = NDArray[np.float64]
SHARE = 0.9  # of flights that succeed, on the boundary
FEWEST = 10  # successes and failures without which there is no boundary
RESAMPLES, STEPS, STEPS_AGAIN = 60, 25, 4
RIDGE = 1e-2  # on the coefficients of scaled parameters, so that a clean separation stays finite
GRID = np.linspace(-1.0, 1.0, 81)  # scaled values along a parameter
FAR = 1e9  # scaled value of an end outside the range
FACTORS = 4.0, 100.0  # high over low of a range that is seen in logarithms


@dataclass(frozen=True)
class Property:
    """One parameter in the map.

    Attributes
    ----------
    name : of the parameter
    nominal : value that it has while the others vary
    values, share, low, high : probability along its range, the others nominal, and its band (n,)
    threshold : value at which the probability falls below `SHARE` on the way from the nominal
        value to the worse end, an infinite end of its interval where that lies outside the range;
        None where it does not
    better : +1 where larger values succeed more often, -1 otherwise
    """

    name: str
    nominal: float
    values: Array
    share: Array
    low: Array
    high: Array
    threshold: Estimate | None
    better: int

    @property
    def limit(self) -> str:
        """The threshold in words."""
        if (t := self.threshold) is not None:
            word = "at least" if self.better > 0 else "at most"
            ends = (f"{e:.3g}" if math.isfinite(e) else "open" for e in (t.low, t.high))
            return f"{word} {t.value:.3g} ({' to '.join(ends)})"
        order = np.argsort(self.values)
        here = np.interp(self.nominal, self.values[order], self.share[order])
        return "no limit in its range" if here >= SHARE else f"only {here:.0%} at the nominal value"

    @property
    def margin(self) -> float | None:
        """Nominal value over the threshold, or its inverse where less is better."""
        if self.threshold is None or self.threshold.value <= 0.0 or self.nominal <= 0.0:
            return None
        ratio = self.nominal / self.threshold.value
        return ratio if self.better > 0 else 1.0 / ratio


@dataclass(frozen=True)
class Frontier:
    """Boundary between two parameters, all others nominal.

    Attributes
    ----------
    x, y : names of the parameters
    at : values of x (n,)
    value, low, high : threshold of y there, and its band (n,); NaN where there is none
    """

    x: str
    y: str
    at: Array
    value: Array
    low: Array
    high: Array


class Region:
    """Region of parameters in which a measure holds, by logistic regression over all runs.

    The regression is quadratic with all products, or linear for a single parameter, on scaled
    parameters (logarithms of those with a wide range). Bands come from resampled runs.

    Attributes
    ----------
    properties : success over each parameter with a nominal value, or over all where none has one;
        the others are at their nominal value or median
    """

    def __init__(
        self,
        parameters: Mapping[str, Array],
        hits: Array,
        nominal: Mapping[str, float],
        confidence: float,
    ) -> None:
        self._names = list(parameters)
        self._scales = [_Scale(v) for v in parameters.values()]
        self._n, self._tail = len(hits), 0.5 - 0.5 * confidence
        pairs = zip(self._scales, parameters.values(), strict=True)
        z = np.stack([s(v) for s, v in pairs], axis=1)
        X = _features(z)
        self._fit = _logistic(X, hits, np.zeros(X.shape[1]), STEPS)
        rng = np.random.default_rng(self._n)
        many = []
        for _ in range(RESAMPLES):
            rows = rng.integers(0, self._n, self._n)
            many.append(_logistic(X[rows], hits[rows], self._fit, STEPS_AGAIN))
        self._many = np.array(many)
        self._better = [1 if np.corrcoef(c, hits)[0, 1] >= 0.0 else -1 for c in z.T]
        middle = [
            s(np.array([nominal.get(n, s.middle)]))[0]
            for n, s in zip(self._names, self._scales, strict=True)
        ]
        self._centre = np.clip(middle, -1.0, 1.0)
        shown = [n for n in self._names if n in nominal] or self._names
        self.properties = tuple(self._property(self._names.index(n)) for n in shown)

    def _property(self, k: int) -> Property:
        scale, (share, curves) = self._scales[k], self._along(k, self._centre)
        low, high = np.quantile(curves, [self._tail, 1.0 - self._tail], axis=1)
        values = scale.back(GRID)
        here = float(scale.back(self._centre[k : k + 1])[0])
        value, ends = self._thresholds(k, share, curves)
        threshold = None
        if not math.isnan(value):
            threshold = Estimate(value, *ends, self._n)
        return Property(self._names[k], here, values, share, low, high, threshold, self._better[k])

    def _along(self, k: int, centre: Array) -> tuple[Array, Array]:
        """Probability over the range of a parameter (n,), and of every resample (n, resamples)."""
        line = np.tile(centre, (len(GRID), 1))
        line[:, k] = GRID
        F = _features(line)
        return _sigmoid(F @ self._fit), _sigmoid(F @ self._many.T)

    def _thresholds(self, k: int, share: Array, curves: Array) -> tuple[float, tuple[float, float]]:
        """Threshold of a parameter and its interval; NaN where most resamples have none.

        An end is infinite where the resamples there have their threshold outside the range.
        """
        scale, better, centre = self._scales[k], self._better[k], float(self._centre[k])
        value = _threshold(share, centre, better)
        ends = [_threshold(c, centre, better) for c in curves.T]
        inside = np.isfinite(ends)
        if not math.isfinite(value) or inside.sum() <= RESAMPLES // 2:
            return math.nan, (math.nan, math.nan)
        outer = np.quantile(np.clip(ends, -FAR, FAR), [self._tail, 1.0 - self._tail])
        within = scale.back(np.clip(outer, -1.0, 1.0))
        a, b = np.where(np.abs(outer) > 1.0, np.copysign(np.inf, outer), within).tolist()
        return float(scale.back(np.array([value]))[0]), (a, b)

    def frontier(self, x: str, y: str) -> Frontier:
        """Boundary between two parameters."""
        i, k = self._names.index(x), self._names.index(y)
        rows = []
        for at in GRID:
            centre = self._centre.copy()
            centre[i] = at
            value, ends = self._thresholds(k, *self._along(k, centre))
            rows.append((value, *ends))
        value, low, high = np.array(rows).T
        return Frontier(x, y, self._scales[i].back(GRID), value, low, high)


def fewest(parameters: int) -> int:
    """Runs that a region needs: three for each coefficient of its regression."""
    return 3 * (1 + 2 * parameters + parameters * (parameters - 1) // 2)


def region(
    parameters: Mapping[str, Array],
    hits: Array,
    nominal: Mapping[str, float],
    confidence: float,
) -> Region | None:
    """The region in which a measure holds; None where runs, hits or misses are too few."""
    varied = {n: v for n, v in parameters.items() if np.ptp(v) > 0.0} if len(hits) else {}
    few = min(hits.sum(), len(hits) - hits.sum()) < FEWEST or len(hits) < fewest(len(varied))
    return None if few or not varied else Region(varied, hits, nominal, confidence)


class _Scale:
    """A parameter to -1 … 1 over its range, by its logarithm where the range is wide."""

    def __init__(self, values: Array) -> None:
        low, high = float(values.min()), float(values.max())
        self._log = low > 0.0 and FACTORS[0] < high / low < FACTORS[1]
        self.middle = float(np.median(values))
        if self._log:
            low, high = np.log(low), np.log(high)
        self._mid, self._half = 0.5 * (low + high), 0.5 * (high - low)

    def __call__(self, values: Array) -> Array:
        plain = np.log(np.maximum(values, 1e-300)) if self._log else values
        return np.asarray((plain - self._mid) / self._half)

    def back(self, scaled: Array) -> Array:
        plain = self._mid + self._half * scaled
        return np.exp(plain) if self._log else plain


def _features(z: Array) -> Array:
    """One, all parameters, and of several all their products of two (n, features)."""
    if z.shape[1] == 1:  # monotone
        return np.concatenate([np.ones((len(z), 1)), z], axis=1)
    i, j = np.triu_indices(z.shape[1])
    return np.concatenate([np.ones((len(z), 1)), z, z[:, i] * z[:, j]], axis=1)


def _sigmoid(x: Array) -> Array:
    return np.asarray(1.0 / (1.0 + np.exp(-np.clip(x, -40.0, 40.0))))


def _logistic(X: Array, y: Array, start: Array, steps: int) -> Array:
    """Coefficients of greatest penalised likelihood, by Newton's method with halved steps."""
    penalty = np.full(X.shape[1], RIDGE * 2.0)
    penalty[0] = 0.0
    w = start

    def loss(w: Array) -> float:
        x = X @ w
        return float(np.sum(np.logaddexp(0.0, x) - y * x) + 0.5 * penalty @ (w * w))

    now = loss(w)
    for _ in range(steps):
        p = _sigmoid(X @ w)
        H = (X * (p * (1.0 - p))[:, None]).T @ X + np.diag(penalty + 1e-9)
        step = np.linalg.solve(H, X.T @ (y - p) - penalty * w)
        size = 1.0
        while (new := loss(w + size * step)) > now and size > 1e-4:
            size *= 0.5
        w, change, now = w + size * step, now - new, new
        if change < 1e-8 * max(1.0, abs(now)):
            break
    return w


def _threshold(share: Array, centre: float, better: int) -> float:
    """Scaled value where the probability falls below `SHARE`, from the centre to the worse end.

    Infinite towards the worse end where it does not, towards the better one where it already is
    below at the centre.
    """
    z, s = (GRID, share) if better < 0 else (-GRID[::-1], share[::-1])  # worse to the right
    ahead = np.flatnonzero(z >= (centre if better < 0 else -centre) - 1e-9)
    below = ahead[s[ahead] < SHARE]
    if not below.size or below[0] == ahead[0]:
        return better * (math.inf if below.size else -math.inf)
    k = int(below[0])
    crossing = float(np.interp(-SHARE, [-s[k - 1], -s[k]], [z[k - 1], z[k]]))
    return crossing if better < 0 else -crossing
