"""What a calibration knows of one rig: pulses to angles, readings to angles, and how well."""

from dataclasses import dataclass
from math import radians

from hardware.frames import HardwareError, Pair, Triple

Matrix = tuple[Pair, Pair]
Covariance = tuple[tuple[float, ...], ...]


class CalibrationError(HardwareError):
    """A calibration that cannot be: the run, the file or the rig does not fit."""


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
    sigma: float = 0.03  # scale tolerance, MPU-6050 product specification 6.1
    bias_sigma: float = radians(20.0)  # zero-rate output, same table

    def rates(self, gyro: Triple) -> Pair:
        """Return (x rate · cos y, y rate) from a reading [rad/s]."""
        (a, b), (c, d) = self.matrix
        u, v = gyro[0] - self.bias[0], gyro[1] - self.bias[1]
        scale = 1.0 / (a * d - b * c)
        return (d * u - b * v) * scale, (a * v - c * u) * scale


@dataclass(frozen=True, slots=True)
class Calibration:
    """One rig's maps between pulses, readings and gimbal angles.

    Attributes
    ----------
    rig : serial number of the board, as it said in HELLO, u32
    zero : pulse widths that hold the gimbal at zero, mean of both approach directions [s]
    matrix : gimbal angle per pulse width, rows x and y [rad/s]
    potentiometers : x_a, x_b, y_a, y_b
    gyro : holder gyro
    switch_angle : closing angles of +x, −x, +y, −y as the rig was built [rad]
    zero_covariance : of zero [s²]
    matrix_covariance : of (xx, xy, yx, yy) [rad²/s²]
    hysteresis : width between the approach directions, per axis [rad]
    hysteresis_sigma : its standard deviation [rad]
    repeatability : standard deviation of one approach, per axis [rad]
    """

    rig: int
    zero: Pair
    matrix: Matrix
    potentiometers: tuple[PotentiometerMap, PotentiometerMap, PotentiometerMap, PotentiometerMap]
    gyro: GyroMap = GyroMap()
    switch_angle: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)
    zero_covariance: Covariance = ((0.0, 0.0), (0.0, 0.0))
    matrix_covariance: Covariance = ((0.0,) * 4,) * 4
    hysteresis: Pair = (0.0, 0.0)
    hysteresis_sigma: Pair = (0.0, 0.0)
    repeatability: Pair = (0.0, 0.0)

    def pulses(self, angle: Pair) -> Pair:
        """Return the pulse widths that hold a gimbal angle [rad] → [s]."""
        (a, b), (c, d) = self.matrix
        scale = 1.0 / (a * d - b * c)
        x, y = angle
        return (
            self.zero[0] + (d * x - b * y) * scale,
            self.zero[1] + (a * y - c * x) * scale,
        )

    def angles(self, pulses: Pair) -> Pair:
        """Return the gimbal angle that pulse widths lead to [s] → [rad]."""
        (a, b), (c, d) = self.matrix
        u, v = pulses[0] - self.zero[0], pulses[1] - self.zero[1]
        return a * u + b * v, c * u + d * v

    def potentiometer_sigma(self, index: int, angle: float) -> float:
        """Return the standard deviation of a potentiometer's map at an angle [rad]."""
        line = self.potentiometers[index]
        (zz, zg), (_, gg) = line.covariance
        dz, dg = -line.gain, angle / line.gain
        return float(max(0.0, dz * dz * zz + 2 * dz * dg * zg + dg * dg * gg) ** 0.5)


def nominal(rig: int = 0) -> Calibration:
    """Return what the drawings say, for a rig that was never calibrated.

    Servo travel 10.3 µs/° (field measurement of 9 g servos), 2.25° of servo shaft per degree of
    gimbal, 240° potentiometers facing each other on each axis, pulses centred on 1.5 ms.
    """
    per_second = 1.0 / (10.3e-6 * 2.25) * radians(1.0)
    # Glued on by eye, track length as sold: 0.015 of the travel is 3.6°, and 5 %.
    spread = ((0.015**2, 0.0), (0.0, radians(12.0) ** 2))
    forward = PotentiometerMap(0.5, radians(240.0), spread)
    backward = PotentiometerMap(0.5, -radians(240.0), spread)
    return Calibration(
        rig=rig,
        zero=(1.5e-3, 1.5e-3),
        matrix=((per_second, 0.0), (0.0, per_second)),
        potentiometers=(forward, backward, forward, backward),
    )
