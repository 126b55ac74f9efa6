"""Slew rate: the speed of steps over their amplitude, and where it stops growing."""

import math
from collections.abc import Sequence

import numpy as np

from analysis.array import Array
from analysis.response.figure import ALIKE, Figure, over_repeats, student
from analysis.response.metrics import (
    FEWEST,
    Step,
    crossing,
    plateau_of,
)
from analysis.schema import AnalysisError

_FAR = 2.0  # times the knee
_REACHED = 0.9  # of the largest amplitude: a knee beyond is none
_CLEAR = 20.0  # times the noise: smaller steps have no speed


def slew_points(steps: Sequence[Step]) -> tuple[Array, Array]:
    """Amplitude [rad] and speed [rad/s] (n,) of every step that stands clear of its noise.

    The speed is that of the straight part, between 20 and 80 % of the change; sorted by amplitude.
    """
    points = []
    for step in steps:
        start = float(step.before.mean())
        final, noise = plateau_of(step)
        change = final - start
        if len(step.time) < FEWEST or not abs(change) > _CLEAR * noise:
            continue
        rise = (step.response - start) / change
        a, b = (crossing(step.time, rise, level, noisy=True) for level in (0.2, 0.8))
        if b > a:
            size = abs(step.command_after - step.command_before)
            points.append((size, 0.6 * abs(change) / (b - a)))
    amplitude, speed = np.array(sorted(points), dtype=np.float64).reshape(-1, 2).T
    return amplitude, speed


def slew_figures(steps: Sequence[Step]) -> tuple[Figure, Figure]:
    """Slew rate and knee: the speed large steps reach, and the amplitude from which they do.

    Below the knee the speed of a step grows with its amplitude, above it stays; the two lines meet
    at the knee. Where none is in sight the slew rate is the speed of the largest step.

    Raises
    ------
    AnalysisError : fewer than four steps that move
    """
    amplitude, speed = slew_points(steps)
    if len(amplitude) < 4:
        raise AnalysisError(f"{len(amplitude)} steps that move; a slew rate needs 4 or more")
    ratio, limit = _knee(amplitude, speed)
    largest, knee = float(amplitude[-1]), limit / ratio
    if knee > _REACHED * largest:  # the line goes on to the largest step: no limit in sight
        return (
            over_repeats("slew_rate", speed[amplitude > (1.0 - ALIKE) * largest], "rad/s", largest),
            Figure("slew_knee", math.nan, "rad", largest, len(amplitude)),
        )
    below = speed[amplitude < knee] / amplitude[amplitude < knee]
    far = amplitude >= _FAR * knee  # just above the knee a part of every step is still linear
    above = speed[far] if far.sum() > 1 else speed[amplitude >= knee]
    knee = float(above.mean()) / ratio
    half = knee * _spread(below, above)
    return (
        over_repeats("slew_rate", above, "rad/s", largest),
        Figure("slew_knee", knee, "rad", largest, len(amplitude), (knee - half, knee + half)),
    )


def _spread(*groups: Array) -> float:
    """Relative half width of a product or quotient of means; NaN if a group has no two values."""
    if min(map(len, groups)) < 2:
        return math.nan
    error = sum((g.std(ddof=1) / g.mean()) ** 2 / len(g) for g in groups)
    return student(sum(map(len, groups)) - len(groups)) * math.sqrt(float(error))


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
