"""Motion of a servo whose speed is bounded, and the play behind it.

The servo steers its speed toward k·(u − y), clipped at the rate limit: ẏ = v,
v̇ = w·(clip(k·e) − v), or ẏ = clip(k·e) of first order. Unclipped this is k·w/(s² + w·s + k·w).
Within the dead band the motor is off; beyond it the error comes to count in full over one more
dead band, as behind a servo's pulse stretcher.
"""

import numpy as np
from numpy.typing import NDArray

from analysis.compiled import njit

Array = NDArray[np.float64]

_STEP = 1e-3  # s; fourth-order steps of this leave 1e-7 of a motion that ends in 10 ms

_RISE = 1.0  # of the dead band, over which the motor comes to full strength


@njit(nogil=True)  # pragma: no cover - compiled
def _speed(target: float, y: float, k: float, limit: float, dead_band: float) -> float:
    e = target - y
    beyond = abs(e) - dead_band
    if beyond <= 0.0:
        return 0.0
    if beyond < _RISE * dead_band:
        e *= (1.0 + 1.0 / _RISE) * beyond / abs(e)
    return min(max(k * e, -limit), limit)


@njit(nogil=True)  # pragma: no cover - compiled
def _advance(
    y: float, v: float, u: float, h: float, k: float, w: float, limit: float, dead_band: float
) -> tuple[float, float]:
    """One Runge–Kutta step of length h; w = 0 stands for a servo of first order."""
    if w == 0.0:
        a = _speed(u, y, k, limit, dead_band)
        b = _speed(u, y + 0.5 * h * a, k, limit, dead_band)
        c = _speed(u, y + 0.5 * h * b, k, limit, dead_band)
        d = _speed(u, y + h * c, k, limit, dead_band)
        y += h * (a + 2.0 * b + 2.0 * c + d) / 6.0
        return y, _speed(u, y, k, limit, dead_band)
    a1, a2 = v, w * (_speed(u, y, k, limit, dead_band) - v)
    b1 = v + 0.5 * h * a2
    b2 = w * (_speed(u, y + 0.5 * h * a1, k, limit, dead_band) - b1)
    c1 = v + 0.5 * h * b2
    c2 = w * (_speed(u, y + 0.5 * h * b1, k, limit, dead_band) - c1)
    d1 = v + h * c2
    d2 = w * (_speed(u, y + h * c1, k, limit, dead_band) - d1)
    return y + h * (a1 + 2.0 * b1 + 2.0 * c1 + d1) / 6.0, v + h * (
        a2 + 2.0 * b2 + 2.0 * c2 + d2
    ) / 6.0


@njit(nogil=True)  # pragma: no cover - compiled
def speed_servo(
    time: Array,
    input_time: Array,
    command: Array,
    delay: float,
    k: float,
    w: float,
    limit: float,
    dead_band: float,
) -> tuple[Array, Array]:
    """Angle (n,) [rad] and rate (n,) [rad/s] at the given times, from rest at the first command."""
    n = len(time)
    angle, rate = np.empty(n), np.empty(n)
    y, v, u, event = command[0], 0.0, command[0], 0
    now = min(time[0], input_time[0] + delay)
    fast = max(k, w)
    longest = min(_STEP, 0.2 / fast) if fast > 0.0 else _STEP
    for row in range(n):
        while True:
            due = input_time[event] + delay if event < len(command) else np.inf
            until = min(due, time[row])
            gap = until - now
            if gap > 0.0:
                steps = int(np.ceil(gap / longest))
                for _ in range(steps):
                    y, v = _advance(y, v, u, gap / steps, k, w, limit, dead_band)
                now = until
            if due > time[row]:
                break
            u = command[event]
            event += 1
        angle[row] = y
        rate[row] = _speed(u, y, k, limit, dead_band) if w == 0.0 else v
    return angle, rate


@njit(nogil=True)  # pragma: no cover - compiled
def play(drive: Array, speed: Array, backlash: float) -> tuple[Array, Array]:
    """Output (n,) and its rate (n,) behind play of total width `backlash` that starts centred."""
    out, rate = np.empty_like(drive), np.empty_like(drive)
    z = drive[0] if len(drive) else 0.0
    for i in range(len(drive)):
        low, high = drive[i] - 0.5 * backlash, drive[i] + 0.5 * backlash
        taken_along = z <= low or z >= high
        z = min(max(z, low), high)
        out[i] = z
        rate[i] = speed[i] if taken_along else 0.0
    return out, rate
