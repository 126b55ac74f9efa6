"""One step of a PID with derivative on the measurement, and of a first-order low-pass."""

import math

from analysis.compiled import njit


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
    """Output within [low, high], and the next state of the integral.

    `slope` is the rate of the measurement, so that a setpoint jump gives no derivative kick. The
    integral is held while it would drive the output further past a limit (conditional integration;
    K. J. Åström, T. Hägglund, Advanced PID Control, 2006, §3.5).
    """
    wanted = kp * error + integral - kd * slope
    output = min(max(wanted, low), high)
    push = ki * error
    if (wanted - output) * push <= 0.0:
        integral += push * dt
    return output, min(max(integral, low), high)
