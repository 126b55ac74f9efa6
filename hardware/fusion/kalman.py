"""Kalman filter over both axes of a gimbal, on filterpy.

State of an axis: angle θ, rate ω, gyro bias b, and the rate g behind the gyro's low-pass,
which models the age of the gyro's readings. Measurements: both potentiometers' angles, gyro
rate. Decision and figures: docs/decisions/0007-filterpy-in-the-loop.md.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import exp, sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hardware.frames import AXES, Pair
from hardware.parts import GYRO_BIAS_WALK, GYRO_DELAY_S, GYRO_NOISE, GYRO_SAMPLE_S
from hardware.protocol import constants

Array = NDArray[np.float64]

ANGLE, RATE, BIAS, FILTERED = range(4)
STATES, MEASUREMENTS = 4, 3  # of one axis
LONGEST_STEP_US = 200_000  # a filter starts again after a longer gap
_KEPT_STEPS = 256


@dataclass(frozen=True, slots=True)
class Noise:
    """Assumed noise of sensors and motion.

    Attributes
    ----------
    potentiometer : standard deviation of one reading, fraction of the supply [1]
    supply : standard deviation of the common supply error of one frame [1]
    gyro : angle random walk of the gyro [rad/√s]; 0.005 °/s/√Hz one-sided is 0.0035 °/√s
    gyro_delay : delay of the gyro's low-pass, mean age of the sample that is read, and age
        of the reading in the frame [s]
    bias : random walk of the gyro bias [rad/s/√s]
    acceleration : white angular acceleration of the gimbal [rad/s²/√Hz]; a servo reaches
        240 °/s within 20 ms, 4.2/√0.02
    """

    potentiometer: float = 6.5e-4  # 0.6 LSB of noise and 1/√12 LSB of quantisation, of 1024
    supply: float = 5e-4
    gyro: float = GYRO_NOISE / sqrt(2.0)
    gyro_delay: float = GYRO_DELAY_S[constants.DLPF] + GYRO_SAMPLE_S[constants.DLPF] / 2 + 1e-3
    bias: float = GYRO_BIAS_WALK
    acceleration: float = 30.0


def transition(dt: float, delay: float) -> Array:
    """Return F (4, 4) over dt: constant rate, and g following it through a first-order lag."""
    e = exp(-dt / delay) if delay > 0 else 0.0
    return np.array([[1, dt, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 1 - e, 0, e]], dtype=float)


def process_noise(dt: float, noise: Noise) -> Array:
    """Return Q (4, 4): ∫ φφᵀ over dt with φ(s) = (s, 1, 0, 1 − e^(−s/delay)), plus the bias walk.

    φ is the response of the state to an impulse of acceleration s ago; the integrals are exact.
    """
    delay = noise.gyro_delay
    e = exp(-dt / delay) if delay > 0 else 0.0
    angle_g = dt**2 / 2 - delay * (delay * (1 - e) - dt * e)
    rate_g = dt - delay * (1 - e)
    g_g = dt - 2 * delay * (1 - e) + delay / 2 * (1 - e * e)
    q = noise.acceleration**2 * np.array(
        [
            [dt**3 / 3, dt**2 / 2, 0, angle_g],
            [dt**2 / 2, dt, 0, rate_g],
            [0, 0, 0, 0],
            [angle_g, rate_g, 0, g_g],
        ]
    )
    q[BIAS, BIAS] = noise.bias**2 * dt
    return q


def observation(gyro_gain: float) -> Array:
    """Return H (3, 4); for the ring the gyro measures cos y of the rate, hence the gain [1]."""
    return np.array([[1, 0, 0, 0], [1, 0, 0, 0], [0, 0, 1, gyro_gain]], dtype=float)


class GimbalFilter:
    """State and covariance of both axes, and the steps that change them.

    One `KalmanFilter` of eight states with block-diagonal matrices: the axes share no noise, and
    two filters of four states take twice as long.

    Parameters
    ----------
    noise : assumptions on sensors and motion

    Attributes
    ----------
    noise : as given; `set_gyro_delay` changes it
    state : angle, rate, bias and filtered rate of x, then of y (8,)
    """

    def __init__(self, noise: Noise) -> None:
        # Half a second, most of it scipy.stats: commands without a rig do not import it.
        from filterpy.kalman import KalmanFilter
        from scipy.linalg.lapack import dposv

        self.noise = noise
        self._kalman: Any = KalmanFilter(STATES * len(AXES), MEASUREMENTS * len(AXES))
        self._kalman.x = np.zeros(STATES * len(AXES))
        self._kalman.H = _both(observation(1.0))
        self._kalman.R = np.zeros((MEASUREMENTS * len(AXES),) * 2)
        # By Cholesky, since S is positive definite; numpy.linalg.inv takes 3.5 µs longer.
        unit = [np.eye(m) for m in range(MEASUREMENTS * len(AXES) + 1)]
        self._kalman.inv = lambda S: dposv(S, unit[len(S)])[1]
        self._steps: dict[int, tuple[Array, Array]] = {}
        self.state: list[float] = self._kalman.x.tolist()

    def set_gyro_delay(self, delay: float) -> None:
        """Set the delay of the gyro's low-pass plus the age of its reading in a frame [s]."""
        self.noise = replace(self.noise, gyro_delay=delay)
        self._steps.clear()

    @property
    def x(self) -> Array:
        """States (2, 4)."""
        return np.reshape(self._kalman.x, (len(AXES), STATES)).copy()

    @property
    def P(self) -> Array:  # noqa: N802
        """Covariances (2, 4, 4)."""
        return np.stack([self._kalman.P[_own(k), _own(k)] for k in range(len(AXES))])

    def set_axis(self, axis: int, x: Array, P: Array) -> None:
        """Replace state (4,) and covariance (4, 4) of one axis."""
        own = _own(axis)
        self._kalman.x[own], self._kalman.P[own, own] = x, P
        other = _own(1 - axis)
        self._kalman.P[own, other] = self._kalman.P[other, own] = 0.0
        self.state = self._kalman.x.tolist()

    def angle_variance(self) -> Pair:
        """Return the variance of both angles [rad²]."""
        P = self._kalman.P
        return float(P[ANGLE, ANGLE]), float(P[STATES + ANGLE, STATES + ANGLE])

    def widen(self, axis: int, angle: float, bias: float) -> None:
        """Add standard deviations to the angle [rad] and the bias [rad/s] of one axis."""
        P, first = self._kalman.P, STATES * axis
        P[first + ANGLE, first + ANGLE] += angle**2
        P[first + BIAS, first + BIAS] += bias**2

    def predict(self, dt_us: int) -> None:
        """Move both axes forward by a time step [µs]."""
        step = self._steps.get(dt_us)
        if step is None:
            dt = dt_us * 1e-6
            F = _both(transition(dt, self.noise.gyro_delay))
            step = F, _both(process_noise(dt, self.noise))
            if len(self._steps) < _KEPT_STEPS:
                self._steps[dt_us] = step
        self._kalman.predict(F=step[0], Q=step[1])
        self.state = self._kalman.x.tolist()

    def update(
        self,
        z: Sequence[float],
        variance: Sequence[float],
        covariance: Pair,
        gyro_gain: float,
        use: Sequence[bool],
    ) -> None:
        """Apply the measurements of both axes.

        Parameters
        ----------
        z : both potentiometers' angles [rad] and the gyro's rate [rad/s] of x, then of y (6,)
        variance : of each (6,)
        covariance : of the two potentiometers of each axis [rad²]
        gyro_gain : gyro rate per rate of the ring, cos y [1]
        use : which measurements to apply (6,)
        """
        kalman = self._kalman
        H, R = kalman.H, kalman.R
        H[2, FILTERED] = gyro_gain
        for i, value in enumerate(variance):
            R[i, i] = value
        R[0, 1] = R[1, 0] = covariance[0]
        R[3, 4] = R[4, 3] = covariance[1]
        measured = np.array(z)
        if not all(use):
            rows = [i for i, used in enumerate(use) if used]
            if not rows:
                return
            measured, H, R = measured[rows], H[rows], R[np.ix_(rows, rows)]
        kalman.update(measured, R=R, H=H)
        self.state = kalman.x.tolist()


def _own(axis: int) -> slice:
    return slice(STATES * axis, STATES * (axis + 1))


def _both(A: Array) -> Array:
    """Return the block-diagonal matrix of both axes; the kept values multiply exact zeros."""
    return np.asarray(np.kron(np.eye(len(AXES)), A))
