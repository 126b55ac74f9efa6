"""Fitted parameters as transfer functions and as the figures engineers quote, with deviations."""

from collections.abc import Callable
from functools import partial

import numpy as np

from analysis.array import Array
from analysis.identify.basis import denominator
from analysis.identify.evidence import ChannelFit, Estimate, ServoBounds
from analysis.identify.fit import AxisFit
from analysis.identify.servo import ServoFit
from analysis.identify.uncertainty import propagated

Figures = list[tuple[str, str, Callable[[Array], float]]]  # name, unit, value of the parameters


def linear(
    fit: AxisFit, cov: Array, output: str, inputs: tuple[str, ...]
) -> tuple[ChannelFit, ...]:
    """Channels into one axis."""
    layout, solution = fit.problem.layout, fit.solution
    found = []
    for j, name in enumerate(inputs):
        places = [*range(layout.group(j).start, layout.group(j).stop)]
        if j in layout.free_delays:
            places.append(layout.groups * layout.poles + layout.free_delays.index(j))
        first = layout.size + j * (layout.zeros + 1)
        places += range(first, first + layout.zeros + 1)
        whole = np.concatenate([solution.theta, solution.linear])
        parameters, own = whole[places], cov[np.ix_(places, places)]
        if j not in layout.free_delays:
            parameters = np.insert(parameters, layout.poles, layout.delays[j])
            own = np.insert(np.insert(own, layout.poles, 0.0, 0), layout.poles, 0.0, 1)
        found.append(_channel(parameters, own, layout.poles, layout.frequency, f"{output}/{name}"))
    return tuple(found)


def bounded(fit: ServoFit, cov: Array, output: str, command: str) -> tuple[ChannelFit, ServoBounds]:
    """Linear part and bounds of one servo."""
    n = fit.poles
    places = [*range(n + 1), n + 4]
    whole = np.concatenate([fit.theta, fit.linear])
    channel = _channel(whole[places], cov[np.ix_(places, places)], n, 1.0, f"{output}/{command}")
    std = np.sqrt(np.clip(np.diag(cov), 0.0, None))
    gain = abs(fit.gain)
    limit = fit.rate_limit * gain
    # limit and gain err together: the limit is that of the output
    pair = np.ix_([n + 1, n + 4], [n + 1, n + 4])
    slope = np.array([limit, limit / fit.gain])
    limit_std = float(np.sqrt(max(slope @ cov[pair] @ slope, 0.0)))
    return channel, ServoBounds(
        fit.structure,
        Estimate(f"{output} rate limit", limit, limit_std, "rad/s"),
        Estimate(f"{output} dead band", fit.dead_band, float(std[n + 2]), "rad"),
        Estimate(f"{output} backlash", fit.backlash, float(std[n + 3]) * gain, "rad"),
    )


def nothing(like: ChannelFit) -> ChannelFit:
    """A channel that passes nothing."""
    return ChannelFit((0.0,), like.den, 0.0, (), np.zeros(0), np.zeros((0, 0)))


def _channel(parameters: Array, cov: Array, poles: int, frequency: float, name: str) -> ChannelFit:
    num, den = polynomials(parameters, poles, frequency)
    figures = _figures(parameters, poles, frequency)
    values = np.array([value(parameters) for _, _, value in figures])
    spread = propagated(lambda p: np.array([v(p) for _, _, v in figures]), parameters, cov)
    std = np.sqrt(np.clip(np.diag(spread), 0.0, None))
    estimates = tuple(
        Estimate(f"{name} {what}", float(v), float(s), unit)
        for (what, unit, _), v, s in zip(figures, values, std, strict=True)
    )
    return ChannelFit(
        tuple(num.tolist()), tuple(den.tolist()), float(parameters[poles]), estimates,
        parameters, cov,
    )  # fmt: skip


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
