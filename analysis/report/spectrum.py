"""Frequency response from a record of command and angle, with its confidence band."""

import math
from dataclasses import dataclass

import numpy as np

from analysis.array import Array
from analysis.plain import Plain
from analysis.recording.measurements import Measurement
from analysis.response import Figure
from analysis.schema import AnalysisError

STRETCHES = 8  # of the record; half overlapping, they make 15 averages
EXCITED = 1e-3  # of the strongest line's power: less is leakage, not excitation
FASTEST = 0.15  # of the sampling rate: above, what the hold folds back is taken for response
COHERENT = 0.5  # below, gain and phase say nothing
SURE = 1.96  # standard deviations of a 95 % interval


@dataclass(frozen=True, slots=True)
class FrequencyResponse(Plain):
    """Transfer from command to angle where the command excited it; arrays (m,).

    Attributes
    ----------
    frequency : [Hz]
    gain : [1]
    phase : unwrapped from the lowest frequency [rad]
    coherence : 0 to 1
    error : half width of the 95 % interval, relative for the gain, in radians for the phase
    averages : stretches of the record averaged
    amplitude : largest command [rad]
    """

    frequency: Array
    gain: Array
    phase: Array
    coherence: Array
    error: Array
    averages: int
    amplitude: float

    def to_dict(self) -> dict[str, object]:
        """Plain numbers for JSON."""
        content = Plain.to_dict(self)
        return {
            k: [float(f"{x:.7g}") for x in v] if isinstance(v, list) else v
            for k, v in content.items()
        }


def frequency_response(axis: Measurement) -> FrequencyResponse:
    """Welch averages of cross over input power, half-overlapping Hann stretches.

    From the command as it is held to the angle: the hold's half period is none of the gimbal's.

    The interval is that of Bendat and Piersol, Random Data (2010), eq. 9.90: standard deviation
    over value = √(1 − γ²)/(|γ|·√(2n)).

    Raises
    ------
    AnalysisError : the record is too short, or its command excites nothing
    """
    from scipy.signal import csd, welch

    axis = axis.active()
    t, u, y = _even(axis)
    count = len(t)
    if count < 256 or np.ptp(u) == 0.0:
        raise AnalysisError(
            f"axis {axis.component}: {count} samples of a command that moves are too few"
        )
    length = count // STRETCHES * 2 if count // STRETCHES >= 64 else 128
    rate = 1.0 / (t[1] - t[0])
    averages = max(1, 2 * count // length - 1)
    # the rest angle is no part of the response, and Hann's side lobes would spread it
    options = {"fs": rate, "nperseg": length, "detrend": "constant"}
    frequency, power = welch(u, **options)
    _, answer = welch(y, **options)
    _, cross = csd(u, y, **options)
    with np.errstate(divide="ignore", invalid="ignore"):
        # the command is held between samples, which a spectrum of samples takes for half a
        # period of the gimbal's delay: divide by the hold's own response
        hold = np.sinc(frequency / rate) * np.exp(-1j * np.pi * frequency / rate)
        ratio = cross / (power * hold)
        coherence = np.clip(np.abs(cross) ** 2 / (power * answer), 0.0, 1.0)
    slow = (frequency > 0.0) & (frequency <= FASTEST * rate)
    good = slow & (power > EXCITED * power.max()) & (coherence >= COHERENT)
    if good.sum() < 3:
        raise AnalysisError(f"axis {axis.component}: the command excites too few frequencies")
    ratio, coherence = ratio[good], coherence[good]
    error = SURE * np.sqrt((1.0 - coherence) / (2.0 * averages * coherence))
    return FrequencyResponse(
        frequency=_frozen(frequency[good]),
        gain=_frozen(np.abs(ratio)),
        phase=_frozen(np.unwrap(np.angle(ratio))),
        coherence=_frozen(coherence),
        error=_frozen(error),
        averages=averages,
        amplitude=float(np.abs(u).max()),
    )


def measured_figures(found: FrequencyResponse) -> tuple[Figure, ...]:
    """Bandwidth (−3 dB), −90° frequency, phase lag at 1 Hz and equivalent delay, from a record.

    The gain at rest is that of the lowest excited frequency. NaN where the frequency lies beyond
    what was excited.
    """
    f, lag, error = found.frequency, -np.degrees(found.phase), found.error
    level = found.gain[0] / math.sqrt(2.0)
    half = np.degrees(error)
    bandwidth = [_first(f, level - found.gain * (1.0 + s * error)) for s in (0.0, -1.0, 1.0)]
    quarter = [_first(f, lag + s * half - 90.0) for s in (0.0, 1.0, -1.0)]
    inside = f[0] <= 1.0 <= f[-1]
    at = [float(np.interp(1.0, f, lag + s * half)) if inside else math.nan for s in (0, -1, 1)]
    delay = [v / 360.0 for v in at]

    def figure(name: str, values: list[float], unit: str) -> Figure:
        interval = (values[1], values[2])
        return Figure(name, values[0], unit, found.amplitude, found.averages, interval)

    return (
        figure("bandwidth", bandwidth, "Hz"),
        figure("-90° frequency", quarter, "Hz"),
        figure("phase lag at 1 Hz", at, "deg"),
        figure("equivalent delay", delay, "s"),
    )


def _even(axis: Measurement) -> tuple[Array, Array, Array]:
    """Evenly spaced stamps with the held command and the interpolated angle."""
    low = max(axis.command.time[0], axis.angles.time[0])
    high = min(axis.command.time[-1], axis.angles.time[-1])
    period = float(np.median(np.diff(axis.angles.time))) if len(axis.angles.time) > 1 else 0.0
    if not (high > low and period > 0.0 and (high - low) / period < 5e6):
        raise AnalysisError(f"axis {axis.component}: command and angle share no stretch of time")
    t = low + period * np.arange(int((high - low) / period) + 1)
    angle = np.interp(t, axis.angles.time, axis.angles.value)
    return t, axis.command.held(t + 1e-9)[:, 0], angle


def _first(f: Array, value: Array) -> float:
    """First upward crossing of zero, by interpolation over the logarithm of the frequency."""
    above = np.flatnonzero(value >= 0.0)
    if len(above) == 0 or above[0] == 0:
        return math.nan
    k = int(above[0])
    part = value[k - 1] / (value[k - 1] - value[k])
    return float(f[k - 1] * (f[k] / f[k - 1]) ** part)


def _frozen(values: Array) -> Array:
    out = np.array(values, dtype=np.float64)
    out.setflags(write=False)
    return out
