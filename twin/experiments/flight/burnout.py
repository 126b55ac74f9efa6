"""Position and velocity at burnout, which lies between two ticks."""

import numpy as np
from numpy.typing import NDArray

from analysis.compiled import njit

Array = NDArray[np.float64]


@njit(nogil=True)
def at_burnout(before: Array, burnout: float) -> tuple[Array, Array]:
    """Position and velocity (3,) at burnout, continued from the two ticks before.

    Not from the tick after: a parachute that opens at burnout brakes within that tick.

    Parameters
    ----------
    before : last two ticks up to burnout (2, 7): time [s], position [m], velocity [m/s]; NaN in the
        first of them where there is only one
    burnout : [s]
    """
    first, last = before[0], before[1]
    ahead, apart = burnout - last[0], last[0] - first[0]
    velocity = last[4:7].copy()
    if apart > 0.0:  # not where it is NaN
        velocity += ahead / apart * (last[4:7] - first[4:7])
    return last[1:4] + 0.5 * ahead * (last[4:7] + velocity), velocity
