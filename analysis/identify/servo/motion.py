"""Motion of a servo whose speed is bounded under a record's commands, and the play behind it.

The servo's equations are those of the actuator in flight, `analysis.transfer_function.speed`.
"""

import numpy as np

from analysis.array import Array
from analysis.compiled import njit
from analysis.transfer_function.speed import clip_move, move, track, wanted_speed


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
    clipped: bool,
) -> tuple[Array, Array]:
    """Angle (n,) [rad] and rate (n,) [rad/s] at the given times, from rest at the first command.

    Parameters
    ----------
    clipped : the speed itself is, not what the loop aims at
    """
    n = len(time)
    angle, rate = np.empty(n), np.empty(n)
    y, v, u, event = command[0], 0.0, command[0], 0
    now = min(time[0], input_time[0] + delay)
    for row in range(n):
        while True:
            due = input_time[event] + delay if event < len(command) else np.inf
            until = min(due, time[row])
            if until > now:
                if clipped:
                    y, v = clip_move(y, v, u, until - now, k, w, limit, dead_band)
                else:
                    y, v = move(y, v, u, until - now, k, w, limit, dead_band)
                now = until
            if due > time[row]:
                break
            u = command[event]
            event += 1
        angle[row] = y
        rate[row] = wanted_speed(u - y, k, limit, dead_band) if w == 0.0 else v
    return angle, rate


@njit(nogil=True)  # pragma: no cover - compiled
def set_point_servo(
    time: Array,
    input_time: Array,
    command: Array,
    delay: float,
    k: float,
    w: float,
    up: float,
    down: float,
    slew: float,
    dead_band: float,
) -> tuple[Array, Array]:
    """As `speed_servo`, behind a set point of bounded speed and with a limit each way."""
    n = len(time)
    angle, rate = np.empty(n), np.empty(n)
    y, v, r, u, event = command[0], 0.0, command[0], command[0], 0
    now = min(time[0], input_time[0] + delay)
    for row in range(n):
        while True:
            due = input_time[event] + delay if event < len(command) else np.inf
            until = min(due, time[row])
            if until > now:
                y, v, r = track(y, v, r, u, until - now, k, w, up, down, slew, dead_band)
                now = until
            if due > time[row]:
                break
            u = command[event]
            event += 1
        angle[row], rate[row] = y, v
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
