"""Metrics of one step, measured or of a model, as ISO 9283 and MATLAB's stepinfo define them."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from analysis.array import Array
from analysis.schema import AnalysisError

BAND = 0.02  # settling band, of the change
DEAD = 0.05  # of the change: the motion has begun
FEWEST = 5  # samples of a step
DEAD_NOISES = 2.0  # sigma: no motion begins below
_NOISES = 3.0  # sigma: less is no motion
_TAIL = 0.7  # of the change: from here on a measured response is smoothed
_SURE = 0.99  # of steps: noise alone stays below the bound
_WINDOWS = (5, 7, 11, 15, 21, 31, 43, 61, 87, 123, 173, 245)  # samples, about √2 apart
_MOST = 1_000_000  # samples of one step


@dataclass(frozen=True, slots=True)
class StepMetrics:
    """Metrics of one step; times count from the command.

    Attributes
    ----------
    rise_time : from 10 to 90 % of the change [s]
    settling_time : until the response stays within the band around its final value [s]
    overshoot : beyond the final value, of the change [%]
    peak : largest excursion from the start [rad, or the response's unit]
    peak_time : when [s]
    dead_time : until 5 % of the change [s]
    static_error : command minus final value [as the response]
    amplitude : change of the command [as the response], signed
    hidden : overshoot that noise could hide or feign, of the change [%]; less is called none, and
        then the peak is the change and has no time
    noise : of the readings, of the change [1]; above 2.5 % the motion begins later than at 5 %
    """

    rise_time: float
    settling_time: float
    overshoot: float
    peak: float
    peak_time: float
    dead_time: float
    static_error: float
    amplitude: float
    hidden: float = 0.0
    noise: float = 0.0


def step_metrics(
    time: ArrayLike,
    response: ArrayLike,
    *,
    start: float,
    final: float,
    command_time: float = 0.0,
    command_change: float | None = None,
    noise: float = 0.0,
    band: float = BAND,
) -> StepMetrics:
    """Metrics of one response, as MATLAB's `stepinfo` defines them.

    Parameters
    ----------
    time : [s] (n,), increasing
    response : (n,)
    start, final : values at rest before and after
    command_time : when the command stepped [s]
    command_change : by how much; the response's change if left out
    noise : standard deviation of the readings. Where there is some, what lies beyond 70 % of the
        change is smoothed for it; the settling band is never below what noise is left
    band : settling band, of the change

    Raises
    ------
    AnalysisError : too few samples, and a response that does not move
    """
    t, y = np.asarray(time, dtype=np.float64), np.asarray(response, dtype=np.float64)
    change = final - start
    if len(t) < FEWEST or t.shape != y.shape:
        raise AnalysisError(f"a step of {len(t)} samples; {FEWEST} or more are needed")
    if not math.isfinite(change) or abs(change) <= _NOISES * noise or change == 0.0:
        raise AnalysisError(f"the response moves by {change:g}, no more than its noise {noise:g}")
    rise = (y - start) / change
    noisy, noise = noise > 0.0, noise / abs(change)
    # single noisy readings do not begin a motion: crossings of measured data are last entries
    low = crossing(t, rise, 0.1, noisy)
    dead = crossing(t, rise, max(DEAD, DEAD_NOISES * noise), noisy)
    bound = lift = 0.0
    if noisy:
        t, rise, bound, lift = _smoothed(t, rise, noise)
    half_band = max(band, bound)
    outside = np.flatnonzero(np.abs(rise - 1.0) > half_band)
    top = int(np.argmax(rise))
    over = float(rise[top]) - 1.0 - lift
    seen = over > bound or not noisy
    asked = change if command_change is None else command_change
    return StepMetrics(
        rise_time=crossing(t, rise, 0.9, noisy=False) - low,
        settling_time=_settled(t, rise, outside, half_band) - command_time,
        overshoot=100.0 * max(over, 0.0) if seen else 0.0,
        peak=abs(change) * (float(np.max(np.abs(rise))) - lift if seen else 1.0),
        peak_time=float(t[top]) - command_time if seen else math.nan,
        dead_time=dead - command_time,
        static_error=asked - change,
        amplitude=asked,
        hidden=100.0 * bound,
        noise=noise,
    )


def _smoothed(t: Array, rise: Array, noise: float) -> tuple[Array, Array, float, float]:
    """Time and response (n,), smoothed beyond 70 %; bound and lift of the noise that is left.

    The largest reading and the last departure of a raw record are those of its noise. Quadratics
    through a window (Savitzky and Golay 1964), passed twice, are compared with those of all
    narrower windows; where they differ by more than noise makes them, the window bends the response
    itself (Lepski's rule). One window narrower, a bias that grows with the fourth power is a
    quarter. The bound is what noise keeps to in 99 of 100 steps. The lift is what a maximum gains
    by being one: of a top of curvature c under noise of slope s, s²/2c in the mean.
    """
    from scipy.signal import savgol_coeffs, savgol_filter

    begin = crossing(t, rise, _TAIL, noisy=True)
    period = float(np.median(np.diff(t)))
    if not math.isfinite(begin) or not (period > 0.0 and t[-1] - t[0] < _MOST * period):
        return t, rise, noise * _sigmas(len(t)), 0.0
    even = np.arange(t[0], t[-1] + 0.5 * period, period)
    raw = np.interp(even, t, rise)
    tail = even >= begin
    count = int(tail.sum())
    margin = _WINDOWS[-1]  # beyond its end the record rests, which a window there must not guess
    padded = np.concatenate([np.full(margin, raw[0]), raw, np.ones(margin)])
    sure = noise * _sigmas(count * len(_WINDOWS))
    tried = [(1, raw, np.ones(1))]
    for width in _WINDOWS:
        once = savgol_coeffs(width, 2)
        weights = np.convolve(once, once)
        curve = savgol_filter(savgol_filter(padded, width, 2), width, 2)[margin:-margin]
        apart = [
            np.abs(curve - other)[tail].max(initial=0.0) / _apart(weights, narrow)
            for _, other, narrow in tried
        ]
        if width > count // 3 or max(apart) > sure:
            break
        tried.append((width, curve, weights))
    width, curve, weights = tried[max(len(tried) - 2, 0)]
    if width == 1:
        return even, raw, noise * _sigmas(count), 0.0
    bound = noise * float(np.linalg.norm(weights)) * _sigmas(2 * count // width)
    top = int(np.argmax(np.where(tail, curve, -math.inf)))
    bent = -float(savgol_filter(padded, width, 2, deriv=2)[margin + top])
    slope = noise * float(np.linalg.norm(np.diff(weights, prepend=0.0, append=0.0)))
    lift = min(0.5 * slope**2 / bent, bound) if bent > 0.0 else 0.0
    return even, np.where(tail, curve, raw), bound, lift


def _sigmas(count: int) -> float:
    """How many deviations `count` Gaussian values all keep to in 99 of 100 steps."""
    from scipy.special import ndtri

    return float(ndtri(1.0 - 0.5 * (1.0 - _SURE) / max(count, 1)))


def _apart(wide: Array, narrow: Array) -> float:
    """Deviation of the difference of two smoothings of the same noise of deviation one."""
    difference = wide.copy()
    margin = (len(wide) - len(narrow)) // 2
    difference[margin : len(wide) - margin] -= narrow
    return float(np.linalg.norm(difference))


def _settled(t: Array, rise: Array, outside: NDArray[np.intp], band: float) -> float:
    if len(outside) == 0:
        return float(t[0])
    last = int(outside[-1])
    if last + 1 >= len(t):
        return math.nan
    a, b = abs(rise[last] - 1.0), abs(rise[last + 1] - 1.0)
    return float(t[last] + (t[last + 1] - t[last]) * (a - band) / (a - b))


def crossing(t: Array, rise: Array, level: float, noisy: bool) -> float:
    """When the response first reaches a level, by linear interpolation.

    With noise: the last time below the level before the response first stands far above it.
    """
    above = np.flatnonzero(rise >= level)
    if len(above) == 0:
        return math.nan
    first = int(above[0])
    if noisy:
        sure = np.flatnonzero(rise >= level + 0.1 * (1.0 if level < 0.5 else 0.0))
        stop = int(sure[0]) if len(sure) else first
        below = np.flatnonzero(rise[: stop + 1] < level)
        first = int(below[-1]) + 1 if len(below) else first
    if first == 0:
        return float(t[0])
    a, b = rise[first - 1], rise[first]
    return float(t[first - 1] + (t[first] - t[first - 1]) * (level - a) / (b - a))


@dataclass(frozen=True, slots=True)
class Step:
    """One cut-out step: the command changes at time zero, which is `start` [s] of the record."""

    time: Array
    response: Array
    before: Array  # readings just before
    command_before: float
    command_after: float
    start: float = 0.0

    @property
    def rest(self) -> Array:
        """Readings of the last third, at least three: the plateau."""
        return self.response[-max(len(self.response) // 3, 3) :]


def measure(step: Step) -> StepMetrics:
    """Metrics of a measured step: plateau means at both ends, noise from the final plateau."""
    final, noise = plateau_of(step)
    return step_metrics(
        step.time,
        step.response,
        start=float(step.before.mean()),
        final=final,
        command_change=step.command_after - step.command_before,
        noise=noise,
    )


def plateau_of(step: Step) -> tuple[float, float]:
    """Mean of the end of a step, and the deviation of its noise."""
    return float(step.rest.mean()), float(np.std(np.diff(step.rest)) / math.sqrt(2.0))
