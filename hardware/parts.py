"""Figures of the parts a rig is built from that are not on the wire, with their sources."""

from math import asin, cos, radians

STANDARD_GRAVITY = 9.80665  # m/s², CGPM 1901

# 9 g hobby servos: travel as measured on several.
SERVO_TRAVEL = radians(1.0) / 10.3e-6  # rad of shaft per s of pulse width

POTENTIOMETER_TRAVEL = radians(240.0)  # of the track, where none is stated
RAIL = 0.02  # fraction of the supply no wired potentiometer reaches within ±10° of mid-travel
GIMBAL_STOP = radians(10.0)  # of the mechanism, both axes: class "axis" of mjcf/mechanism.xml
SWITCH_ANGLE = radians(9.0)  # of the printed rig: numeric switch_angle of mjcf/bench.xml

# MPU-6000/6050 product specification 6.1 and 6.2, register map revision 4.2.
GYRO_NOISE = radians(0.005)  # rad/s/√Hz, one-sided
GYRO_BIAS_WALK = radians(0.02)  # rad/s/√s while it warms up
MPU6050, MPU6500 = 0x68, 0x70  # WHO_AM_I
# With the gyro of the MPU6500: that, MPU9250 and MPU9255, register map revision 2.1.
SUCCESSORS = (MPU6500, 0x71, 0x73)
GYRO_DELAY_6500_S = (0.97e-3, 2.9e-3, 3.9e-3, 5.9e-3, 9.9e-3, 17.85e-3, 33.48e-3)
GYRO_DELAY_S = (0.98e-3, 1.9e-3, 2.8e-3, 4.8e-3, 8.3e-3, 13.4e-3, 18.6e-3)  # by DLPF setting
# Between two samples of the gyro, by DLPF setting: register map 4.2, register 25; MPU6500 alike.
GYRO_SAMPLE_S = (0.125e-3, 1e-3, 1e-3, 1e-3, 1e-3, 1e-3, 1e-3)
MPU_CLOCK = 0.01  # tolerance of its rate, product specification 6.6
GYRO_SCALE_ERROR = ACCELEROMETER_SCALE_ERROR = 0.03  # tolerance of the sensitivity
ACCELEROMETER_NOISE = 400e-6 * STANDARD_GRAVITY  # m/s²/√Hz


def tilts(force: tuple[float, float, float]) -> tuple[float, float]:
    """Turn of an upright holder about x and y by its accelerometer's reading, at rest [rad].

    x is by y alone: z adds little near the vertical.
    """
    side = 1.0 if force[2] > 0 else -1.0
    x = asin(_unit(side * force[1]))
    return x, asin(_unit(-side * force[0] / max(cos(x), 1e-9)))


def _unit(force: float) -> float:
    return min(max(force / STANDARD_GRAVITY, -1.0), 1.0)
