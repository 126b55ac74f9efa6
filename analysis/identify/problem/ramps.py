"""What a rate-limited servo with a dead band makes of held commands: ramps.

The order of the parts is that of the model file (`analysis.transfer_function.Servo`): dead band and
rate limit on the command, then delay and transfer function, then backlash.
"""

from dataclasses import dataclass

import numpy as np

from analysis.array import Array
from analysis.compiled import njit


@dataclass(frozen=True, slots=True)
class Bounds:
    """Rate limit [rad/s] (infinite: none) and dead band (half width) [rad] on the command."""

    rate_limit: float = np.inf
    dead_band: float = 0.0


@njit(nogil=True)  # pragma: no cover - compiled
def ramps(
    time: Array, command: Array, rate_limit: float, dead_band: float
) -> tuple[Array, Array, Array]:
    """Corners of the bounded command, which rests at zero before the first one.

    Returns the times of the corners [s], the slope from each on [rad/s], and the value there [rad].
    """
    n = len(time)
    at = np.empty(2 * n)
    slope = np.empty(2 * n)
    value = np.empty(2 * n)
    held, position, pace, last, count = 0.0, 0.0, 0.0, 0.0, 0
    arrival = -np.inf
    for k in range(n):
        if pace != 0.0:
            if arrival < time[k]:
                position, pace = held, 0.0
                at[count], slope[count], value[count] = arrival, 0.0, held
                count += 1
            else:
                position += pace * (time[k] - last)
        if abs(command[k] - held) > dead_band:
            held = command[k]
        missing = held - position
        pace = 0.0 if missing == 0.0 else np.sign(missing) * rate_limit
        last = time[k]
        arrival = time[k] + abs(missing) / rate_limit
        at[count], slope[count], value[count] = time[k], pace, position
        count += 1
    if pace != 0.0:
        at[count], slope[count], value[count] = arrival, 0.0, held
        count += 1
    return at[:count], slope[:count], value[:count]
