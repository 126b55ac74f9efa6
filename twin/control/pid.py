"""PID with derivative on the measurement, and the low-pass it stands on, exactly discretised."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from analysis.compiled import njit
from twin.errors import TwinError

Array = NDArray[np.float64]


@njit(nogil=True)
def low_pass(state: float, value: float, cutoff: float, dt: float) -> float:
    """Advance ωc/(s + ωc) by one step of a held input; exact for any dt, off at ωc ≤ 0."""
    if cutoff <= 0.0:
        return value
    return value + (state - value) * math.exp(-cutoff * dt)


@njit(nogil=True)
def pid(
    error: float, slope: float, integral: float, kp: float, ki: float, kd: float,
    low: float, high: float, dt: float,
) -> tuple[float, float]:  # fmt: skip
    """Output within [low, high], and the integral's next share of it.

    `slope` is the measurement's rate, so that a jump of the setpoint gives no kick. The integral
    stands still while it would push further into a bound (conditional integration; K. J. Åström,
    T. Hägglund, Advanced PID Control, 2006, §3.5).
    """
    wanted = kp * error + integral - kd * slope
    output = min(max(wanted, low), high)
    push = ki * error
    if (wanted - output) * push <= 0.0:
        integral += push * dt
    return output, min(max(integral, low), high)


@dataclass(frozen=True, slots=True)
class PIDGains:
    """Gains and bounds of one kind of loop.

    Attributes
    ----------
    kp, ki, kd : output per error, per error·s, per error/s
    cutoff : of the first-order low-pass on the derivative [rad/s]; 0 switches it off
    low, high : bounds of the output
    """

    kp: float
    ki: float = 0.0
    kd: float = 0.0
    cutoff: float = 0.0
    low: float = -np.inf
    high: float = np.inf

    def __post_init__(self) -> None:
        if not self.low <= 0.0 <= self.high:
            raise TwinError(f"PID bounds {self.low:g} … {self.high:g} must enclose zero")


class LowPass:
    """First-order low-pass over any number of signals, exact for a held input."""

    def __init__(self, cutoff: float, value: ArrayLike) -> None:
        self.cutoff = cutoff
        self.value = np.array(value, dtype=np.float64)

    def update(self, value: ArrayLike, dt: float) -> Array:
        """Return the filtered value (...) after `value` (...) was held for `dt` [s]."""
        if self.cutoff <= 0.0:
            self.value[...] = value
        else:
            self.value += (np.asarray(value) - self.value) * -np.expm1(-self.cutoff * dt)
        return self.value


@njit(nogil=True)
def _update_all(
    setpoint: Array, measured: Array, state: Array, gains: Array, dt: float, out: Array
) -> None:
    kp, ki, kd, cutoff, low, high = gains
    for k in range(len(out)):
        previous, filtered, integral, started = state[k]
        slope = (measured[k] - previous) / dt if started else 0.0
        filtered = low_pass(filtered, slope, cutoff, dt)
        out[k], integral = pid(
            setpoint[k] - measured[k], filtered, integral, kp, ki, kd, low, high, dt
        )
        state[k, 0], state[k, 1], state[k, 2], state[k, 3] = measured[k], filtered, integral, 1.0


class PID:
    """A PID loop over n signals, which differentiates the measurement itself."""

    def __init__(self, gains: PIDGains, n: int = 1) -> None:
        self.gains = gains
        self._gains = np.array(
            [gains.kp, gains.ki, gains.kd, gains.cutoff, gains.low, gains.high], dtype=np.float64
        )
        self.reset(n)

    def reset(self, n: int) -> None:
        """Forget everything; n signals from now on."""
        self._state = np.zeros((n, 4))
        self._out = np.zeros(n)

    def update(self, setpoint: Array, measured: Array, dt: float) -> Array:
        """Output (n,) for setpoint (n,) and measurement (n,), `dt` after the last call [s]."""
        _update_all(setpoint, measured, self._state, self._gains, dt, self._out)
        return self._out
