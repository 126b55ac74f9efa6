"""The region of parameters in which a measure holds: its boundary, with its uncertainty."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from twin.campaigns.statistic import Estimate

Array = NDArray[np.float64]
SHARE = 0.9  # of flights that succeed, on the boundary
FEWEST = 20  # successes and failures without which there is no boundary
RESAMPLES, STEPS, STEPS_AGAIN = 60, 25, 4
RIDGE = 1e-2  # on the coefficients of scaled parameters, so that a clean separation stays finite
POINTS = 121
FACTOR = 4.0  # a range of more than this is seen in logarithms


@dataclass(frozen=True)
class Property:
    """One parameter in the map.

    Attributes
    ----------
    name : of the parameter
    nominal : value that it has while the others vary
    values, share, low, high : probability along its range, the others nominal, and its band (n,)
    threshold : value where the probability is `SHARE`; None where it is nowhere in the range
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
    def margin(self) -> float | None:
        """Nominal value over the threshold, or its inverse where less is better."""
        if self.threshold is None or self.threshold.value <= 0.0 or self.nominal <= 0.0:
            return None
        ratio = self.nominal / self.threshold.value
        return ratio if self.better > 0 else 1.0 / ratio


def boundary(
    parameters: Mapping[str, Array],
    hits: Array,
    nominal: Mapping[str, float],
    confidence: float,
) -> tuple[Property, ...]:
    """Success over each parameter with the others nominal, from a logistic regression.

    The regression is quadratic with all products, on scaled parameters (logarithms of those with a
    wide range); the band comes from resampled runs. Empty where hits or misses are too few.
    """
    names = [n for n, v in parameters.items() if np.ptp(v) > 0.0]
    size = 1 + 2 * len(names) + len(names) * (len(names) - 1) // 2
    if min(hits.sum(), len(hits) - hits.sum()) < FEWEST or len(hits) < 3 * size:
        return ()
    scales = [_Scale(parameters[n]) for n in names]
    z = np.stack([s(parameters[n]) for s, n in zip(scales, names, strict=True)], axis=1)
    X = _features(z)
    fit = _logistic(X, hits, np.zeros(X.shape[1]), STEPS)
    rng = np.random.default_rng(len(hits))
    many = []
    for _ in range(RESAMPLES):
        rows = rng.integers(0, len(hits), len(hits))
        many.append(_logistic(X[rows], hits[rows], fit, STEPS_AGAIN))
    centre = np.array(
        [s(np.array([nominal.get(n, s.middle)]))[0] for s, n in zip(scales, names, strict=True)]
    )
    tail = 0.5 - 0.5 * confidence
    made = []
    for k, (name, scale) in enumerate(zip(names, scales, strict=True)):
        line = np.tile(np.clip(centre, -1.0, 1.0), (POINTS, 1))
        line[:, k] = np.linspace(-1.0, 1.0, POINTS)
        F = _features(line)
        share = _sigmoid(F @ fit)
        curves = _sigmoid(F @ np.array(many).T)  # (POINTS, RESAMPLES)
        low, high = np.quantile(curves, [tail, 1.0 - tail], axis=1)
        values = scale.back(line[:, k])
        better = 1 if share[-1] >= share[0] else -1
        found = _threshold(values, share, better)
        ends = [t for c in curves.T if (t := _threshold(values, c, better)) is not None]
        threshold = None
        if found is not None and len(ends) > RESAMPLES // 2:
            inner = np.quantile(ends, [tail, 1.0 - tail])
            threshold = Estimate(found, float(inner[0]), float(inner[1]), len(hits))
        here = float(scale.back(np.clip(centre[k : k + 1], -1.0, 1.0))[0])
        made.append(Property(name, here, values, share, low, high, threshold, better))
    return tuple(made)


class _Scale:
    """A parameter to -1 … 1 over its range, by its logarithm where the range is wide."""

    def __init__(self, values: Array) -> None:
        low, high = float(values.min()), float(values.max())
        self._log = low > 0.0 and high > FACTOR * low
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
    """One, all parameters, all their products of two (n, features)."""
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


def _threshold(values: Array, share: Array, better: int) -> float | None:
    """Value at which the probability crosses `SHARE` last on the way to the better end."""
    v, s = (values, share) if better > 0 else (values[::-1], share[::-1])
    below = np.flatnonzero(s < SHARE)
    if not below.size or below[-1] == len(s) - 1:
        return None
    k = int(below[-1])
    return float(np.interp(SHARE, s[k : k + 2], v[k : k + 2]))
