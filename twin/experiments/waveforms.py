"""Waveforms of the test signals: levels that are held, and periods given tick by tick.

`steps` and `staircase` give levels (repeats, moves), the others one period (n,), all in radians.
Common arguments: `amplitude` [rad], `band` of lowest and highest frequency [Hz], `duration` of one
sweep or period [s], and `tick`, the time between two commands [s].
"""

import math

import numpy as np
from numpy.typing import NDArray

from hardware.protocol import constants

Array = NDArray[np.float64]
Band = tuple[float, float]

CLEAN = 0.443  # a held random level's power is halved at 0.443 of its clock rate (sinc² = 1/2)
REGISTER = (3, 16)  # stages of the shift register; SciPy has primitive polynomials for 2 to 32
FINER = 1.0 / math.sqrt(2.0)  # ratio of neighbouring steps of a staircase
FRAME = constants.PWM_PERIOD  # s; between two pulses of a hobby servo


def ticks_of(seconds: float, tick: float) -> int:
    """Ticks that last at least so long."""
    return max(1, math.ceil(seconds / tick - 1e-6))


def frame_of(tick: float) -> int:
    """Number of phases of a pulse frame at which commands of this tick can begin."""
    return max(1, round(FRAME / tick))


def _back_and_forth(amplitudes: Array) -> Array:
    """To +a, zero, −a and zero for every amplitude."""
    return np.outer(amplitudes, (1.0, 0.0, -1.0, 0.0)).ravel()


def steps(amplitude: float, repeats: int) -> Array:
    """After every three repeats one of half the size: one size alone shows no limited speed."""
    size = np.where(np.arange(repeats + repeats // 3) % 4 == 3, 0.5, 1.0)
    return _back_and_forth(amplitude * size).reshape(len(size), 4)


def staircase(amplitude: float, smallest: float, repeats: int) -> Array:
    """Ever smaller steps, √2 apart: each leaves zero and returns, so it crosses any backlash."""
    count = 1 + round(math.log(smallest / amplitude) / math.log(FINER))
    levels = _back_and_forth(np.geomspace(amplitude, smallest, count))
    return np.tile(levels, (repeats, 1))


def chirp(amplitude: float, band: Band, duration: float, tick: float) -> Array:
    """Logarithmic sweep: as many seconds for every octave."""
    low, high = band
    n = ticks_of(duration, tick)
    t = np.arange(n) * tick
    pace = math.log(high / low) / (n * tick)
    return np.asarray(amplitude * np.sin(2 * np.pi * low / pace * np.expm1(pace * t)))


def prbs(amplitude: float, band: Band, seed: int, tick: float) -> Array:
    """Maximum-length sequence of ±amplitude (Golomb, Shift Register Sequences, 1967).

    Its lines stand at multiples of the lower frequency or closer, of half the power or more at the
    upper. Its clock has no divisor with the pulse frame in common, so that it meets every phase.
    """
    from scipy.signal import max_len_seq

    low, high = band
    clock = ticks_of(CLEAN / high, tick)
    while math.gcd(clock, frame_of(tick)) > 1:
        clock -= 1
    stages = math.ceil(math.log2(1.0 / (low * clock * tick) + 1.0))
    stages = min(max(stages, REGISTER[0]), REGISTER[1])
    state = int(np.random.default_rng(seed).integers(1, 2**stages))
    register = np.array([(state >> k) & 1 for k in range(stages)], dtype=np.int8)
    bits = max_len_seq(stages, state=register)[0]
    return np.repeat(amplitude * (2.0 * bits - 1.0), clock)


def multisine(amplitude: float, band: Band, seed: int, tick: float) -> Array:
    """Equal lines at multiples of the lower frequency, phases searched for a low crest.

    Clipping and restoring the spectrum in turn: Van der Ouderaa, Schoukens and Renneboog, IEEE
    Trans. Instrum. Meas. 37 (1988) 145.
    """
    low, high = band
    n = ticks_of(1.0 / low, tick)
    lines = np.arange(1, math.floor(high * n * tick * (1.0 + 1e-9)) + 1)
    phases = np.random.default_rng(seed).uniform(0.0, 2.0 * np.pi, len(lines))
    best, least = np.zeros(n), math.inf
    for _ in range(200):
        spectrum = np.zeros(n // 2 + 1, dtype=np.complex128)
        spectrum[lines] = np.exp(1j * phases)
        wave = np.fft.irfft(spectrum, n)
        peak = float(np.abs(wave).max())
        if peak < least:
            best, least = wave, peak
        phases = np.angle(np.fft.rfft(np.clip(wave, -0.85 * peak, 0.85 * peak))[lines])
    return np.asarray(best * (amplitude / least))


def triangle(amplitude: float, duration: float, tick: float) -> Array:
    """Slow ramps to both ends, so that rising and falling motion can be compared."""
    times, levels = np.array([0.0, 0.25, 0.75, 1.0]), np.array([0.0, 1.0, -1.0, 0.0])
    return amplitude * _corners(ticks_of(duration, tick), times, levels)


def dog_leg(amplitude: float, duration: float, tick: float) -> Array:
    """Ramps with a change of slope, either way: lag at two speeds, and friction at the change.

    Fast to half the angle, on at a third of that speed, hold, the same back, hold.
    """
    out = np.array([0.0, 1.0, 4.0, 6.0, 7.0, 10.0, 12.0]) / 24.0
    level = np.array([0.0, 0.5, 1.0, 1.0, 0.5, 0.0, 0.0])
    times, levels = np.append(out, out[1:] + 0.5), np.append(level, -level[1:])
    return amplitude * _corners(ticks_of(duration, tick), times, levels)


def _corners(n: int, times: Array, levels: Array) -> Array:
    """Straight lines between levels at fractions of a period of `n` ticks."""
    return np.interp(np.arange(n) / n, times, levels)
