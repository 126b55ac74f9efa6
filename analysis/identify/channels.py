"""Fitted parameters as transfer functions and as the figures engineers quote, with deviations."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial

import numpy as np

from analysis.array import Array
from analysis.identify.evidence.evidence import ChannelFit, Estimate, ServoBounds
from analysis.identify.evidence.uncertainty import Uncertainty, propagated, slope_of
from analysis.identify.evidence.unexplained import over_sizes, smeared
from analysis.identify.linear.fit import AxisFit
from analysis.identify.problem.basis import denominator
from analysis.identify.problem.problem import Problem
from analysis.identify.servo.fit import ServoFit

_STEP = 1e-3  # deviation of a parameter for slopes, as in `slope_of`
# deviations: a gain of noise, where delay and poles were searched for the largest, stays below
SHOWN = 4.0
_TRACE = 1e-9  # of a variance

Figures = list[tuple[str, str, Callable[[Array], float]]]  # name, unit, value of the parameters


def linear(
    fit: AxisFit, known: Uncertainty, output: str, inputs: tuple[str, ...], longest: float
) -> tuple[ChannelFit, ...]:
    """Channels into one axis."""
    layout, solution = fit.problem.layout, fit.solution
    whole = np.concatenate([solution.theta, solution.linear])
    found = []
    for j, name in enumerate(inputs):
        places = _places(fit, j)
        given = None if j in layout.free_delays else layout.delays[j]
        found.append(
            _channel(
                whole, places, known, f"{output}/{name}", longest, layout.poles,
                layout.frequency, given, fit.problem.doubt,
            )
        )  # fmt: skip
    return tuple(found)


def changes(fit: AxisFit, jacobian: Array, j: int) -> tuple[Estimate, ...]:
    """What poles and delay of a channel change by from the smallest to the largest step."""
    if j not in fit.problem.layout.free_delays:
        return ()
    seen = over_sizes(fit.problem, jacobian, fit.solution.weighted, _places(fit, j), j)
    if seen is None:
        return ()
    figures, slope = _slopes(fit, j)
    values, std = slope @ seen[0], np.sqrt(np.diag(slope @ seen[1] @ slope.T))
    return tuple(
        Estimate(what, float(v), float(s), unit)
        for (what, unit, _), v, s in zip(figures, values, std, strict=True)
    )


def smear(fit: AxisFit, jacobian: Array, j: int, stamps: float) -> dict[str, float]:
    """What steps at scattered times change poles and delay of a channel by, as their mean answer.

    Parameters
    ----------
    stamps : scatter of the times [s], NaN where the steps show none
    """
    if j not in fit.problem.layout.free_delays or not stamps > 0.0:
        return {}
    change = smeared(fit.problem, fit.solution, jacobian, fit.problem.layout.delay_place(j), stamps)
    figures, slope = _slopes(fit, j)
    values = slope @ change[_places(fit, j)]
    return {what: float(v) for (what, _, _), v in zip(figures, values, strict=True)}


def _slopes(fit: AxisFit, j: int) -> tuple[Figures, Array]:
    """Figures of a channel's poles and delay, and their derivatives by its parameters."""
    layout, solution = fit.problem.layout, fit.solution
    at = np.concatenate([solution.theta, solution.linear])[_places(fit, j)]
    figures = _figures(at, layout.poles, layout.frequency)[1:]  # the gain is another matter
    step = np.full(len(at), _STEP)
    return figures, slope_of(lambda p: np.array([f(p) for _, _, f in figures]), at, step)


def _places(fit: AxisFit, j: int) -> list[int]:
    """Places of a channel's parameters among all: poles, delay where it is free, numerator."""
    layout = fit.problem.layout
    group, numerator = layout.group(j), layout.numerator(j)
    found = [*range(group.start, group.stop)]
    if j in layout.free_delays:
        found.append(layout.delay_place(j))
    return [*found, *range(layout.size + numerator.start, layout.size + numerator.stop)]


def bounded(
    fit: ServoFit,
    known: Uncertainty,
    output: str,
    command: str,
    longest: float,
    most: Mapping[str, float],
) -> tuple[ChannelFit, ServoBounds]:
    """Linear part and bounds of one servo; of an idle limit, its bound from below.

    Parameters
    ----------
    most : how large a dead band or backlash of zero may be, on the command's side [rad]
    """
    n = fit.poles
    whole = np.concatenate([fit.theta, fit.linear])
    given = None if fit.problem.layout.free_delays else float(fit.theta[n])
    count = len(fit.theta)
    places = [*range(n + 1), count] if given is None else [*range(n), count]
    channel = _channel(
        whole, places, known, f"{output}/{command}", longest, n, 1.0, given, fit.problem.doubt
    )
    # limits and gain err together: the limits are those of the output
    behind = fit.structure == "set-point"
    parts = [n + 1, n + 2, n + 3, count, *([n + 4, n + 5] if behind else [])]

    def bounds(p: Array) -> Array:
        gain = abs(p[3])
        found = [np.exp(p[0]) * gain, p[1], p[2] * gain]
        if behind:
            back = np.exp(p[0] + p[5]) * gain
            if p[3] < 0.0:
                found[0], back = back, found[0]
            found += [back, np.exp(p[4]) * gain]
        return np.array(found)

    values = bounds(whole[parts])
    std = known.deviations(bounds, whole[parts], parts, np.zeros(len(parts)))
    names = (
        ("rate limit", "rad/s"),
        ("dead band", "rad"),
        ("backlash", "rad"),
        ("rate limit back", "rad/s"),
        ("slew of the set point", "rad/s"),
    )
    least = {n: v * abs(fit.gain) for n, v in fit.idle.items()}
    if behind and fit.gain < 0.0:  # upward of the output is downward of the command
        turned = {"rate limit": "rate limit back", "rate limit back": "rate limit"}
        least = {turned.get(n, n): v for n, v in least.items()}
    upper = {n: v * (abs(fit.gain) if n == "backlash" else 1.0) for n, v in most.items()}
    estimates = [
        Estimate(f"{output} {what}", least[what], np.nan, unit, False, True)
        if what in least
        else Estimate(
            f"{output} {what}", 0.0, upper[what] / 1.96, unit, bool(np.isfinite(upper[what]))
        )
        if what in upper
        else Estimate(f"{output} {what}", float(v), float(s), unit, not 1.96 * s > abs(v) > 0.0)
        for (what, unit), v, s in zip(names, values, std, strict=False)
    ]

    def figures(p: Array) -> Array:
        own = p[places] if given is None else np.insert(p[places], n, given)
        return np.concatenate(
            [[value(own) for *_, value in _figures(own, n, 1.0)], bounds(p[parts])]
        )

    size = len(whole)
    every = known.covariance[:size, :size].copy()
    if given is None:
        every[n, n] += fit.problem.doubt**2
    stds = np.nan_to_num([e.std for e in (*channel.estimates, *estimates)])
    joint = _scaled(propagated(figures, whole, every), stds)
    return replace(channel, joint=joint), ServoBounds(fit.structure, fit.losses, *estimates)


def nothing(like: ChannelFit, found: tuple[Estimate, ...] = ()) -> ChannelFit:
    """A channel that passes nothing, with what is known of its gain."""
    return ChannelFit((0.0,), like.den, 0.0, found, np.zeros(0), np.zeros((0, 0)))


def absent(fit: AxisFit, problem: Problem, column: int, like: ChannelFit, name: str) -> ChannelFit:
    """A channel that the readings do not show, with the interval of its gain around zero.

    Parameters
    ----------
    problem : with all commands
    like : the channel whose motion the absent one's is taken to be a multiple of
    """
    one = problem.weighed(fit.problem.weight).channels((column,), (0,))
    theta = fit.solution.theta[fit.problem.layout.group(0)]
    if one.layout.free_delays:
        theta = np.append(theta, like.delay)
    column_of = one.driven(theta, np.ones(1)) * one.weight
    rest = fit.solution.basis
    column_of = column_of - rest @ np.linalg.lstsq(rest, column_of, rcond=1e-9)[0]
    power = max(float(column_of @ column_of), 1e-300)
    gain = float(column_of @ fit.solution.weighted) / power
    return nothing(
        like, (Estimate(f"{name} gain", 0.0, float(np.hypot(gain, power**-0.5)), "rad/rad"),)
    )


def _channel(
    whole: Array,
    places: list[int],
    known: Uncertainty,
    name: str,
    longest: float,
    poles: int,
    frequency: float,
    given: float | None,
    doubt: float,
) -> ChannelFit:
    """One channel of the parameters at `places`; `given` is a delay that was not searched."""

    def parameters_of(own: Array) -> Array:
        return own if given is None else np.insert(own, poles, given)

    at = whole[places]
    parameters = parameters_of(at)
    figures = _figures(parameters, poles, frequency)
    doubts = np.zeros(len(places))
    if given is None:
        doubts[poles] = doubt  # the stamps of all commands are off alike

    def values_of(own: Array) -> Array:
        return np.array([value(parameters_of(own)) for _, _, value in figures])

    std = known.deviations(values_of, at, places, doubts)
    own = known.covariance[np.ix_(places, places)] + np.diag(doubts**2)
    joint = _scaled(propagated(values_of, at, own), std)
    if given is not None:
        own = np.insert(np.insert(own, poles, 0.0, 0), poles, 0.0, 1)
    num, den = polynomials(parameters, poles, frequency)
    lag = den[-2] / den[-1]
    values = values_of(at)
    answers = bool(abs(values[0]) > SHOWN * std[0])  # noise has no delay
    estimates = tuple(
        Estimate(
            f"{name} {what}", float(v), float(s), unit,
            _determined(what, v, s, longest, lag) and (answers or what == "gain"),
        )
        for (what, unit, _), v, s in zip(figures, values, std, strict=True)
    )  # fmt: skip
    return ChannelFit(
        tuple(num.tolist()), tuple(den.tolist()), float(parameters[poles]), estimates,
        parameters, own, joint,
    )  # fmt: skip


def _scaled(covariance: Array, std: Array) -> Array:
    """A covariance (n, n) with these deviations (n,), its correlations kept.

    Positive definite by a trace also where two figures vary as one, such as gain and rate limit.
    """
    now, std = np.sqrt(np.clip(np.diag(covariance), 0.0, None)), np.minimum(std, 1e100)
    scale = np.divide(std, now, out=np.zeros(len(std)), where=now > 0.0)
    return np.asarray(covariance * np.outer(scale, scale) + np.diag(_TRACE * std**2))


def _determined(what: str, value: float, std: float, longest: float, lag: float) -> bool:
    """Whether an interval leaves anything out: zero for what is positive, half of all delays.

    One from no delay to more than the lag of all poles [s] tells nothing of a delay either.
    """
    half = 1.96 * std
    if what == "gain":
        return True
    if what == "delay":
        return bool(half < min(0.5 * longest, max(lag, value)))
    return bool(half < abs(value))


def polynomials(parameters: Array, poles: int, frequency: float) -> tuple[Array, Array]:
    """Numerator and denominator, descending powers, of a channel's parameters."""
    den = denominator(parameters[:poles]).coefficients
    b = parameters[poles + 1 :]
    num = den[-1] * b / frequency ** np.arange(len(b))
    return num[::-1], den


def _frequency(k: int, p: Array) -> float:
    return float(np.exp(p[k + 1] / 2.0))


def _damping(k: int, p: Array) -> float:
    return float(np.exp(p[k] - p[k + 1] / 2.0) / 2.0)


def _figures(parameters: Array, poles: int, frequency: float) -> Figures:
    found: Figures = [
        ("gain", "rad/rad", lambda p: float(p[poles + 1])),
        ("delay", "s", lambda p: float(p[poles])),
    ]
    for k in range(0, poles - 1, 2):
        label = "" if poles < 4 else f" {k // 2 + 1}"
        found += [
            (f"natural frequency{label}", "rad/s", partial(_frequency, k)),
            (f"damping{label}", "1", partial(_damping, k)),
        ]
    if poles % 2:
        found.append(("time constant", "s", lambda p: float(np.exp(-p[poles - 1]))))
    zeros = len(parameters) - poles - 2
    if zeros == 1 and abs(parameters[poles + 2]) > 1e-12:
        found.append(("zero", "rad/s", lambda p: float(-p[poles + 1] * frequency / p[poles + 2])))
    return found
