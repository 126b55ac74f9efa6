"""Servo whose own loop saturates: it steers its speed toward k·(u − y), clipped at the rate limit.

ẏ = v, v̇ = w·(clip(k·e) − v), or ẏ = clip(k·e) of first order (w = 0). Unclipped this is the
linear k·w/(s² + w·s + k·w). Within the dead band the motor is off; beyond it the error comes to
count in full over one more dead band, as behind a servo's pulse stretcher. Compiled, and shared by
the simulation here and the actuator in flight.

`clip_move` is the servo whose speed itself is clipped: v̇ = w·(k·e − v), held at ± limit while that
points outward. Its dead band is that of `move`.

`track` is the servo that aims at a set point which follows its command at a bounded speed, with
another fastest speed each way (a load helps one of them). Of its error only what is beyond the dead
band counts.
"""

import numpy as np

from analysis.compiled import njit

_LONGEST = 1e-3  # s
_SHARE = 0.2  # of the fastest time constant; fourth-order steps of this leave 1e-5 of a motion
# times the natural frequency: a loop that is faster than that has no damping worth the name
_UNDAMPED = 30.0


@njit(nogil=True)
def longest_step(k: float, w: float) -> float:
    """Longest Runge–Kutta step of a loop [s]; w = 0 is one of first order."""
    fast = max(k, w)
    if w > 0.0:  # else a search that strays to k = 1e7 of w = 0.1 takes minutes
        fast = min(fast, max(w, _UNDAMPED * np.sqrt(k * w)))
    return min(_LONGEST, _SHARE / fast)


@njit(nogil=True)
def wanted_speed(error: float, k: float, limit: float, dead_band: float) -> float:
    """Speed aimed at [rad/s] for an error [rad]."""
    beyond = abs(error) - dead_band
    if beyond <= 0.0:
        return 0.0
    if beyond < dead_band:
        error *= 2.0 * beyond / abs(error)
    return min(max(k * error, -limit), limit)


@njit(nogil=True)
def _slope(
    y: float, v: float, u: float, k: float, w: float, limit: float, dead_band: float
) -> tuple[float, float]:
    wanted = wanted_speed(u - y, k, limit, dead_band)
    if w == 0.0:
        return wanted, 0.0
    return v, w * (wanted - v)


@njit(nogil=True)
def move(
    y: float, v: float, u: float, time: float, k: float, w: float, limit: float, dead_band: float
) -> tuple[float, float]:
    """Position [rad] and speed [rad/s] after the command u was held for `time` [s]; Runge–Kutta."""
    longest = longest_step(k, w)
    steps = int(time / longest) + 1
    h = time / steps
    for _ in range(steps):
        a1, a2 = _slope(y, v, u, k, w, limit, dead_band)
        b1, b2 = _slope(y + 0.5 * h * a1, v + 0.5 * h * a2, u, k, w, limit, dead_band)
        c1, c2 = _slope(y + 0.5 * h * b1, v + 0.5 * h * b2, u, k, w, limit, dead_band)
        d1, d2 = _slope(y + h * c1, v + h * c2, u, k, w, limit, dead_band)
        y += h / 6.0 * (a1 + 2.0 * b1 + 2.0 * c1 + d1)
        v += h / 6.0 * (a2 + 2.0 * b2 + 2.0 * c2 + d2)
    return y, v


@njit(nogil=True)
def _loop_step(
    y: float, v: float, u: float, h: float, k: float, w: float, dead_band: float
) -> tuple[float, float]:
    a1, a2 = _slope(y, v, u, k, w, np.inf, dead_band)
    b1, b2 = _slope(y + 0.5 * h * a1, v + 0.5 * h * a2, u, k, w, np.inf, dead_band)
    c1, c2 = _slope(y + 0.5 * h * b1, v + 0.5 * h * b2, u, k, w, np.inf, dead_band)
    d1, d2 = _slope(y + h * c1, v + h * c2, u, k, w, np.inf, dead_band)
    y += h / 6.0 * (a1 + 2.0 * b1 + 2.0 * c1 + d1)
    v += h / 6.0 * (a2 + 2.0 * b2 + 2.0 * c2 + d2)
    return y, v


@njit(nogil=True)
def _crossing(start: float, slope: float, end: float, slope_after: float) -> float:
    """Where in 0 … 1 the cubic with these values and slopes at both ends rises to 1."""
    low, high = 0.0, 1.0
    for _ in range(50):
        s = 0.5 * (low + high)
        r = 1.0 - s
        value = (1.0 + 2.0 * s) * r * r * start + s * r * r * slope
        value += (1.0 + 2.0 * r) * s * s * end - r * s * s * slope_after
        if value < 1.0:
            low = s
        else:
            high = s
    return high


@njit(nogil=True)
def clip_move(
    y: float, v: float, u: float, time: float, k: float, w: float, limit: float, dead_band: float
) -> tuple[float, float]:
    """As `move`, of second order, where the speed itself is clipped.

    Runge–Kutta steps end where the speed reaches its limit; from there to where it leaves it the
    motion is a ramp.
    """
    longest = longest_step(k, w)
    edge = limit / k  # error at which the speed aimed at is the limit
    if edge < 2.0 * dead_band:
        edge = dead_band + 0.5 * edge
    left, ramps, ends = time, True, True
    while left > 0.0:
        beyond = (u - y if v > 0.0 else y - u) - edge
        if ramps and abs(v) >= limit and beyond > 0.0:
            span = min(beyond / limit, left)
            y += span * v
            left -= span
            ramps = False  # rounding may leave a trace of the way; the speed falls from here
            continue
        h = left / (int(left / longest) + 1)
        a, b = _loop_step(y, v, u, h, k, w, dead_band)
        if abs(b) > limit:
            side = limit if b > 0.0 else -limit
            if ends:  # not twice in a row, so that every loop of these comes to its end
                _, start = _slope(y, v, u, k, w, np.inf, dead_band)
                _, end = _slope(a, b, u, k, w, np.inf, dead_band)
                h *= _crossing(v / side, h * start / side, b / side, h * end / side)
                a, _ = _loop_step(y, v, u, h, k, w, dead_band)
            b, ramps, ends = side, True, not ends
        else:
            ends = True
        y, v = a, b
        left -= h
    return y, v


@njit(nogil=True)
def tracking_speed(error: float, k: float, up: float, down: float, dead_band: float) -> float:
    """Speed aimed at [rad/s] for an error [rad], within −down to up."""
    beyond = error - min(max(error, -dead_band), dead_band)
    return min(max(k * beyond, -down), up)


@njit(nogil=True)
def track(
    y: float, v: float, r: float, u: float, time: float, k: float, w: float,
    up: float, down: float, slew: float, dead_band: float,
) -> tuple[float, float, float]:  # fmt: skip
    """Position [rad], speed [rad/s] and set point [rad] after u was held for `time` [s]."""
    longest = longest_step(k, w)
    steps = int(time / longest) + 1
    h = time / steps
    for _ in range(steps):
        after = min(max(u, r - slew * h), r + slew * h)
        half = 0.5 * (r + after)
        a1, a2 = v, w * (tracking_speed(r - y, k, up, down, dead_band) - v)
        b1 = v + 0.5 * h * a2
        b2 = w * (tracking_speed(half - y - 0.5 * h * a1, k, up, down, dead_band) - b1)
        c1 = v + 0.5 * h * b2
        c2 = w * (tracking_speed(half - y - 0.5 * h * b1, k, up, down, dead_band) - c1)
        d1 = v + h * c2
        d2 = w * (tracking_speed(after - y - h * c1, k, up, down, dead_band) - d1)
        y += h / 6.0 * (a1 + 2.0 * b1 + 2.0 * c1 + d1)
        v += h / 6.0 * (a2 + 2.0 * b2 + 2.0 * c2 + d2)
        r = after
    return y, v, r
