"""Attitude loop: gimbal angles that turn the nose to a wanted direction.

The error is taken in body axes, so the loop is independent of the roll angle. One motor gives no
roll moment; roll is not controlled.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from analysis.compiled import njit
from twin.control.pid import low_pass, pid
from twin.errors import TwinError

Array = NDArray[np.float64]
LARGEST_COMMAND = math.radians(8.0)  # either way from zero; the stops of the gimbal are at 10°


@dataclass(frozen=True, slots=True)
class ControlConfig:
    """Gains in terms of angular acceleration, so that they fit vehicles of any size.

    Attributes
    ----------
    kp, ki, kd : angular acceleration per error [1/s²], its integral [1/s³], rate [1/s]
    cutoff : of the low-pass on the rate [rad/s]; 0 switches it off
    limit : largest gimbal angle on each axis [rad]
    rate_limit : fastest change of the command [rad/s]; 0 switches it off
    error_limit : limit on the error [rad]; bounds the turn rate
    authority_time, authority : angular acceleration per gimbal angle, thrust·lever/inertia
        [rad/s² per rad], at times [s]; linear between, constant outside
    authority_floor : below it the gimbal is centred and the integral is held [rad/s² per rad]
    """

    kp: float = 25.0
    ki: float = 10.0
    kd: float = 8.0
    cutoff: float = 80.0
    limit: float = LARGEST_COMMAND
    rate_limit: float = 0.0
    error_limit: float = 0.5
    authority_time: tuple[float, ...] = (0.0,)
    authority: tuple[float, ...] = (40.0,)
    authority_floor: float = 5.0

    def __post_init__(self) -> None:
        for name in ("kp", "ki", "kd", "cutoff", "rate_limit", "authority_floor"):
            _demand(getattr(self, name) >= 0.0, name, getattr(self, name), "≥ 0")
        for name in ("limit", "error_limit"):
            _demand(getattr(self, name) > 0.0, name, getattr(self, name), "> 0")
        if len(self.authority_time) != len(self.authority) or not self.authority:
            raise TwinError(
                f"control authority has {len(self.authority)} values for"
                f" {len(self.authority_time)} times; must have one each, and at least one"
            )
        if np.any(np.diff(self.authority_time) <= 0.0):
            raise TwinError("control authority_time must increase")


def _demand(good: bool, name: str, value: float, wanted: str) -> None:
    if not (good and math.isfinite(value)):
        raise TwinError(f"control {name} is {value:g}; must be finite and {wanted}")


@njit(nogil=True)
def missing_rotation(attitude: Array, nose: Array) -> tuple[float, float]:
    """Rotation about body x and y from the nose to the wanted direction [rad].

    `attitude` (4,) wxyz body to world, `nose` (3,) unit, world. Shortest rotation, without roll.
    """
    w, x, y, z = attitude
    dx, dy, dz = nose
    bx = (1 - 2 * (y * y + z * z)) * dx + 2 * (x * y + w * z) * dy + 2 * (x * z - w * y) * dz
    by = 2 * (x * y - w * z) * dx + (1 - 2 * (x * x + z * z)) * dy + 2 * (y * z + w * x) * dz
    bz = 2 * (x * z + w * y) * dx + 2 * (y * z - w * x) * dy + (1 - 2 * (x * x + y * y)) * dz
    across = math.sqrt(bx * bx + by * by)
    angle = math.atan2(across, bz)
    # sin θ/θ → 1 towards the nose; at 180° every axis is as short: x
    if across < 1e-12:
        return (0.0, 0.0) if bz > 0.0 else (angle, 0.0)
    return -by / across * angle, bx / across * angle


@njit(nogil=True)
def interpolate(t: float, times: Array, values: Array) -> float:
    """Value at t of a table, linear between its entries and constant outside."""
    n = len(times)
    if t <= times[0] or n == 1:
        return float(values[0])
    if t >= times[n - 1]:
        return float(values[n - 1])
    k = np.searchsorted(times, t)
    share = (t - times[k - 1]) / (times[k] - times[k - 1])
    return float(values[k - 1] + share * (values[k] - values[k - 1]))


@njit(nogil=True)
def from_vertical(x: float, y: float, z: float) -> tuple[float, float]:
    """Rotation about world x and y that turns the vertical to the direction (x, y, z) [rad].

    Continuous up to the nadir, where angles in two planes jump as the direction turns over.
    """
    sine = math.hypot(x, y)
    if sine < 1e-12:
        return 0.0, (0.0 if z > 0.0 else math.pi)
    angle = math.atan2(sine, z) / sine
    return -y * angle, x * angle


class Loop(NamedTuple):
    """An attitude loop for compiled code.

    Attributes
    ----------
    gains : `kp` to `error_limit` of `ControlConfig`, and `authority_floor`
    times, authority : control authority over time
    state : (n, 6) filtered rate, integral [rad/s²], last command, of x and y each
    error : (n, 2) written [rad]
    """

    gains: Array
    times: Array
    authority: Array
    state: Array
    error: Array


@njit(nogil=True)
def update(
    t: float, dt: float, attitude: Array, rate: Array, nose: Array, loop: Loop, out: Array
) -> None:
    """`AttitudeController.update` of n vehicles."""
    gains, times, authority, state, error = loop
    kp, ki, kd, cutoff, limit, rate_limit, error_limit, floor = gains
    b = interpolate(t, times, authority)
    for k in range(len(out)):
        ex, ey = missing_rotation(attitude[k], nose[k])
        error[k, 0], error[k, 1] = ex, ey
        shrink = min(1.0, error_limit / max(math.sqrt(ex * ex + ey * ey), 1e-12))
        for axis in range(2):
            slope = low_pass(state[k, axis], rate[k, axis], cutoff, dt)
            state[k, axis] = slope
            angle = 0.0
            if b > floor:
                most = limit * b
                turn, state[k, 2 + axis] = pid(
                    shrink * error[k, axis], slope, state[k, 2 + axis],
                    kp, ki, kd, -most, most, dt,
                )  # fmt: skip
                # The thrust acts below the centre of mass: tilted about +x it turns the vehicle
                # about −x, and likewise about y.
                angle = -turn / b
            if rate_limit > 0.0:
                last = state[k, 4 + axis]
                angle = min(max(angle, last - rate_limit * dt), last + rate_limit * dt)
            state[k, 4 + axis] = angle
            out[k, axis] = angle


class AttitudeController:
    """The attitude loop of n vehicles.

    Attributes
    ----------
    loop : for compiled code, which calls `update`; another one after `reset`
    """

    def __init__(self, config: ControlConfig | None = None) -> None:
        self.config = c = config or ControlConfig()
        self._gains = np.array(
            [c.kp, c.ki, c.kd, c.cutoff, c.limit, c.rate_limit, c.error_limit, c.authority_floor]
        )
        self.reset()

    def reset(self, n: int = 1) -> None:
        """Reset the state, for n vehicles."""
        c = self.config
        self.loop = Loop(
            self._gains, np.array(c.authority_time), np.array(c.authority), np.zeros((n, 6)),
            np.zeros((n, 2)),
        )  # fmt: skip
        self._out = np.zeros((n, 2))

    @property
    def error(self) -> Array:
        """Error at the last update, about body x and y (n, 2) [rad]."""
        return self.loop.error

    def update(
        self, t: float, dt: float, attitude: Array, rate: Array, setpoint: Array,
        out: Array | None = None,
    ) -> Array:  # fmt: skip
        """Gimbal angles (..., 2) to command [rad], and write them to `out` (..., 2).

        Parameters
        ----------
        t, dt : experiment time, time since the last update [s]
        attitude : (..., 4) wxyz, body to world
        rate : (..., 3) in the body frame [rad/s]
        setpoint : (..., 3) wanted nose direction, world frame, unit vectors
        """
        if out is None:
            out = self._out[0] if attitude.ndim == 1 else self._out
        n = len(self._out)
        update(
            t, dt, attitude.reshape(n, 4), rate.reshape(n, 3), setpoint.reshape(n, 3), self.loop,
            out.reshape(n, 2),
        )  # fmt: skip
        return out
