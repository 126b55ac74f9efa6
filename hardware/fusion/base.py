"""Attitude of a base that one servo turns about x, from the IMU on it: gyro, held by gravity."""

from dataclasses import dataclass
from math import asin, degrees, radians, sqrt
from typing import Any

import numpy as np

from hardware.frames import HardwareError, SensorFrame, Triple
from hardware.fusion.kalman import LONGEST_STEP_US
from hardware.parts import GYRO_BIAS_WALK, GYRO_NOISE, SERVO_TRAVEL, STANDARD_GRAVITY
from hardware.protocol import Flags, constants

TRAVELS = 300.0, 10_000.0  # rad/s of pulse: a hobby servo turns 97° per ms, 1700
LONGEST_PULSE_S = 3e-3
LARGEST_BIAS = radians(40.0)  # twice the data sheet's zero-rate output
LARGEST_TILT = radians(20.0)  # of a base that stands at neutral
LARGEST_SCALE = 0.1  # data sheet: ±3 % each for gyro and accelerometer


@dataclass(frozen=True, slots=True)
class BaseMap:
    """Maps of a base's IMU and turntable servo, from the turntable's calibration.

    Attributes
    ----------
    tilt : by the accelerometer at the neutral pulse [rad]
    gyro_bias : reading at rest [rad/s]
    gyro_scale, tilt_scale : turn about x per turn measured by gyro and accelerometer [1]
    centre, travel : pulse width at neutral [s], turn per pulse width [rad/s]

    Raises
    ------
    HardwareError : an implausible value
    """

    tilt: float = 0.0
    gyro_bias: Triple = (0.0, 0.0, 0.0)
    gyro_scale: float = 1.0
    tilt_scale: float = 1.0
    centre: float = constants.PULSE_NEUTRAL * constants.TICK
    travel: float = SERVO_TRAVEL

    def __post_init__(self) -> None:
        """Check that every value is plausible."""
        limits = [("tilt at neutral", self.tilt, LARGEST_TILT)]
        limits += [("gyro bias", b, LARGEST_BIAS) for b in self.gyro_bias]
        for name, value, limit in limits:
            if not abs(value) <= limit:
                raise HardwareError(
                    f"base IMU: {name} of {degrees(value):.1f}°; must be at most"
                    f" {degrees(limit):.0f}°: check its mounting, and that the base was at rest"
                )
        for scale in (self.gyro_scale, self.tilt_scale):
            if not abs(scale - 1.0) <= LARGEST_SCALE:
                raise HardwareError(
                    f"base IMU: a scale of {scale:.2f}; gyro and accelerometer do not agree on how"
                    " far the base turns: is x the axis of the turntable?"
                )
        lowest, highest = TRAVELS
        if not lowest <= abs(self.travel) <= highest or not 0.0 < self.centre < LONGEST_PULSE_S:
            turn, middle = degrees(self.travel) * 1e-3, self.centre * 1e3
            raise HardwareError(f"turntable: {turn:.3g}° per ms at {middle:.3g} ms is not a servo")

    def rate(self, reading: Triple) -> Triple:
        """Angular rate of the base from a reading of its gyro [rad/s]."""
        x, y, z = reading
        a, b, c = self.gyro_bias
        return (x - a) * self.gyro_scale, y - b, z - c

    def turn(self, accelerometer: Triple) -> float:
        """Turn of the base since neutral from a reading of its accelerometer [rad]."""
        return (tilt(accelerometer) - self.tilt) * self.tilt_scale

    def pulse(self, turn: float) -> float:
        """Pulse width for a turn of the base [rad] → [s]."""
        return self.centre + turn / self.travel


def tilt(accelerometer: Triple) -> float:
    """Turn about x by gravity, base at rest, its z pointing down [rad].

    By y alone: z adds little near the vertical, but its offset and scale would bend the slope.
    """
    return asin(min(max(-accelerometer[1] / STANDARD_GRAVITY, -1.0), 1.0))


@dataclass(frozen=True, slots=True)
class BaseNoise:
    """Assumed noise of the base IMU.

    Attributes
    ----------
    gyro : angle random walk [rad/√s]; 0.005 °/s/√Hz one-sided is 0.0035 °/√s
    scale : uncertainty of the gyro's scale [1], over moves of `move` [s]
    bias : random walk of its bias [rad/s/√s]
    bias_sigma : of the bias at the start [rad/s]
    tilt : of one accelerometer reading at rest [rad]; 400 µg/√Hz over some 200 Hz is 0.33°
    lever : further per angular rate [s]: the IMU sits 56 mm off the axis and a servo changes its
        speed within 30 ms, 0.056/(0.03·9.81)
    """

    gyro: float = GYRO_NOISE / sqrt(2.0)
    scale: float = 0.01
    move: float = 0.1
    bias: float = GYRO_BIAS_WALK
    bias_sigma: float = radians(0.2)
    tilt: float = radians(0.4)
    lever: float = 0.2


class BaseAttitude:
    """Kalman filter (filterpy) over turn and gyro bias: gyro as input, gravity as measurement.

    Parameters
    ----------
    base : map of this base
    noise : assumptions

    Attributes
    ----------
    angle, rate : turn about x since neutral [rad] and its time derivative [rad/s]
    sigma : standard deviation of `angle` [rad]
    """

    def __init__(self, base: BaseMap, noise: BaseNoise | None = None) -> None:
        from filterpy.kalman import KalmanFilter  # slow to import, see `kalman.GimbalFilter`

        self.base, self.noise = base, noise or BaseNoise()
        self.angle = self.rate = 0.0
        self._kalman: Any = KalmanFilter(dim_x=2, dim_z=1, dim_u=1)
        self._kalman.x = np.zeros(2)
        # The angle is zero at the pose of the calibration.
        self._kalman.P = np.diag([radians(0.1) ** 2, self.noise.bias_sigma**2])
        self._kalman.H = np.array([[1.0, 0.0]])
        self._kalman.inv = np.reciprocal  # S is 1×1
        self._last_us: int | None = None
        self._last_rate = 0.0

    @property
    def sigma(self) -> float:
        """Standard deviation of the angle [rad]."""
        return sqrt(self._kalman.P[0, 0])

    def update(self, frame: SensorFrame) -> None:
        """Process one frame."""
        rate = self.base.rate(frame.base_gyro)[0]
        if self._last_us is not None:
            self._predict(frame.device_us - self._last_us, rate)
        self._last_us, self._last_rate = frame.device_us, rate
        if frame.flags & Flags.BASE_IMU:
            spread = self.noise.tilt + self.noise.lever * abs(rate)
            self._kalman.update(self.base.turn(frame.base_accelerometer), R=spread * spread)
        self.angle, bias = self._kalman.x.tolist()
        self.rate = rate - bias

    def _predict(self, dt_us: int, rate: float) -> None:
        n, dt, kalman = self.noise, dt_us * 1e-6, self._kalman
        if not 0 < dt_us <= LONGEST_STEP_US:  # after a gap the base may be at any turn
            kalman.P[0] = kalman.P[:, 0] = 0.0
            kalman.P[0, 0] = radians(45.0) ** 2
            return
        mean = 0.5 * (rate + self._last_rate)
        walk = n.gyro**2 + (n.scale * mean) ** 2 * n.move
        kalman.predict(
            u=np.array([mean]),
            B=np.array([[dt], [0.0]]),
            F=np.array([[1.0, -dt], [0.0, 1.0]]),
            Q=np.array([[walk * dt, 0.0], [0.0, n.bias**2 * dt]]),
        )
