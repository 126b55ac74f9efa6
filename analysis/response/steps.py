"""Step metrics from raw responses and from a model, in the words of ISO 9283 and stepinfo."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import ArrayLike, NDArray

from analysis.response.figure import Figure, over_repeats
from analysis.schema import AnalysisError

Array = NDArray[np.float64]

_PLATEAU = 1.0 / 3.0  # of the step's duration, at its end, is taken as rest
_BAND = 0.02  # settling band, of the change
_DEAD = 0.05  # of the change: the motion has begun
_REACHED = 0.9  # of the largest amplitude: a knee beyond is none
_NOISES = 3.0  # sigma: no band is narrower on measured data


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
    """

    rise_time: float
    settling_time: float
    overshoot: float
    peak: float
    peak_time: float
    dead_time: float
    static_error: float
    amplitude: float


_UNITS = {
    "rise_time": "s",
    "settling_time": "s",
    "overshoot": "%",
    "peak": "rad",
    "peak_time": "s",
    "dead_time": "s",
    "static_error": "rad",
}


def step_metrics(
    time: ArrayLike,
    response: ArrayLike,
    *,
    start: float,
    final: float,
    command_time: float = 0.0,
    command_change: float | None = None,
    noise: float = 0.0,
    band: float = _BAND,
) -> StepMetrics:
    """Metrics of one response, as MATLAB's `stepinfo` defines them.

    Parameters
    ----------
    time : [s] (n,), increasing
    response : (n,)
    start, final : values at rest before and after
    command_time : when the command stepped [s]
    command_change : by how much; the response's change if left out
    noise : standard deviation of the readings: the settling band is never below three of them
    band : settling band, of the change

    Raises
    ------
    AnalysisError
        for too few samples, and a response that does not move.
    """
    t, y = np.asarray(time, dtype=np.float64), np.asarray(response, dtype=np.float64)
    change = final - start
    if len(t) < 5 or t.shape != y.shape:
        raise AnalysisError(f"a step of {len(t)} samples; 5 or more are needed")
    if not math.isfinite(change) or abs(change) <= _NOISES * noise or change == 0.0:
        raise AnalysisError(f"the response moves by {change:g}, no more than its noise {noise:g}")
    rise = (y - start) / change
    half_band = max(band, _NOISES * noise / abs(change))
    outside = np.flatnonzero(np.abs(rise - 1.0) > half_band)
    top = int(np.argmax(rise))
    # single noisy readings do not begin a motion: crossings of measured data are last entries
    low, high = (_crossing(t, rise, level, noise > 0.0) for level in (0.1, 0.9))
    asked = change if command_change is None else command_change
    return StepMetrics(
        rise_time=high - low,
        settling_time=_settled(t, rise, outside, half_band) - command_time,
        overshoot=max(100.0 * (float(rise[top]) - 1.0), 0.0),
        peak=float(np.max(np.abs(y - start))),
        peak_time=float(t[top]) - command_time,
        dead_time=_crossing(t, rise, max(_DEAD, half_band), noise > 0.0) - command_time,
        static_error=asked - change,
        amplitude=asked,
    )


def _settled(t: Array, rise: Array, outside: NDArray[np.intp], band: float) -> float:
    if len(outside) == 0:
        return float(t[0])
    last = int(outside[-1])
    if last + 1 >= len(t):
        return math.nan
    a, b = abs(rise[last] - 1.0), abs(rise[last + 1] - 1.0)
    return float(t[last] + (t[last + 1] - t[last]) * (a - band) / (a - b))


def _crossing(t: Array, rise: Array, level: float, noisy: bool) -> float:
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
    """One cut-out step: the command changes at time zero."""

    time: Array
    response: Array
    before: Array  # readings just before
    command_before: float
    command_after: float


def cut_steps(
    time: ArrayLike,
    response: ArrayLike,
    command_time: ArrayLike,
    command: ArrayLike,
    *,
    shortest: float = 0.05,
) -> tuple[Step, ...]:
    """Cut a record into its steps; those shorter than `shortest` [s] or of few samples are left.

    Parameters
    ----------
    time, response : samples (n,); NaN readings are left out
    command_time, command : stamps and held values of one command (k,)
    """
    t, y = np.asarray(time, dtype=np.float64), np.asarray(response, dtype=np.float64)
    t, y = t[np.isfinite(y)], y[np.isfinite(y)]
    at, u = np.asarray(command_time, dtype=np.float64), np.asarray(command, dtype=np.float64)
    changes = np.flatnonzero(np.diff(u) != 0.0) + 1
    found = []
    for k, row in enumerate(changes):
        begin = float(at[row])
        end = float(at[changes[k + 1]]) if k + 1 < len(changes) else math.inf
        inside = (t >= begin) & (t < end)
        earlier = float(at[changes[k - 1]]) if k else -math.inf
        before = (t < begin) & (t > max(earlier, begin - 0.3 * (begin - max(earlier, t[0]))))
        if inside.sum() < 8 or t[inside][-1] - begin < shortest:
            continue
        rest = y[before] if before.any() else y[inside][:1]
        found.append(Step(t[inside] - begin, y[inside], rest, float(u[row - 1]), float(u[row])))
    return tuple(found)


def measure(step: Step) -> StepMetrics:
    """Metrics of a measured step: plateau means at both ends, noise from the final plateau."""
    count = max(int(len(step.time) * _PLATEAU), 3)
    plateau = step.response[-count:]
    start = float(step.before.mean())
    noise = float(np.std(np.diff(plateau)) / math.sqrt(2.0))
    return step_metrics(
        step.time,
        step.response,
        start=start,
        final=float(plateau.mean()),
        command_change=step.command_after - step.command_before,
        noise=noise,
    )


def step_figures(steps: Sequence[Step]) -> tuple[Figure, ...]:
    """Mean and interval of every metric over repeats, per approach direction and amplitude.

    Directions are `up` and `down`; names read `rise_time up`. Steps of one direction whose
    amplitudes lie within 5 % are repeats.

    Raises
    ------
    AnalysisError
        if there is no step, or none moves.
    """
    measured = []
    for step in steps:
        try:
            measured.append(measure(step))
        except AnalysisError:
            continue
    if not measured:
        raise AnalysisError(f"none of {len(steps)} steps moves beyond its noise")
    figures = []
    for group in _groups(measured):
        amplitude = float(np.mean([m.amplitude for m in group]))
        direction = "up" if amplitude > 0.0 else "down"
        for field in fields(StepMetrics):
            if field.name == "amplitude":
                continue
            values = [getattr(m, field.name) for m in group]
            name = f"{field.name} {direction}"
            figures.append(over_repeats(name, values, _UNITS[field.name], amplitude))
    return tuple(figures)


def _groups(measured: Sequence[StepMetrics]) -> list[list[StepMetrics]]:
    groups: list[list[StepMetrics]] = []
    for m in sorted(measured, key=lambda m: m.amplitude):
        if groups and abs(m.amplitude - groups[-1][0].amplitude) <= 0.05 * abs(m.amplitude):
            groups[-1].append(m)
        else:
            groups.append([m])
    return groups


def slew_figures(steps: Sequence[Step]) -> tuple[Figure, Figure]:
    """Slew rate and knee: the speed large steps reach, and the amplitude from which they do.

    The speed of every step is that of its straight part, between 20 and 80 % of the change. Below
    the knee it grows with the amplitude, above it stays; the two lines meet at the knee.

    Raises
    ------
    AnalysisError
        for fewer than four steps that move.
    """
    points = []
    for step in steps:
        try:
            m = measure(step)
        except AnalysisError:
            continue
        change = m.amplitude - m.static_error
        rise = (step.response - step.before.mean()) / change
        a, b = (_crossing(step.time, rise, level, noisy=True) for level in (0.2, 0.8))
        if b > a:
            points.append((abs(m.amplitude), 0.6 * abs(change) / (b - a)))
    if len(points) < 4:
        raise AnalysisError(f"{len(points)} steps that move; a slew rate needs 4 or more")
    amplitude, speed = np.array(sorted(points)).T
    ratio, limit = _knee(amplitude, speed)
    largest, knee = float(amplitude[-1]), limit / ratio
    if knee > _REACHED * largest:  # the line goes on to the largest step: no limit in sight
        return (
            over_repeats("slew_rate", speed[-1:], "rad/s", largest),
            Figure("slew_knee", math.nan, "rad", largest, len(points)),
        )
    return (
        over_repeats("slew_rate", speed[amplitude >= knee], "rad/s", largest),
        Figure("slew_knee", knee, "rad", largest, len(points)),
    )


def _knee(amplitude: Array, speed: Array) -> tuple[float, float]:
    """Slope and ceiling of speed = min(slope·amplitude, ceiling), least squares over all splits."""
    best, found = math.inf, (float(speed[-1] / amplitude[-1]), float(speed.max()))
    for split in range(1, len(speed)):
        low, high = slice(0, split), slice(split, None)
        slope = float(amplitude[low] @ speed[low] / (amplitude[low] @ amplitude[low]))
        ceiling = float(speed[high].mean())
        said = np.minimum(slope * amplitude, ceiling)
        loss = float(np.sum(((said - speed) / speed) ** 2))
        if loss < best:
            best, found = loss, (slope, ceiling)
    return found
