"""Gain and phase from one motion to another over frequency, with their intervals."""

from dataclasses import dataclass

import numpy as np

from analysis.array import Array
from analysis.plain import Plain

_SEGMENTS = 6  # of the record, averaged for coherence
_BESIDE = 1.5  # factor in frequency


@dataclass(frozen=True, slots=True)
class Spectrum(Plain):
    """Transfer from reference to other over frequency.

    Attributes
    ----------
    frequency : [Hz] (m,)
    gain : [dB] (m,), between the estimates for noise of either motion alone
    phase : [deg] (m,)
    coherence : 0 … 1 (m,); where it is low, gain and phase say nothing
    gain_error, phase_error : half widths of the 95 % intervals [dB], [deg] (m,)
    power : of the reference, over its mean within a factor of 1.5 in frequency (m,); where it is
        low, as in the nulls of a held command, gain and phase are of what leaks from beside
    """

    frequency: Array
    gain: Array
    phase: Array
    coherence: Array
    gain_error: Array
    phase_error: Array
    power: Array


def spectrum_of(t: Array, y: Array, x: Array) -> Spectrum:
    """Welch averages over half-overlapping stretches of the record, resampled evenly.

    Noise of the reference lowers cross over own power (H1) by the coherence, noise of the other
    motion does not; the gain is the geometric mean of both cases. Intervals: that of the complex
    regression over n averages, t of 2n − 2 degrees of freedom times √((1 − γ²)/((2n − 2) γ²))
    (Goodman 1957; Bendat and Piersol, Random Data, 2010, section 9.2), and half of the distance
    between both cases.
    """
    from scipy.signal import csd, welch
    from scipy.stats import t as student

    period = float(np.median(np.diff(t)))
    even = np.arange(t[0], t[-1], period)
    a, b = np.interp(even, t, y), np.interp(even, t, x)
    length = min(max(min(2 * len(even) // (_SEGMENTS + 1), 4096), 8), len(even))
    rate = 1.0 / period
    frequency, power = welch(a, fs=rate, nperseg=length)
    _, answer = welch(b, fs=rate, nperseg=length)
    _, cross = csd(a, b, fs=rate, nperseg=length)
    free = 2 * max(2 * len(even) // length - 1, 2) - 2
    with np.errstate(divide="ignore", invalid="ignore"):
        coherence = np.clip(np.abs(cross) ** 2 / (power * answer), 0.0, 1.0)
        gain = np.sqrt(answer / power)
        scatter = student.ppf(0.975, free) * np.sqrt((1.0 - coherence) / (free * coherence))
        between = 0.5 * (1.0 / np.sqrt(coherence) - np.sqrt(coherence))
        spectrum = [
            frequency,
            20.0 * np.log10(gain),
            np.degrees(np.unwrap(np.angle(np.nan_to_num(cross)))),
            coherence,
            20.0 * np.log10(1.0 + scatter + between),
            np.degrees(scatter),
            power / _around(frequency, power),
        ]
    frozen = [np.array(v[1:], dtype=np.float64) for v in spectrum]
    for values in frozen:
        values.setflags(write=False)
    return Spectrum(*frozen)


def _around(frequency: Array, power: Array) -> Array:
    """Mean power (m,) within a factor of `_BESIDE` in frequency, both ways."""
    total = np.concatenate([[0.0], np.cumsum(power)])
    low = np.searchsorted(frequency, frequency / _BESIDE)
    high = np.searchsorted(frequency, frequency * _BESIDE, side="right")
    return np.asarray((total[high] - total[low]) / np.maximum(high - low, 1))
