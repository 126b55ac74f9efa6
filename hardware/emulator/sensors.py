"""Error models of the rig's sensors: potentiometers on a 10-bit ADC, MPU6050, limit switches."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from math import pi, radians, sin

import numpy as np
from numpy.typing import NDArray

from hardware.frames import Pair, Triple
from hardware.parts import (
    ACCELEROMETER_NOISE,
    GYRO_BIAS_WALK,
    GYRO_NOISE,
    MPU_CLOCK,
    POTENTIOMETER_TRAVEL,
    SWITCH_ANGLE,
)
from hardware.protocol import constants as c

_PAST = 4  # values kept: a sample is read up to 1 ms after it was taken, and sent 1 ms later
_ROUNDING = 1e-9  # s; an instant at which a sample is taken shows that sample


class Gaussian:
    """Standard normal numbers one by one, sampled in blocks because single samples are slow."""

    def __init__(self, rng: np.random.Generator) -> None:
        self._rng = rng
        self._block: Iterator[float] = iter(())

    def __call__(self) -> float:
        """Return the next number."""
        for value in self._block:
            return value
        self._block = iter(self._rng.standard_normal(4096).tolist())
        return next(self._block)


@dataclass(frozen=True, slots=True)
class Potentiometer:
    """Ratiometric potentiometer: its reading is a fraction of the ADC's reference.

    Attributes
    ----------
    zero : fraction at zero angle [1]
    direction : +1, or −1 at the other end of the axis
    scale : deviation of the track length [1]
    bend, period, phase : waviness of the track: amplitude [rad], period [rad], phase [rad]
    noise : of one reading before quantisation, in steps of the ADC [LSB]
    """

    zero: float = 0.5
    direction: int = 1
    scale: float = 1.0
    bend: float = 0.0
    period: float = radians(12.0)
    phase: float = 0.0
    noise: float = 0.6

    def fraction(self, angle: float) -> float:
        """Return the reading at an angle [rad], before noise and quantisation [1]."""
        wave = self.bend * sin(2 * pi * angle / self.period + self.phase)
        return self.zero + self.direction * self.scale * (angle + wave) / POTENTIOMETER_TRAVEL


@dataclass(frozen=True, slots=True)
class Mpu6050:
    """Offsets and scales of one chip, MPU-6000/6050 product specification 6.1 and 6.2.

    Attributes
    ----------
    gyro_bias : zero-rate output [rad/s]
    gyro_matrix : scale and cross-axis sensitivity, rows of the reading [1]
    bias_walk : of the zero-rate output while it warms up [rad/s/√s]
    accelerometer_bias : [m/s²]
    accelerometer_scale : [1]
    clock : by how much its own clock is fast [1]
    """

    gyro_bias: Triple = (0.0, 0.0, 0.0)
    gyro_matrix: tuple[Triple, Triple, Triple] = ((1, 0, 0), (0, 1, 0), (0, 0, 1))
    bias_walk: float = GYRO_BIAS_WALK
    accelerometer_bias: Triple = (0.0, 0.0, 0.0)
    accelerometer_scale: Triple = (1.0, 1.0, 1.0)
    clock: float = 0.0037  # no two clocks agree: any phase comes by within 0.3 s


@dataclass(frozen=True, slots=True)
class SensorParameters:
    """All sensors of a rig; limit switches close at their angle and open `differential` before."""

    potentiometers: tuple[Potentiometer, Potentiometer, Potentiometer, Potentiometer] = (
        Potentiometer(),
        Potentiometer(direction=-1),
        Potentiometer(),
        Potentiometer(direction=-1),
    )
    imus: tuple[Mpu6050, Mpu6050] = (Mpu6050(), Mpu6050())
    supply_ripple: float = 3e-4
    switch_angle: tuple[float, float, float, float] = (
        SWITCH_ANGLE,
        -SWITCH_ANGLE,
        SWITCH_ANGLE,
        -SWITCH_ANGLE,
    )
    differential: float = radians(0.4)


def _triple(values: NDArray[np.float64]) -> Triple:
    return float(values[0]), float(values[1]), float(values[2])


def _imu(rng: np.random.Generator) -> Mpu6050:
    matrix = np.diag(rng.uniform(0.97, 1.03, 3)) + rng.normal(0, 0.005, (3, 3))
    bias = np.radians(rng.uniform(-20, 20, 3))
    return Mpu6050(
        gyro_bias=_triple(bias),
        gyro_matrix=(_triple(matrix[0]), _triple(matrix[1]), _triple(matrix[2])),
        accelerometer_bias=_triple(rng.normal(0, 0.25, 3)),
        accelerometer_scale=_triple(rng.uniform(0.97, 1.03, 3)),
    )


def sample(rng: np.random.Generator, switch_sigma: float = radians(0.03)) -> SensorParameters:
    """Return sensors with random tolerances.

    Parameters
    ----------
    rng : random generator
    switch_sigma : standard deviation of the printed rig's switch angles [rad]
    """
    base = SensorParameters()
    potentiometers = tuple(
        replace(
            p,
            zero=0.5 + rng.uniform(-0.015, 0.015),
            scale=rng.uniform(0.95, 1.05),
            bend=radians(0.05),
            phase=rng.uniform(0, 2 * pi),
        )
        for p in base.potentiometers
    )
    errors = rng.normal(0, switch_sigma, 4)
    a, b, d, e = potentiometers
    clocks = rng.spawn(1)[0].uniform(-MPU_CLOCK, MPU_CLOCK, 2).tolist()
    return replace(
        base,
        potentiometers=(a, b, d, e),
        imus=(replace(_imu(rng), clock=clocks[0]), replace(_imu(rng), clock=clocks[1])),
        switch_angle=tuple((np.array(base.switch_angle) + errors).tolist()),
        differential=radians(rng.uniform(0.2, 0.6)),
    )


class ImuPair:
    """Both IMUs at once: noise, low-pass, sampling and quantisation of 2 × (gyro, accelerometer).

    Each samples by its own clock, in no step with the board's; its registers show the latest
    sample. Vectors are (12,): holder gyro, holder accelerometer, base gyro, base accelerometer.
    """

    def __init__(self, parameters: tuple[Mpu6050, Mpu6050], rng: np.random.Generator) -> None:
        self._rng = rng
        self._matrix = np.zeros((12, 12))
        self.bias = np.zeros(12)
        self._noise = np.zeros(12)
        self._walk = np.zeros(12)
        self._lsb = np.zeros(12)
        for k, imu in enumerate(parameters):
            g, a = slice(6 * k, 6 * k + 3), slice(6 * k + 3, 6 * k + 6)
            self._matrix[g, g] = imu.gyro_matrix
            self._matrix[a, a] = np.diag(imu.accelerometer_scale)
            self.bias[g], self.bias[a] = imu.gyro_bias, imu.accelerometer_bias
            self._noise[g], self._noise[a] = GYRO_NOISE, ACCELEROMETER_NOISE
            self._walk[g] = imu.bias_walk
            self._lsb[g], self._lsb[a] = c.GYRO_SCALE, c.ACCELEROMETER_SCALE
        self._stage = np.zeros((2, 12))
        self._past = np.zeros((_PAST, 12))  # the second stage now, `_dt` earlier, ...
        self._time, self._dt, self._period = 0.0, 1.0, 1e-3
        self._clock = [1.0 + imu.clock for imu in parameters]
        self._phase: list[float] = rng.spawn(1)[0].uniform(0.0, 1e-3, 2).tolist()
        self._samples = np.empty((0, 12))
        self._at = 0
        self._primed = False

    def advance(
        self, dt: float, truth: NDArray[np.float64], delay: float, period: float = 1e-3
    ) -> None:
        """Advance by dt [s] of true motion (12,).

        Parameters
        ----------
        delay : of the low-pass [s]
        period : between two samples, by the chips' clocks [s]
        """
        if self._at >= len(self._samples):
            self._samples, self._at = self._rng.standard_normal((1024, 12)), 0
        sample = self._samples[self._at]
        self._at += 1
        self.bias += self._walk * (dt**0.5) * sample[::-1]
        sensed = self._matrix @ truth + self.bias + self._noise * (0.5 / dt) ** 0.5 * sample
        if not self._primed:
            self._stage[:] = sensed
            self._past[:] = sensed
            self._primed = True
        self._time, self._dt, self._period = self._time + dt, dt, period
        blend = dt / (dt + delay / 2)  # two first-order stages, each with half of the delay
        self._stage[0] += blend * (sensed - self._stage[0])
        self._stage[1] += blend * (self._stage[0] - self._stage[1])
        self._past[1:] = self._past[:-1]
        self._past[0] = self._stage[1]

    def sampled(self, chip: int, age: float) -> float:
        """Return how long ago the sample was taken that a chip's registers showed `age` ago [s]."""
        period = self._period / self._clock[chip]
        since = self._time - age - self._phase[chip] + _ROUNDING
        return age + since % period - _ROUNDING

    def updates(self) -> list[tuple[float, int]]:
        """Return the samples of the latest `advance`: how long ago [s], chip; oldest first."""
        taken = []
        for chip in (0, 1):
            age = self.sampled(chip, 0.0)
            while age < self._dt:
                taken.append((age, chip))
                age += self._period / self._clock[chip]
        return sorted(taken, reverse=True)

    def counts(self, age: Pair = (0.0, 0.0)) -> list[int]:
        """Return the registers (12,), saturated at 16 bit.

        Parameters
        ----------
        age : how long ago holder and base were read, at most two advances [s]
        """
        value = np.empty(12)
        for chip in (0, 1):
            back = min(self.sampled(chip, age[chip]) / self._dt, _PAST - 1.001)
            k, half = int(back), slice(6 * chip, 6 * chip + 6)
            newer, older = self._past[k, half], self._past[k + 1, half]
            value[half] = newer + (back - k) * (older - newer)
        codes = np.clip(np.rint(value / self._lsb), -32768, 32767)
        values: list[int] = codes.astype(int).tolist()
        return values
