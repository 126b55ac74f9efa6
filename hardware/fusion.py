"""Kalman filter per gimbal axis over two potentiometers and the holder gyro.

State of an axis: angle θ, rate ω, gyro bias b, and the rate g as the gyro's own low-pass shows it,
which is how the age of the gyro's readings enters. filterpy does the algebra, in Joseph form; both
axes cost 40 µs of the 2000 µs between frames, so no kernel of our own is needed.
"""

from dataclasses import dataclass, replace
from math import cos, exp, radians, sqrt

import numpy as np
from filterpy.kalman import KalmanFilter
from numpy.typing import NDArray

from hardware.calibration.result import Calibration
from hardware.faults import POTENTIOMETERS, Monitor, Prediction, Reading, Remedy
from hardware.frames import GimbalState, Pair, SensorFrame

Array = NDArray[np.float64]

ANGLE, RATE, BIAS, FILTERED = range(4)
LONGEST_STEP = 0.2  # s; after a longer gap the filter starts afresh


@dataclass(frozen=True, slots=True)
class Noise:
    """What the sensors and the motion are assumed to do.

    Attributes
    ----------
    potentiometer : standard deviation of one reading, fraction of the supply [1]
    supply : standard deviation of the common supply error of one frame [1]
    gyro : angle random walk of the gyro [rad/√s]; 0.005 °/s/√Hz is 0.0035 °/√s
    gyro_delay : delay of the gyro's low-pass and its age in the frame [s]
    bias : random walk of the gyro bias [rad/s/√s]
    acceleration : white angular acceleration of the gimbal [rad/s²/√Hz]; a servo reaches
        240 °/s within 20 ms, 4.2/√0.02
    """

    potentiometer: float = 6.5e-4  # 0.6 LSB of noise and 1/√12 LSB of quantisation, of 1024
    supply: float = 5e-4
    gyro: float = radians(0.005) / sqrt(2.0)
    gyro_delay: float = 2.8e-3 + 0.5e-3
    bias: float = radians(0.02)
    acceleration: float = 30.0


def transition(dt: float, delay: float) -> Array:
    """Return F (4, 4) over dt: constant rate, and g following it through a first-order lag."""
    e = exp(-dt / delay) if delay > 0 else 0.0
    return np.array([[1, dt, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 1 - e, 0, e]], dtype=float)


def process_noise(dt: float, delay: float, acceleration: float, bias: float) -> Array:
    """Return Q (4, 4): ∫ φφᵀ over dt with φ(s) = (s, 1, 0, 1 − e^(−s/delay)), plus the bias walk.

    φ is the answer of the state to an impulse of acceleration s ago; the integrals are exact.
    """
    e = exp(-dt / delay) if delay > 0 else 0.0
    angle_g = dt**2 / 2 - delay * (delay * (1 - e) - dt * e)
    rate_g = dt - delay * (1 - e)
    g_g = dt - 2 * delay * (1 - e) + delay / 2 * (1 - e * e)
    q = acceleration**2 * np.array(
        [
            [dt**3 / 3, dt**2 / 2, 0, angle_g],
            [dt**2 / 2, dt, 0, rate_g],
            [0, 0, 0, 0],
            [angle_g, rate_g, 0, g_g],
        ]
    )
    q[BIAS, BIAS] = bias**2 * dt
    return q


class AxisFilter:
    """One axis; measurements are the two potentiometers' angles and the gyro's rate."""

    def __init__(self, noise: Noise, bias_sigma: float) -> None:
        self.noise = noise
        self.bias_sigma = bias_sigma
        self.kalman = KalmanFilter(dim_x=4, dim_z=3)
        self._steps: dict[int, tuple[Array, Array]] = {}
        self._h = np.array([[1, 0, 0, 0], [1, 0, 0, 0], [0, 0, 1, 1]], dtype=float)

    @property
    def x(self) -> Array:
        """State (4, 1)."""
        return np.asarray(self.kalman.x)

    @property
    def P(self) -> Array:  # noqa: N802
        """Covariance of the state (4, 4)."""
        return np.asarray(self.kalman.P)

    def start(self, angle: float, sigma: float) -> None:
        """Begin at rest at an angle [rad] known to sigma [rad]."""
        self.kalman.x = np.array([[angle], [0.0], [0.0], [0.0]])
        rate = radians(300.0)
        self.kalman.P = np.diag([sigma**2, rate**2, self.bias_sigma**2, rate**2])

    def predict(self, dt_us: int) -> None:
        """Go forward by dt [µs]; the matrices of a dt are kept."""
        step = self._steps.get(dt_us)
        if step is None:
            dt, n = dt_us * 1e-6, self.noise
            step = (
                transition(dt, n.gyro_delay),
                process_noise(dt, n.gyro_delay, n.acceleration, n.bias),
            )
            if len(self._steps) < 256:
                self._steps[dt_us] = step
        self.kalman.predict(F=step[0], Q=step[1])

    def update(self, z: Array, R: Array, gyro_gain: float, rows: tuple[int, ...]) -> None:
        """Take in measurements.

        Parameters
        ----------
        z : (3,) both potentiometers' angles [rad], gyro rate [rad/s]
        R : (3, 3) their covariance
        gyro_gain : what the gyro shows of the rate: cos y for the ring's axis [1]
        rows : which of the three to use
        """
        self._h[2, FILTERED] = gyro_gain
        if len(rows) == 3:
            self.kalman.update(z[:, None], R=R, H=self._h)
        elif rows:
            pick = list(rows)
            self.kalman.update(z[pick, None], R=R[np.ix_(pick, pick)], H=self._h[pick])

    def forget(self, angle: float, bias: float) -> None:
        """Widen the angle by a standard deviation [rad] and the bias by another [rad/s]."""
        self.kalman.P[ANGLE, ANGLE] += angle**2
        self.kalman.P[BIAS, BIAS] += bias**2


class Fusion:
    """Sensor frames in, gimbal states out; knows which sensor is wrong.

    Parameters
    ----------
    calibration : maps from readings to angles
    noise : assumptions on sensors and motion
    """

    def __init__(self, calibration: Calibration, noise: Noise | None = None) -> None:
        self.calibration = calibration
        self.noise = noise or Noise()
        self.monitor = Monitor()
        bias_sigma = calibration.gyro.bias_sigma
        self.axes = (AxisFilter(self.noise, bias_sigma), AxisFilter(self.noise, bias_sigma))
        self._sigma_map = self._map_sigmas()
        self._last_us: int | None = None

    def _map_sigmas(self) -> Pair:
        """Return what the calibration leaves open of each axis's angle, at 5° [rad]."""
        at = [self.calibration.potentiometer_sigma(i, radians(5.0)) for i in range(4)]
        return sqrt(at[0] * at[1] + 1e-18), sqrt(at[2] * at[3] + 1e-18)

    def set_gyro_delay(self, delay: float) -> None:
        """Tell the delay of the gyro's low-pass plus the age of its reading in a frame [s]."""
        self.noise = replace(self.noise, gyro_delay=delay)
        for axis in self.axes:
            axis.noise = self.noise
            axis._steps.clear()

    def update(self, frame: SensorFrame) -> GimbalState:
        """Return the gimbal's state at the frame's time stamp."""
        dt_us = 0 if self._last_us is None else frame.device_us - self._last_us
        reading = self._reading(frame, dt_us)
        if self._last_us is None or not 0 < dt_us <= LONGEST_STEP * 1e6:
            self._start(reading)
        else:
            for axis in self.axes:
                axis.predict(dt_us)
        self._last_us = frame.device_us
        remedy = self.monitor.inspect(reading, self._prediction(reading))
        self._absorb(reading, remedy)
        return self._state(frame.time_ns)

    def _reading(self, frame: SensorFrame, dt_us: int) -> Reading:
        maps = self.calibration.potentiometers
        f = frame.potentiometer
        return Reading(
            dt=dt_us * 1e-6,
            fraction=f,
            angle=(
                maps[0].angle(f[0]),
                maps[1].angle(f[1]),
                maps[2].angle(f[2]),
                maps[3].angle(f[3]),
            ),
            gain=(maps[0].gain, maps[1].gain, maps[2].gain, maps[3].gain),
            gyro=frame.gyro,
            rate=self.calibration.gyro.rates(frame.gyro),
        )

    def _start(self, reading: Reading) -> None:
        good = self.monitor.begin(reading)
        for index, axis in enumerate(self.axes):
            angles = [reading.angle[i] for i in (2 * index, 2 * index + 1) if good[i]]
            mean = sum(angles) / len(angles) if angles else 0.0
            axis.start(mean, radians(0.5) if angles else radians(10.0))

    def _prediction(self, reading: Reading) -> Prediction:
        x, y = self.axes
        n = self.noise
        variance = tuple(
            (n.potentiometer * reading.gain[i]) ** 2 + (x, y)[i // 2].kalman.P[ANGLE, ANGLE]
            for i in range(POTENTIOMETERS)
        )
        ax, ay = x.kalman.x, y.kalman.x
        return Prediction(
            angle=(float(ax[ANGLE, 0]), float(ay[ANGLE, 0])),
            rate=(float(ax[RATE, 0]), float(ay[RATE, 0])),
            bias=(float(ax[BIAS, 0]), float(ay[BIAS, 0])),
            variance=variance,
        )

    def _absorb(self, reading: Reading, remedy: Remedy) -> None:
        gains = (cos(float(self.axes[1].kalman.x[ANGLE, 0])), 1.0)
        supply = remedy.supply_sigma if remedy.supply_sigma > 0 else self.noise.supply
        for index, axis in enumerate(self.axes):
            if remedy.forget[index]:
                axis.forget(*remedy.forget[index])
            a, b = 2 * index, 2 * index + 1
            z = np.array([reading.angle[a], reading.angle[b], reading.rate[index]])
            rows = tuple(
                row
                for row, use in enumerate((remedy.use[a], remedy.use[b], remedy.use_gyro[index]))
                if use
            )
            axis.update(z, self._covariance(reading, index, supply, axis), gains[index], rows)

    def _covariance(self, reading: Reading, index: int, supply: float, axis: AxisFilter) -> Array:
        a, b = 2 * index, 2 * index + 1
        n = self.noise
        # A supply error ε turns a reading f into (1+ε)f: both potentiometers err together.
        sa = supply * reading.fraction[a] * reading.gain[a]
        sb = supply * reading.fraction[b] * reading.gain[b]
        own_a = (n.potentiometer * reading.gain[a]) ** 2
        own_b = (n.potentiometer * reading.gain[b]) ** 2
        dt = max(reading.dt, 1e-3)
        scale = self.calibration.gyro.sigma * float(axis.kalman.x[FILTERED, 0])
        gyro = n.gyro**2 / dt + scale * scale
        return np.array([[own_a + sa * sa, sa * sb, 0], [sa * sb, own_b + sb * sb, 0], [0, 0, gyro]])

    def _state(self, time_ns: int) -> GimbalState:
        x, y = self.axes
        sigma = (
            sqrt(float(x.kalman.P[0, 0]) + self._sigma_map[0] ** 2),
            sqrt(float(y.kalman.P[0, 0]) + self._sigma_map[1] ** 2),
        )
        return GimbalState(
            time_ns=time_ns,
            angle=(float(x.kalman.x[ANGLE, 0]), float(y.kalman.x[ANGLE, 0])),
            rate=(float(x.kalman.x[RATE, 0]), float(y.kalman.x[RATE, 0])),
            sigma=sigma,
            healthy=self.monitor.healthy,
        )
