"""What further commands would tell of a gimbal that is roughly known: the design of experiments.

The information of held commands is that of their changes: white noise of the readings, and a time
error of every change (a rig takes up a command when its next pulse frame begins). In the notation
of V. V. Fedorov, Theory of Optimal Experiments (1972), M = Jᵀ R⁻¹ J with R = σ² I + τ² G Gᵀ and G
the motion that one second of each change's own lateness makes.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from analysis.array import Array
from analysis.identify.evidence.evidence import ChannelFit
from analysis.identify.problem.basis import denominator

_STEP = 1e-4  # of a parameter, for slopes
_DECAY = 12.0  # time constants after which a motion is over
_REST = 0.4  # s before the first command
_LONGEST = 1e7  # s; a search ends there


@dataclass(frozen=True)
class Plant:
    """A channel as identified so far, and how its readings scatter.

    Attributes
    ----------
    channel : one transfer function without zeros, its delay free
    noise : of the angle readings [rad]
    late : time error of single changes, rms [s]
    period : of the readings [s]
    """

    channel: ChannelFit
    noise: float
    late: float
    period: float

    def answered(self, constants: float) -> float:
        """Time [s] from a command through the delay and some time constants of the slowest pole."""
        p = self.channel.parameters
        return float(p[-2] + constants / np.min(-denominator(p[:-2]).poles.real))

    def information(self, times: Array, levels: Array) -> Array:
        """Fisher information (p, p) of commands held from `times` (n,) [s] at `levels` (n,) [rad].

        Parameters are those of the channel; the angle sensor's offset is unknown.
        """
        p, size = self.channel.parameters, np.diff(levels, prepend=levels[0])
        begin, size = times[size != 0.0], size[size != 0.0]
        if not len(begin):
            return np.zeros((len(p), len(p)))
        span = self.answered(_DECAY)
        at = np.arange(max(times[0], begin[0] - _REST), begin[-1] + span, self.period)
        after = at[:, None] - begin[None, :]
        grid = np.arange(-0.01, span + 0.05, 2.5e-4)

        def moved(q: Array) -> Array:
            return np.asarray(np.interp(after, grid, _step(q, grid)) @ size)

        steps = _STEP * np.maximum(np.abs(p), 1e-2)
        J = np.column_stack([
            *((moved(p + d) - moved(p - d)) / (2.0 * d.sum()) for d in np.diag(steps)),
            np.ones(len(at)),
        ])  # fmt: skip
        G = np.interp(after, grid, np.gradient(_step(p, grid), grid)) * size
        M = J.T @ J
        if self.late > 0.0:
            cross = G.T @ J
            bound = G.T @ G + np.eye(len(size)) * (self.noise / self.late) ** 2
            M = M - cross.T @ np.linalg.solve(bound, cross)
        M = M / self.noise**2
        return np.asarray(M[:-1, :-1] - np.outer(M[:-1, -1], M[-1, :-1]) / M[-1, -1])


@dataclass(frozen=True)
class Wish:
    """A half width of a 95 % interval that is asked for.

    Attributes
    ----------
    name : one of `FIGURES`
    half : of a delay [s], of the others over their value
    """

    name: str
    half: float

    def now(self, channel: ChannelFit) -> float:
        """Half width as identified, in the wish's own unit.

        The bandwidth is no estimate; it is widened beyond the covariance as the worst one is.
        """
        # by their ends: names of axes and commands may have spaces
        given = {n: e.std for n in FIGURES for e in channel.estimates if e.name.endswith(f" {n}")}
        ratio = {
            n: 1.96 * given[n] / size / Wish(n, 0.0).deviation(channel, channel.covariance)
            for n, figure in FIGURES.items()
            if n in given
            for size in [1.0 if n == "delay" else abs(figure(channel.parameters))]
        }
        wider = ratio.get(self.name, max(ratio.values()))
        return wider * self.deviation(channel, channel.covariance)

    def deviation(self, channel: ChannelFit, covariance: Array) -> float:
        """Half width with a covariance of the channel's parameters, in the wish's own unit."""
        p, figure = channel.parameters, FIGURES[self.name]
        steps = np.diag(_STEP * np.maximum(np.abs(p), 1e-2))
        slope = np.array([(figure(p + d) - figure(p - d)) / (2.0 * d.sum()) for d in steps])
        scale = 1.0 if self.name == "delay" else abs(figure(p))
        return float(1.96 * np.sqrt(max(slope @ covariance @ slope, 0.0)) / scale)


def remaining(
    wish: Wish, plant: Plant, had: Array, more: Array, seconds: float
) -> tuple[Callable[[float], float], float]:
    """Expected half width after further motion [s], and how much of it the wish needs [s].

    Parameters
    ----------
    had : information of the commands so far (p, p), by the same formula as `more`
    more, seconds : information and length of the commands that would be repeated
    """
    now = wish.now(plant.channel)
    # what the formula lacks (coloured noise, friction, play) stays the same factor
    factor = now / wish.deviation(plant.channel, _inverse(had))

    def after(time: float) -> float:
        return factor * wish.deviation(plant.channel, _inverse(had + time / seconds * more))

    if now <= wish.half:
        return after, 0.0
    if after(_LONGEST) > wish.half:
        return after, float("inf")
    low, high = 0.0, _LONGEST
    while high - low > 0.01 * high + 0.1:
        middle = np.sqrt(max(low, 0.1) * high)
        low, high = (low, middle) if after(middle) <= wish.half else (middle, high)
    return after, float(high)


def _inverse(information: Array) -> Array:
    return np.asarray(np.linalg.pinv(information, hermitian=True), dtype=np.float64)


def _step(p: Array, time: Array) -> Array:
    """Answer to a unit step at 0 (n,) with parameters ln c, delay, numerator."""
    den = denominator(p[:-2])
    since = np.maximum(time - p[-2], 0.0)
    slope = np.polyval(np.polyder(den.coefficients), den.poles)
    parts = den.weight * p[-1] * den.coefficients[-1] / (slope * den.poles)
    motion = (parts * np.expm1(np.multiply.outer(since, den.poles))).sum(axis=1)
    return np.asarray(motion.real)


def _bandwidth(p: Array) -> float:
    """Frequency at which the gain is 3 dB below that at rest [rad/s]."""
    from scipy.optimize import brentq

    den = denominator(p[:-2]).coefficients

    def excess(log: float) -> float:
        return float(abs(den[-1] / np.polyval(den, 1j * np.exp(log))) - np.sqrt(0.5))

    middle = np.log(abs(den[-1])) / (len(den) - 1)
    return float(np.exp(brentq(excess, middle - 10.0, middle + 10.0)))


FIGURES: Mapping[str, Callable[[Array], float]] = MappingProxyType(
    {
        "gain": lambda p: float(p[-1]),
        "delay": lambda p: float(p[-2]),
        "bandwidth": _bandwidth,
        "natural frequency": lambda p: float(np.exp(p[1] / 2.0)),
        "damping": lambda p: float(0.5 * np.exp(p[0] - p[1] / 2.0)),
    }
)
