"""Figures of an identified channel: step metrics, bandwidth, phase, delay."""

import math
from collections.abc import Callable

import numpy as np

from analysis.array import Array
from analysis.response.figure import Figure
from analysis.response.metrics import StepMetrics, step_metrics
from analysis.schema import AnalysisError
from analysis.transfer_function import Channel

_POINTS = 50_001  # over the horizon: linear interpolation then errs by 1e-8 of a rise
_HORIZON = 12.0  # slowest time constants: e⁻¹² of the change is left
_UNITS = {
    "rise_time": "s", "settling_time": "s", "overshoot": "%", "peak": "1", "peak_time": "s",
    "dead_time": "s", "static_error": "1",
}  # fmt: skip


def step_response(channel: Channel, horizon: float | None = None) -> tuple[Array, Array]:
    """Time [s] and response (n,) to a unit step, on a grid as fine as the metrics need.

    Raises
    ------
    AnalysisError : the channel is not stable
    """
    import control

    poles = channel.poles
    if len(poles) and poles.real.max() >= 0.0:
        raise AnalysisError(f"a pole at {poles.real.max():g} rad/s: no step response settles")
    slowest = 1.0 / -poles.real.max() if len(poles) else 1e-3
    time = np.linspace(0.0, horizon or _HORIZON * slowest, _POINTS)
    _, response = control.step_response(control.ss(channel.system()), time)
    late = time + channel.delay
    return np.concatenate([[0.0], late]), np.concatenate([[0.0], np.asarray(response)])


def model_step_metrics(channel: Channel, band: float = 0.02) -> StepMetrics:
    """Step metrics of a unit step, as MATLAB's `stepinfo`; `static_error` is 1 − gain."""
    time, response = step_response(channel)
    gain = channel.num[-1] / channel.den[-1]
    return step_metrics(time, response, start=0.0, final=gain, command_change=1.0, band=band)


def model_figures(channel: Channel) -> tuple[Figure, ...]:
    """Every figure of a channel: step metrics of a unit step and the frequency response's."""
    metrics = model_step_metrics(channel)
    found = [
        Figure(name, float(getattr(metrics, name)), unit, math.nan, 0)
        for name, unit in _UNITS.items()
    ]
    return (*found, *frequency_figures(channel))


def frequency_figures(channel: Channel) -> tuple[Figure, ...]:
    """Bandwidth (−3 dB), −90° frequency, phase lag at 1 Hz and equivalent delay of a channel.

    The equivalent delay is the pure delay with the same phase lag at 1 Hz; gain margins are those
    of whoever closes a loop around it.
    """
    one = 2.0 * math.pi
    lag = -_phase(channel, np.array([one]))[0]
    values = (
        ("bandwidth", bandwidth(channel) / one, "Hz"),
        ("-90° frequency", phase_frequency(channel, -90.0) / one, "Hz"),
        ("phase lag at 1 Hz", math.degrees(lag), "deg"),
        ("equivalent delay", lag / one, "s"),
    )
    return tuple(Figure(name, value, unit, math.nan, 0) for name, value, unit in values)


def bandwidth(channel: Channel, drop_db: float = 3.0103) -> float:
    """Frequency [rad/s] at which the gain first falls by `drop_db` below that at rest."""
    at_rest = abs(channel.num[-1] / channel.den[-1])
    level = at_rest * 10.0 ** (-drop_db / 20.0)
    return _first(lambda w: np.abs(channel.frequency_response(w)) - level, channel)


def phase_frequency(channel: Channel, degrees: float) -> float:
    """Frequency [rad/s] at which the phase first falls to an angle [°], delay included."""
    return _first(lambda w: _phase(channel, w) - math.radians(degrees), channel)


def _grid(channel: Channel) -> Array:
    scale = np.abs(np.roots(channel.den))
    low = 1e-3 * float(scale.min()) if len(scale) else 1e-3
    high = 1e3 * float(scale.max()) if len(scale) else 1e3
    if channel.delay > 0.0:
        low, high = min(low, 1e-2 / channel.delay), max(high, 20.0 / channel.delay)
    return np.geomspace(low, high, 20_000)


def _phase(channel: Channel, omega: Array) -> Array:
    """Unwrapped phase [rad] (n,): zeros and poles one by one, so that no grid is too coarse."""
    s = 1j * omega
    total = -omega * channel.delay
    gain = channel.num[-1] / channel.den[-1]
    for roots, sign in ((np.roots(channel.num), 1.0), (np.roots(channel.den), -1.0)):
        for root in roots:
            total = total + sign * np.angle((s - root) / -root if root != 0.0 else s)
    return total + (math.pi if gain < 0.0 else 0.0)


def _first(value: Callable[[Array], Array], channel: Channel) -> float:
    """First downward crossing of zero over frequency; NaN if there is none."""
    from scipy.optimize import brentq

    grid = _grid(channel)
    below = np.flatnonzero(value(grid) <= 0.0)
    if len(below) == 0 or below[0] == 0:
        return math.nan
    a, b = grid[below[0] - 1], grid[below[0]]
    return float(brentq(lambda w: float(value(np.array([w]))[0]), a, b, xtol=1e-12 * b))
