"""Step metrics from raw responses and from a model, in the words of ISO 9283 and stepinfo."""

import math
from collections.abc import Sequence
from dataclasses import fields, replace

import numpy as np
from numpy.typing import ArrayLike

from analysis.response.figure import ALIKE, Figure, over_repeats
from analysis.response.metrics import (
    BAND,
    DEAD,
    DEAD_NOISES,
    Step,
    StepMetrics,
    measure,
)
from analysis.schema import AnalysisError

_UNITS = {
    "rise_time": "s",
    "settling_time": "s",
    "overshoot": "%",
    "peak": "rad",
    "peak_time": "s",
    "dead_time": "s",
    "static_error": "rad",
}


# of a step; never below zero, nor is the interval of its mean
_POSITIVE = ("rise_time", "settling_time", "overshoot", "peak", "peak_time", "dead_time")
_FOLLOWED = 0.5  # of what the largest step moves per command; less is a step within the backlash


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
        change = float(u[row - 1]), float(u[row])
        found.append(Step(t[inside] - begin, y[inside], rest, *change, begin))
    return tuple(found)


def step_figures(steps: Sequence[Step]) -> tuple[Figure, ...]:
    """Mean and interval of every metric over repeats, per approach direction and amplitude.

    Directions are `up` and `down`; names read `rise_time up`. Steps of one direction whose
    amplitudes lie within 5 % are repeats. A step within the backlash, which moves less than half of
    what the largest one moves per command, has a static error and nothing else.

    Raises
    ------
    AnalysisError : there is no step, or none moves
    """
    measured = []
    for step in steps:
        try:
            measured.append(measure(step))
        except AnalysisError:
            continue
    if not measured:
        raise AnalysisError(f"none of {len(steps)} steps moves beyond its noise")
    largest = max(measured, key=lambda m: abs(m.amplitude))
    measured = [_followed(m, _ratio(largest)) for m in measured]
    figures = []
    for group in _groups(measured):
        amplitude = float(np.mean([m.amplitude for m in group]))
        direction = "up" if amplitude > 0.0 else "down"
        for field in fields(StepMetrics):
            if field.name not in _UNITS:
                continue
            values = [getattr(m, field.name) for m in group]
            name = f"{field.name} {direction}"
            if field.name == "peak_time" and np.mean(np.isfinite(values)) <= 0.5:
                values = []  # what most repeats do not have is noise in the others
            found = over_repeats(name, values, _UNITS[field.name], amplitude)
            if field.name in _POSITIVE:
                low, high = found.interval
                found = replace(found, interval=(0.0 if low < 0.0 else low, high))
            if field.name in ("overshoot", "peak"):
                found = up_to_hidden(found, group)
            if field.name in ("settling_time", "dead_time") and _wider(field.name, group):
                # another band than that of a step without noise, and so not to be held against it
                found = replace(found, interval=(math.nan, math.nan))
            figures.append(found)
    return tuple(figures)


def _ratio(m: StepMetrics) -> float:
    """Change per change of the command."""
    return 1.0 - m.static_error / m.amplitude if m.amplitude else 1.0


def _followed(m: StepMetrics, gain: float) -> StepMetrics:
    """Metrics of a step, without those of a motion where the gimbal did not follow it."""
    if _ratio(m) / gain > _FOLLOWED:
        return m
    return replace(m, hidden=0.0, **dict.fromkeys(_POSITIVE, math.nan))


def _wider(name: str, group: Sequence[StepMetrics]) -> bool:
    """Whether noise widened the band that a time is counted to, in the mean of the repeats."""
    if name == "settling_time":  # to a band half as wide again, intervals still hold the truth
        return float(np.mean([m.hidden for m in group])) > 150.0 * BAND
    return DEAD_NOISES * float(np.mean([m.noise for m in group])) > DEAD


def up_to_hidden(figure: Figure, group: Sequence[StepMetrics]) -> Figure:
    """The interval reaches what noise may have hidden: zeros that agree are no certainty."""
    scale = 1.0 if figure.unit == "%" else 0.01 * abs(figure.amplitude)
    hidden = scale * sum(m.hidden for m in group if m.overshoot == 0.0) / len(group)
    low, high = figure.interval
    if hidden == 0.0:
        return figure
    reach = figure.value + hidden
    interval = (figure.value, reach) if math.isnan(high) else (low, max(high, reach))
    return replace(figure, interval=interval)


def _groups(measured: Sequence[StepMetrics]) -> list[list[StepMetrics]]:
    groups: list[list[StepMetrics]] = []
    for m in sorted(measured, key=lambda m: m.amplitude):
        if groups and abs(m.amplitude - groups[-1][0].amplitude) <= ALIKE * abs(m.amplitude):
            groups[-1].append(m)
        else:
            groups.append([m])
    return groups
