"""What a model leaves unexplained: saturation of the speed, structure in the residual."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.array import Array
from analysis.identify.problem import noise as sensor_noise
from analysis.identify.problem.problem import Problem
from analysis.identify.problem.segments import step_of_row
from analysis.plain import Plain

STARTS = (0.05, 0.1, 0.2, 0.4, 0.8, 1.6)  # s; lengths of the start of a record
FEWEST_ROWS = 8  # of a start


@dataclass(frozen=True, slots=True)
class Saturation(Plain):
    """How the speed grows with the step, against a linear gimbal's.

    Attributes
    ----------
    exponent : of measured speed over the linear model's speed: 1 is linear, 0 a fixed speed
    std : of the exponent
    steps : number of steps compared
    range : largest over smallest amplitude
    saturated : None if the steps cannot tell
    """

    exponent: float
    std: float
    steps: int
    range: float
    saturated: bool | None


_UNKNOWN = Saturation(float("nan"), float("nan"), 0, 1.0, None)


def saturation(problem: Problem, predicted: Array) -> Saturation:
    """Compare the speed of every step with that of the linear model, over amplitude.

    Parameters
    ----------
    predicted : output of the linear model (rows,)
    """
    # the residual of a wrong model is no measure of the sensors' noise: differences are
    floor = sensor_noise.quantisation(problem)
    noise = sensor_noise.from_differences(problem, problem.weight > 0.0, floor)
    pairs = []
    steps = step_of_row(problem)
    for is_rate in (True, False):
        chosen = (problem.is_rate == is_rate) & (problem.weight > 0.0)
        for step in np.unique(steps[chosen]):
            rows = np.flatnonzero(chosen & (steps == step))
            pair = _speeds(problem, rows, predicted, is_rate, noise[int(is_rate)])
            if pair is not None:
                pairs.append(pair)
        if len(pairs) >= 4:
            break
    if len(pairs) < 4:
        return _UNKNOWN
    model, measured = np.array(pairs).T
    spread = float(model.max() / model.min())
    if spread < 1.5:
        return Saturation(float("nan"), float("nan"), len(pairs), spread, None)
    x, y = np.log(model), np.log(measured)
    x = x - x.mean()
    exponent = float(x @ y / (x @ x))
    off = y - y.mean() - exponent * x
    std = float(np.sqrt(off @ off / max(len(x) - 2, 1) / (x @ x)))
    return Saturation(exponent, std, len(pairs), spread, limited(exponent, std, spread))


def beginning(problem: Problem, residual: Array) -> float:
    """Residual (rows,) of the start of a record over the largest of an equal time after it, rms.

    The largest over records, sensors and lengths of the start. Near 1 where a record begins at rest
    under the command in force; large where the gimbal moved before.
    """
    most, counted = 0.0, problem.weight > 0.0
    weighed = residual * problem.weight
    for owner, part in enumerate(problem.parts):
        for is_rate in (False, True):
            rows = np.flatnonzero(counted & (problem.owner == owner) & (problem.is_rate == is_rate))
            if part.free or not len(rows):
                continue
            since = problem.time[rows] - part.time[0]
            for length in STARTS:
                count = int(np.searchsorted(since, length))
                if count < FEWEST_ROWS or length > 0.25 * since[-1]:
                    continue
                parts = weighed[rows[: len(rows) // count * count]].reshape(-1, count)
                rms = np.sqrt(np.mean(parts**2, axis=1))
                if rms[1:].max() > 0.0:
                    most = max(most, float(rms[0] / rms[1:].max()))
    return most


def limited(exponent: float, std: float, spread: float) -> bool:
    """Whether the speed grows less than the step, clearly and by an amount that matters.

    A tenth matters: of the exponent, or of the speed of the largest step, at the end of its 95 %
    interval that is nearer to a linear gimbal.

    Parameters
    ----------
    exponent, std : of speed over step, and its deviation
    spread : largest over smallest step
    """
    slower = 1.0 - spread ** (exponent + 1.96 * std - 1.0)
    return 1.0 - exponent > 3.0 * std and (exponent < 0.9 or slower > 0.1)


def _speeds(
    problem: Problem, rows: NDArray[np.intp], predicted: Array, is_rate: bool, noise: float
) -> tuple[float, float] | None:
    """Greatest speed of model and gimbal within a step, both over the same stretch of samples.

    The stretch is the shortest over which noise stays below a twentieth of the speed.
    """
    if len(rows) < 8:
        return None
    time, model, real = problem.time[rows], predicted[rows], problem.measured[rows]
    if is_rate:
        model, real = model - np.median(model), real - np.median(real)
    for stretch in (1, 2, 3, 5, 8, 12, 18, 27):
        if 2 * stretch + 1 > len(rows) // 2:
            return None
        if is_rate:
            speed = np.abs(_averaged(real, stretch))
            error = noise / np.sqrt(stretch)
            calculated = np.abs(_averaged(model, stretch))
        else:
            apart = _averaged(time, stretch)
            apart = apart[stretch:] - apart[:-stretch]
            speed = np.abs(_apart(real, stretch) / apart)
            calculated = np.abs(_apart(model, stretch) / apart)
            error = noise * np.sqrt(2.0 / stretch) / float(np.median(apart))
        if calculated.max() > 20.0 * error:
            return float(calculated.max()), float(speed.max())
    return None


def _averaged(values: Array, count: int) -> Array:
    total = np.concatenate([[0.0], np.cumsum(values)])
    return np.asarray((total[count:] - total[:-count]) / count)


def _apart(values: Array, count: int) -> Array:
    mean = _averaged(values, count)
    return np.asarray(mean[count:] - mean[:-count])


@dataclass(frozen=True, slots=True)
class Residuals(Plain):
    """What is left in the residual that a complete model would have taken.

    Attributes
    ----------
    autocorrelation : largest of lags 1 … 20, in magnitude
    whiteness : probability that white noise looks as coloured (Ljung–Box)
    cross_correlation : largest with the changes of the commands, in magnitude
    bound : what white noise stays below in 99 of 100 cases
    """

    autocorrelation: float
    whiteness: float
    cross_correlation: float
    bound: float


_LAGS = 20


def residual_tests(problem: Problem, weighted: Array, is_rate: bool) -> Residuals:
    """Test the residual of one sensor, sample after sample over all records.

    G. M. Ljung, G. E. P. Box, Biometrika 65 (1978); L. Ljung, "System Identification", 1999, 16.6.
    """
    from scipy.special import chdtrc, ndtri

    products, count, power = np.zeros(_LAGS + 1), 0, 0.0
    cross, moves = np.zeros((len(problem.parts[0].input.T), _LAGS + 1)), 0.0
    for index, part in enumerate(problem.parts):
        rows = np.flatnonzero(
            (problem.owner == index) & (problem.is_rate == is_rate) & (problem.weight > 0.0)
        )
        e = weighted[rows] - weighted[rows].mean() if len(rows) else weighted[rows]
        if len(e) <= _LAGS + 1:
            continue
        products += _lagged(e, e)
        count, power = count + len(e), power + float(e @ e)
        held = np.searchsorted(part.input_time, problem.time[rows], side="right") - 1
        change = np.diff(part.input[np.clip(held, 0, None)], axis=0, prepend=part.input[:1])
        cross += [_lagged(e, c) for c in change.T]
        moves = moves + np.sum(change**2, axis=0)
    if count == 0 or power == 0.0:
        return Residuals(0.0, 1.0, 0.0, 1.0)
    rho = products[1:] / products[0]
    q = count * (count + 2) * float(np.sum(rho**2 / (count - np.arange(1, _LAGS + 1))))
    scale = np.sqrt(power * np.where(moves > 0.0, moves, np.inf))
    largest = float(np.max(np.abs(cross) / np.atleast_1d(scale)[:, None]))
    bound = float(ndtri(1.0 - 0.005 / _LAGS) / np.sqrt(count))
    return Residuals(float(np.abs(rho).max()), float(chdtrc(_LAGS, q)), largest, bound)


def _lagged(a: Array, b: Array) -> Array:
    """Σ a(i + k)·b(i) over the lags k = 0 … 20."""
    size = 2 ** int(np.ceil(np.log2(len(a) + _LAGS + 1)))
    product = np.fft.rfft(a, size) * np.conj(np.fft.rfft(b, size))
    return np.asarray(np.fft.irfft(product, size)[: _LAGS + 1])
