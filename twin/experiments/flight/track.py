"""What a flight passes through, tick by tick."""

import math
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from analysis.compiled import njit
from twin.plant.authority import command_limit
from twin.plant.plant import Plant

Array = NDArray[np.float64]
BLOCK: Final = 4096  # ticks in one array
TIME, POSITION, VELOCITY, AIRSPEED, ATTACK, COMMAND, ERROR = (
    0, slice(1, 4), slice(4, 7), 7, 8, slice(9, 11), 11,
)  # fmt: skip
WIDTH: Final = 12


class Views(NamedTuple):
    """What a tick is kept of, views that stay in place.

    Attributes
    ----------
    position, velocity : of the pivot (3,) [m, m/s]
    airspeed, attack : (1,) airspeed [m/s], angle of attack [rad]
    command, error : (2,) commanded gimbal angle, attitude error [rad]
    """

    position: Array
    velocity: Array
    airspeed: Array
    attack: Array
    command: Array
    error: Array


class Track:
    """Collects a flight tick by tick in blocks of memory.

    Parameters
    ----------
    command : (2,) latest commanded gimbal angle, as the loop writes it [rad]
    error : (2,) attitude error, as the controller writes it [rad]

    Attributes
    ----------
    plant : the one that flies
    views : for compiled code, which calls `keep` with a row of `room`
    """

    def __init__(self, plant: Plant, command: Array, error: Array) -> None:
        self.plant = plant
        signals = plant.signals
        self.views = Views(
            plant.position, plant.velocity, signals["vehicle/airspeed"],
            signals["vehicle/angle_of_attack"], command, error,
        )  # fmt: skip
        self._blocks: list[Array] = []
        self._left = 0

    def watch(self, time_ns: int) -> None:
        """Keep this tick; derived signals must belong to it."""
        keep(self.room()[0], time_ns, self.views)
        self.took(1)

    def room(self) -> Array:
        """Rows for the next ticks (n, WIDTH), at least one."""
        if self._left == 0:
            self._blocks.append(np.empty((BLOCK, WIDTH)))
            self._left = BLOCK
        return self._blocks[-1][BLOCK - self._left :]

    def took(self, count: int) -> None:
        """Count rows of `room` that were filled."""
        self._left -= count

    def error_rms_deg(self, count: int) -> float:
        """Root mean square of the attitude error in the first `count` ticks."""
        squares = np.ascontiguousarray(self.ticks[:count, ERROR])
        return math.degrees(math.sqrt(float(np.mean(squares))))

    @property
    def limit(self) -> float:
        """Largest command of an axis by the attitude loop [rad]."""
        return command_limit(self.plant.model)

    @property
    def ticks(self) -> Array:
        """All ticks and the present instant, (n, WIDTH): columns `TIME` to `COMMAND`."""
        last = self._blocks[-1][BLOCK - self._left - 1].copy() if self._blocks else np.zeros(WIDTH)
        last[TIME] = self.plant.time_ns * 1e-9
        last[POSITION], last[VELOCITY] = self.views.position, self.views.velocity
        filled = np.concatenate([*self._blocks, np.empty((0, WIDTH))])
        return np.concatenate([filled[: len(filled) - self._left], last[None]])


@njit(nogil=True)
def keep(row: Array, time_ns: int, v: Views) -> None:
    """Write a tick to a row (WIDTH,)."""
    row[0] = time_ns * 1e-9
    for k in range(3):
        row[1 + k], row[4 + k] = v.position[k], v.velocity[k]
    row[7], row[8] = v.airspeed[0], v.attack[0]
    row[9], row[10] = v.command[0], v.command[1]
    row[11] = v.error[0] * v.error[0] + v.error[1] * v.error[1]
