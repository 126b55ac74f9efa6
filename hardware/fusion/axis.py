"""Kalman filter of one gimbal axis: design with filterpy, and the same step compiled.

State: angle θ, rate ω, gyro bias b, and the rate g as the gyro's own low-pass shows it, which is
how the age of the gyro's readings enters. Measurements: both potentiometers' angles, gyro rate.

filterpy's predict and update of two axes cost 45 µs a frame, most of the 60 µs that fusion and
fault detection may take together, so the loop runs the compiled step below (5 µs); `reference` is
the same filter in filterpy, and a test holds the two equal to 1e-12.
"""

from dataclasses import dataclass
from math import exp, sqrt
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

from hardware.parts import GYRO_BIAS_WALK, GYRO_DELAY_S, GYRO_NOISE
from hardware.protocol import constants

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

ANGLE, RATE, BIAS, FILTERED = range(4)
LONGEST_STEP_US = 200_000  # after a longer gap nobody knows what happened: a filter starts afresh


@dataclass(frozen=True, slots=True)
class Noise:
    """What the sensors and the motion are assumed to do.

    Attributes
    ----------
    potentiometer : standard deviation of one reading, fraction of the supply [1]
    supply : standard deviation of the common supply error of one frame [1]
    gyro : angle random walk of the gyro [rad/√s]; 0.005 °/s/√Hz one-sided is 0.0035 °/√s
    gyro_delay : delay of the gyro's low-pass and age of its reading in the frame [s]
    bias : random walk of the gyro bias [rad/s/√s]
    acceleration : white angular acceleration of the gimbal [rad/s²/√Hz]; a servo reaches
        240 °/s within 20 ms, 4.2/√0.02
    """

    potentiometer: float = 6.5e-4  # 0.6 LSB of noise and 1/√12 LSB of quantisation, of 1024
    supply: float = 5e-4
    gyro: float = GYRO_NOISE / sqrt(2.0)
    gyro_delay: float = GYRO_DELAY_S[constants.DLPF] + 0.6e-3
    bias: float = GYRO_BIAS_WALK
    acceleration: float = 30.0


def transition(dt: float, delay: float) -> Array:
    """Return F (4, 4) over dt: constant rate, and g following it through a first-order lag."""
    e = exp(-dt / delay) if delay > 0 else 0.0
    return np.array([[1, dt, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 1 - e, 0, e]], dtype=float)


def process_noise(dt: float, noise: Noise) -> Array:
    """Return Q (4, 4): ∫ φφᵀ over dt with φ(s) = (s, 1, 0, 1 − e^(−s/delay)), plus the bias walk.

    φ is the answer of the state to an impulse of acceleration s ago; the integrals are exact.
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
    """Return H (3, 4); the ring's gyro shows cos y of the rate, hence the gain [1]."""
    return np.array([[1, 0, 0, 0], [1, 0, 0, 0], [0, 0, 1, gyro_gain]], dtype=float)


def reference(dt: float, noise: Noise, gyro_gain: float, R: Array) -> Any:  # noqa: ANN401
    """Return the filter of one axis as filterpy has it, an untyped `KalmanFilter`."""
    from filterpy.kalman import KalmanFilter

    kalman = KalmanFilter(dim_x=4, dim_z=3)
    kalman.F, kalman.Q = transition(dt, noise.gyro_delay), process_noise(dt, noise)
    kalman.H, kalman.R = observation(gyro_gain), R
    return kalman


@numba.njit(cache=True)
def _sandwich(A: Array, P: Array, plus: Array) -> Array:
    """Return A P Aᵀ + plus by plain loops: faster than BLAS here, and quicker to compile."""
    rows, n = A.shape
    AP = np.zeros((rows, n))
    for i in range(rows):
        for j in range(n):
            for k in range(n):
                AP[i, j] += A[i, k] * P[k, j]
    out = np.zeros((rows, rows))
    for i in range(rows):
        for j in range(rows):
            out[i, j] = plus[i, j]
            for k in range(n):
                out[i, j] += AP[i, k] * A[j, k]
    return out


@numba.njit(cache=True)
def _gain(P: Array, H: Array, R: Array) -> Array:
    """Return the Kalman gain P Hᵀ (H P Hᵀ + R)⁻¹, by Gauss-Jordan: S is positive definite."""
    m, n = H.shape
    S = _sandwich(H, P, R)
    K = np.zeros((m, n))  # transposed while it is solved for
    for i in range(m):
        for j in range(n):
            for k in range(n):
                K[i, j] += H[i, k] * P[k, j]
    for p in range(m):
        for i in range(m):
            if i == p:
                continue
            factor = S[i, p] / S[p, p]
            for j in range(m):
                S[i, j] -= factor * S[p, j]
            for j in range(n):
                K[i, j] -= factor * K[p, j]
    gain = np.zeros((n, m))
    for i in range(n):
        for p in range(m):
            gain[i, p] = K[p, i] / S[p, p]
    return gain


@numba.njit(cache=True)
def predict(x: Array, P: Array, F: Array, Q: Array) -> None:
    """Take states (n, 4) and covariances (n, 4, 4) one step forward, in place."""
    for axis in range(x.shape[0]):
        before = x[axis].copy()
        for i in range(4):
            x[axis, i] = 0.0
            for j in range(4):
                x[axis, i] += F[i, j] * before[j]
        P[axis] = _sandwich(F, P[axis], Q)


@numba.njit(cache=True)
def update(x: Array, P: Array, z: Array, R: Array, gyro_gain: Array, use: Flags) -> None:
    """Take in measurements of every axis, in Joseph form, in place.

    Parameters
    ----------
    x, P : states (n, 4) and covariances (n, 4, 4)
    z : both potentiometers' angles [rad] and the gyro's rate [rad/s] (n, 3)
    R : their covariance (n, 3, 3)
    gyro_gain : what the gyro shows of the rate (n,)
    use : which measurements to take (n, 3)
    """
    for axis in range(x.shape[0]):
        rows = np.nonzero(use[axis])[0]
        m = rows.size
        if m == 0:
            continue
        H, noise, y = np.zeros((m, 4)), np.zeros((m, m)), np.zeros(m)
        for i in range(m):
            if rows[i] < 2:
                H[i, 0] = 1.0
            else:
                H[i, 2], H[i, 3] = 1.0, gyro_gain[axis]
            y[i] = z[axis, rows[i]]
            for j in range(4):
                y[i] -= H[i, j] * x[axis, j]
            for j in range(m):
                noise[i, j] = R[axis, rows[i], rows[j]]
        K = _gain(P[axis], H, noise)
        keep = np.eye(4)
        for i in range(4):
            for k in range(m):
                x[axis, i] += K[i, k] * y[k]
                for j in range(4):
                    keep[i, j] -= K[i, k] * H[k, j]
        P[axis] = _sandwich(keep, P[axis], _sandwich(K, noise, np.zeros((4, 4))))
