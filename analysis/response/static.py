"""Figures of a gimbal at rest: threshold, resolution, hysteresis, linearity, repeatability."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from analysis.response.figure import Figure, fitted_line, over_repeats, student
from analysis.response.metrics import Step
from analysis.schema import AnalysisError

_SURE = 3.0  # sigma: less is not called motion
_FAITHFUL = 0.5  # of the commanded step: less is not called resolved


def staircase_figures(steps: Sequence[Step], gain: float = 1.0) -> tuple[Figure, Figure]:
    """Threshold and resolution from ever smaller steps.

    Threshold: the smallest commanded step that, with every larger one, moves the gimbal beyond
    three standard errors. Resolution: the smallest that, with every larger one, moves it by at
    least half of what was asked. The interval runs from the largest step that failed; the amplitude
    is that of the largest step.

    Parameters
    ----------
    steps : cut from the staircase, any order; repeats of one amplitude must all succeed
    gain : angle per command at rest

    Raises
    ------
    AnalysisError : fewer than three amplitudes
    """
    points = [_moved(s) for s in steps]
    if len({round(p[0], 9) for p in points}) < 3:
        raise AnalysisError("a staircase needs steps of at least three amplitudes")
    moves = [(a, abs(m) > _SURE * e) for a, m, e in points]
    faithful = [(a, abs(m) > max(_SURE * e, _FAITHFUL * abs(gain) * a)) for a, m, e in points]
    return _smallest("threshold", moves), _smallest("resolution", faithful)


def _moved(step: Step) -> tuple[float, float, float]:
    """Commanded change, response in its direction, and that response's standard error."""
    rest = step.rest
    change = step.command_after - step.command_before
    move = (float(rest.mean()) - float(step.before.mean())) * math.copysign(1.0, change)
    sigma = math.hypot(
        float(rest.std(ddof=1)) / math.sqrt(len(rest)),
        float(step.before.std(ddof=1)) / math.sqrt(len(step.before))
        if len(step.before) > 1
        else float(rest.std(ddof=1)),
    )
    return abs(change), max(move, 0.0), max(sigma, 1e-12)


def _smallest(name: str, points: Sequence[tuple[float, bool]]) -> Figure:
    failed = [a for a, ok in points if not ok]
    limit = max(failed, default=0.0)
    above = sorted(a for a, ok in points if ok and a > limit * (1.0 + 1e-9))
    largest = max(a for a, _ in points)
    if not above:
        return Figure(name, math.nan, "rad", largest, len(points))
    return Figure(name, above[0], "rad", largest, len(points), (limit, above[0]))


def hysteresis(
    command: ArrayLike, angle: ArrayLike, direction: ArrayLike, places: int = 20
) -> Figure:
    """Mean gap between angles reached from below and from above at the same command [rad].

    Parameters
    ----------
    command, angle : at rest, or of a slow sweep (n,)
    direction : +1 where approached from below, −1 from above (n,)
    places : number of stretches of the stroke compared

    Raises
    ------
    AnalysisError : no command was approached from both sides
    """
    u, y, way = (np.asarray(x, dtype=np.float64) for x in (command, angle, direction))
    slope, offset, _ = fitted_line(u, y)
    left = y - slope * u - offset
    edges = np.linspace(u.min(), u.max(), places + 1)
    place = np.clip(np.searchsorted(edges, u, side="right") - 1, 0, places - 1)
    gaps = [
        left[(place == k) & (way < 0)].mean() - left[(place == k) & (way > 0)].mean()
        for k in range(places)
        if ((place == k) & (way < 0)).any() and ((place == k) & (way > 0)).any()
    ]
    if not gaps:
        raise AnalysisError("no command was approached from below and from above")
    return over_repeats("hysteresis", gaps, "rad", float(np.ptp(u)) / 2.0)


def linearity(command: ArrayLike, angle: ArrayLike) -> tuple[Figure, Figure, Figure]:
    """Gain, null offset [rad] and linearity [% of the range]: worst distance from the best line.

    A gimbal that did not move has a gain of zero and no linearity.
    """
    u, y = np.asarray(command, dtype=np.float64), np.asarray(angle, dtype=np.float64)
    slope, offset, left = fitted_line(u, y)
    amplitude, n = float(np.ptp(u)) / 2.0, len(u)
    scatter = student(n - 2) * math.sqrt(float(left @ left) / (n - 2))
    slope_half = scatter / math.sqrt(float(np.sum((u - u.mean()) ** 2)))
    offset_half = scatter * math.sqrt(1.0 / n + u.mean() ** 2 / np.sum((u - u.mean()) ** 2))
    reached = float(np.ptp(y))
    worst = 100.0 * float(np.abs(left).max()) / reached if reached else math.nan
    return (
        Figure("gain", slope, "1", amplitude, n, (slope - slope_half, slope + slope_half)),
        Figure("null offset", offset, "rad", amplitude, n,
               (offset - offset_half, offset + offset_half)),
        Figure("linearity", worst, "%", amplitude, n),
    )  # fmt: skip


def cross_coupling(gains: ArrayLike, names: Sequence[str] = ("x", "y")) -> tuple[Figure, ...]:
    """Motion of every other axis, of the commanded axis' own [%], from a gain matrix.

    Parameters
    ----------
    gains : rows are outputs, columns commands (q, q); gains at rest, or magnitudes at a frequency
    """
    g = np.asarray(gains, dtype=np.float64)
    if g.ndim != 2 or g.shape[0] != g.shape[1] or len(names) < len(g):
        raise AnalysisError(f"cross coupling needs a square gain matrix, not {g.shape}")
    return tuple(
        Figure(f"coupling {names[j]}→{names[i]}", 100.0 * float(g[i, j] / g[j, j]), "%", n=0)
        for j in range(len(g))
        for i in range(len(g))
        if i != j
    )


def repeatability(
    command: float, from_below: ArrayLike, from_above: ArrayLike = ()
) -> tuple[Figure, ...]:
    """Pose accuracy AP, repeatability RP per approach direction, and their distance vAP (ISO 9283).

    RP = l̄ + 3·S_l of the distances l from the mean of the attained angles; AP is that mean minus
    the command; vAP the distance between the means of both directions.

    Parameters
    ----------
    command : the angle asked for [rad]
    from_below, from_above : attained angles [rad], one per approach

    Raises
    ------
    AnalysisError : fewer than three approaches from every direction
    """
    figures, means = [], []
    for way, values in (("from below", from_below), ("from above", from_above)):
        attained = np.asarray(values, dtype=np.float64)
        if len(attained) == 0:
            continue
        if len(attained) < 3:
            raise AnalysisError(f"{len(attained)} approaches {way}; repeatability needs 3 or more")
        n, mean = len(attained), float(attained.mean())
        means.append(mean)
        distance = np.abs(attained - mean)
        figures.append(over_repeats(f"accuracy AP {way}", attained - command, "rad", command))
        rp = float(distance.mean() + 3.0 * distance.std(ddof=1))
        low, high = _spread_interval(n)
        figures.append(
            Figure(f"repeatability RP {way}", rp, "rad", command, n, (rp * low, rp * high))
        )
    if len(means) == 2:
        gap = abs(means[0] - means[1])
        figures.append(Figure("variation vAP", gap, "rad", command, 2))
    if not figures:
        raise AnalysisError("no approach to judge repeatability by")
    return tuple(figures)


def _spread_interval(n: int) -> tuple[float, float]:
    """Factors of the 95 % interval of a standard deviation of n Gaussian values."""
    from scipy.special import chdtri

    return (
        math.sqrt((n - 1) / float(chdtri(n - 1, 0.025))),
        math.sqrt((n - 1) / float(chdtri(n - 1, 0.975))),
    )


def cosine_loss(stroke: float) -> Figure:
    """Axial thrust lost at full stroke [%]: 1 − cos of the largest gimbal angle [rad]."""
    return Figure("cosine loss", 100.0 * (1.0 - math.cos(stroke)), "%", stroke, 0)
