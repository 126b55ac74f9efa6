"""What a calibration has measured of one rig: pulses and readings to angles, with covariance."""

from dataclasses import dataclass, field
from math import degrees, radians

import numpy as np
from numpy.typing import NDArray

from hardware.calibration.linearisation import Linearisation, Matrix
from hardware.frames import AXES, Pair, Triple
from hardware.parts import GYRO_SCALE_ERROR, POTENTIOMETER_TRAVEL, SERVO_TRAVEL
from hardware.protocol import constants

Covariance = tuple[tuple[float, ...], ...]
Array = NDArray[np.float64]

NEUTRAL = constants.PULSE_NEUTRAL * constants.TICK  # s
SHAFT_PER_GIMBAL = 2.25  # of the designed linkage, about zero
LARGEST_DEVIATION = radians(0.4)  # sound rigs stay below: 0.10 to 0.32° in 16 units
EXACT: Covariance = ((0.0,) * 6,) * 6


@dataclass(frozen=True, slots=True)
class PotentiometerMap:
    """Straight line from a reading to the angle of one gimbal axis.

    Attributes
    ----------
    zero : reading at zero angle, fraction of the supply [1]
    gain : angle per full supply; negative when mounted the other way round [rad]
    covariance : of (zero [1], gain [rad])
    """

    zero: float
    gain: float
    covariance: Covariance = ((0.0, 0.0), (0.0, 0.0))

    def angle(self, fraction: float) -> float:
        """Return the angle of a reading [rad]."""
        return (fraction - self.zero) * self.gain

    def fraction(self, angle: float) -> float:
        """Return the reading expected at an angle [1]."""
        return self.zero + angle / self.gain


@dataclass(frozen=True, slots=True)
class GyroMap:
    """Holder gyro to gimbal rates: `reading = matrix @ (x rate · cos y, y rate) + bias`.

    Attributes
    ----------
    bias : reading at rest, sensor x, y, z [rad/s]
    matrix : scale and misalignment of the sensor's x and y [1]
    sigma : standard deviation of an entry of the matrix [1]
    bias_sigma : standard deviation of the bias when the rig is switched on again [rad/s]
    """

    bias: Triple = (0.0, 0.0, 0.0)
    matrix: Matrix = ((1.0, 0.0), (0.0, 1.0))
    sigma: float = GYRO_SCALE_ERROR
    bias_sigma: float = radians(20.0)  # zero-rate output, MPU-6050 product specification 6.1

    def rates(self, gyro: Triple) -> Pair:
        """Return (x rate · cos y, y rate) from a reading [rad/s]."""
        (a, b), (c, d) = self.matrix
        u, v = gyro[0] - self.bias[0], gyro[1] - self.bias[1]
        scale = 1.0 / (a * d - b * c)
        return (d * u - b * v) * scale, (a * v - c * u) * scale


@dataclass(frozen=True, slots=True)
class Calibration:
    """One rig's maps between pulses, readings and gimbal angles.

    A command is sent as `pulses = zero + matrix⁻¹ · linearised(angle)`.

    Attributes
    ----------
    rig : serial number of the board, as given in its HELLO, u32
    zero : pulse widths that hold the gimbal at zero, mean of both approach directions [s]
    matrix : gimbal angle per pulse width at zero, rows x and y [rad/s]
    potentiometers : x_a, x_b, y_a, y_b
    gyro : holder gyro
    switch_angle : at which the limit switches were taken to close [rad]
    covariance : of (zero x, zero y, matrix xx, xy, yx, yy), (6, 6) [s], [rad/s]
    hysteresis, hysteresis_sigma : of the servo and its linkage, as gimbal angle [rad]
    repeatability : standard deviation between approaches of a switch [rad]
    deviation : root mean square of the map against the potentiometers between the switches; play
        that a weight takes up shows here, and a wrong linearisation; zero where unknown [rad]
    linearisation : gimbal angle to linearised angle of this rig's mechanism
    minimal : the rig has no potentiometers; `potentiometers` are then maps from the tilt that the
        holder's accelerometer shows [rad], those of an axis alike
    track : travel of the potentiometers' tracks, as stated at the calibration [rad]
    """

    rig: int
    zero: Pair
    matrix: Matrix
    potentiometers: tuple[PotentiometerMap, PotentiometerMap, PotentiometerMap, PotentiometerMap]
    gyro: GyroMap = GyroMap()
    switch_angle: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)
    covariance: Covariance = EXACT
    hysteresis: Pair = (0.0, 0.0)
    hysteresis_sigma: Pair = (0.0, 0.0)
    repeatability: Pair = (0.0, 0.0)
    deviation: Pair = (0.0, 0.0)
    linearisation: Linearisation = field(default_factory=Linearisation)
    minimal: bool = False
    track: float = POTENTIOMETER_TRAVEL

    @property
    def zero_covariance(self) -> Covariance:
        """Covariance of `zero`, (2, 2) [s²]."""
        return tuple(row[:2] for row in self.covariance[:2])

    @property
    def matrix_covariance(self) -> Covariance:
        """Covariance of the entries of `matrix`, row by row, (4, 4) [rad²/s²]."""
        return tuple(row[2:] for row in self.covariance[2:])

    @property
    def note(self) -> str:
        """Warning for the user in one line, "" without one."""
        worst = max(self.deviation)
        if self.linearisation.straight and not worst:
            return (
                "the calibration holds only a straight line from angles to pulse widths, up to 0.9°"
                " off the shipped mechanism; run `twin calibrate` again for the whole map"
            )
        if worst > LARGEST_DEVIATION:
            sensor = "accelerometer is" if self.minimal else "potentiometers are"
            return (
                f"the {sensor} {degrees(worst):.2f}° (rms) off the calibration between"
                " the limit switches: play, or another mechanism than it was made for"
            )
        for k, axis in enumerate(() if self.minimal else AXES):
            a, b = self.potentiometers[2 * k : 2 * k + 2]
            if a.gain * b.gain > 0:
                return (
                    f"both potentiometers of {axis} rise the same way: one is mounted mirrored;"
                    " angles are right, but a supply sag may look like motion; exchange the wires"
                    " of its two ends and calibrate again"
                )
        return ""

    def pulses(self, angle: Pair) -> Pair:
        """Return the pulse widths that hold a gimbal angle [rad] → [s]."""
        (a, b), (c, d) = self.matrix
        scale = 1.0 / (a * d - b * c)
        x, y = self.linearisation.linearised(angle)
        return (
            self.zero[0] + (d * x - b * y) * scale,
            self.zero[1] + (a * y - c * x) * scale,
        )

    def angles(self, pulses: Pair) -> Pair:
        """Return the gimbal angle that pulse widths lead to [s] → [rad]."""
        (a, b), (c, d) = self.matrix
        u, v = pulses[0] - self.zero[0], pulses[1] - self.zero[1]
        return self.linearisation.angle((a * u + b * v, c * u + d * v))

    def sigma(self, angle: Pair) -> Pair:
        """Return the standard deviation of the gimbal angle that a commanded angle leads to [rad].

        Delta method over zero, matrix and linearisation: a wrong map leads to the linearised angle
        s + δM (p − zero) − M δzero, and the slope of the linearisation takes that to angles; the
        deviation between the switches adds to it. It is of the mean of both approach directions;
        half the hysteresis comes on top on each side.
        """
        offset = np.subtract(self.pulses(angle), self.zero)
        matrix = np.array(self.matrix)
        lever = np.zeros((2, 6))
        lever[:, :2] = -matrix
        lever[0, 2:4] = lever[1, 4:] = offset
        turned = np.linalg.solve(np.array(self.linearisation.slope(angle)), lever)
        spread = turned @ np.array(self.covariance) @ turned.T
        known = np.square(self.deviation) + self.linearisation.sigma**2
        x, y = np.sqrt(np.diag(spread).clip(0.0) + known).tolist()
        return x, y

    def potentiometer_sigma(self, index: int, angle: float) -> float:
        """Return the standard deviation of a potentiometer's map at an angle [rad]."""
        line = self.potentiometers[index]
        (zz, zg), (_, gg) = line.covariance
        dz, dg = -line.gain, angle / line.gain
        return float(max(0.0, dz * dz * zz + 2 * dz * dg * zg + dg * dg * gg) ** 0.5)


def nominal(rig: int = 0) -> Calibration:
    """Return the designed values, for a rig that was never calibrated.

    The two potentiometers of an axis face each other; figures of servos and potentiometers are
    those of `hardware.parts`.
    """
    per_second = SERVO_TRAVEL / SHAFT_PER_GIMBAL
    # Glued on by eye, track length as sold: 0.015 of the travel is 3.6°, and 5 %.
    spread = ((0.015**2, 0.0), (0.0, radians(12.0) ** 2))
    forward = PotentiometerMap(0.5, POTENTIOMETER_TRAVEL, spread)
    backward = PotentiometerMap(0.5, -POTENTIOMETER_TRAVEL, spread)
    # Uniform: trim ±40 µs and assembly ±1.5°; travel ±4 %, linkage ±4 % along and across.
    zero, own, across = 31e-6, 0.033 * per_second, 0.023 * per_second
    return Calibration(
        rig=rig,
        zero=(NEUTRAL, NEUTRAL),
        matrix=((per_second, 0.0), (0.0, per_second)),
        potentiometers=(forward, backward, forward, backward),
        covariance=_diagonal((zero, zero, own, across, across, own)),
    )


def _diagonal(sigmas: tuple[float, ...]) -> Covariance:
    return tuple(tuple(float(v) for v in row) for row in np.diag(np.square(sigmas)))
