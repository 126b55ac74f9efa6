"""Frozen values exchanged by the seats of the loop: command, sensor frame, gimbal state."""

from dataclasses import dataclass

Pair = tuple[float, float]
Triple = tuple[float, float, float]

AXES = ("x", "y")
"""Names of the two values of a `Pair` of gimbal angles: outer ring, inner holder."""

POTENTIOMETER_NAMES = (
    "potentiometer_x_a",
    "potentiometer_x_b",
    "potentiometer_y_a",
    "potentiometer_y_b",
)
"""Names of `SensorFrame.potentiometer`, in order."""

PAIR_NAMES = ("potentiometers_x", "potentiometers_y")
"""Names of both potentiometers of an axis together."""

SERVO_NAMES = ("servo_x", "servo_y")
"""Names of the two servos of the gimbal."""


class HardwareError(ValueError):
    """A user's mistake with a rig (port, calibration, fault name); the message is one line."""


@dataclass(frozen=True, slots=True)
class GimbalCommand:
    """Gimbal angle commanded by the controller.

    Attributes
    ----------
    time_ns : experiment time of the decision [ns]
    angle : commanded gimbal angle about x (ring) and y (holder) [rad]
    """

    time_ns: int
    angle: Pair


@dataclass(frozen=True, slots=True)
class GimbalState:
    """Gimbal state from simulation or sensors.

    Attributes
    ----------
    time_ns : experiment time the state belongs to [ns]
    angle : gimbal angle about x and y [rad]
    rate : its time derivative [rad/s]
    sigma : standard deviation of the angle; zero where the state is exact [rad]
    healthy : false while a sensor or servo of the gimbal has a named fault
    """

    time_ns: int
    angle: Pair
    rate: Pair = (0.0, 0.0)
    sigma: Pair = (0.0, 0.0)
    healthy: bool = True


@dataclass(frozen=True, slots=True)
class SensorFrame:
    """One telemetry frame in SI units, before any fusion.

    Attributes
    ----------
    time_ns : experiment time at which the device sampled, through the clock estimate [ns]
    device_us : the device's own clock, unwrapped [µs]
    potentiometer : x_a, x_b, y_a, y_b as fractions of the supply [1]
    gyro, accelerometer : holder IMU, sensor frame [rad/s], [m/s²]
    base_gyro, base_accelerometer : base IMU, sensor frame [rad/s], [m/s²]
    pulse : pulse widths in force for servo x, servo y, turntable [s]
    switches : limit switches +x, −x, +y, −y
    joystick : deflection of its two axes, −1…1
    flags : status bits as sent by the firmware
    """

    time_ns: int
    device_us: int
    potentiometer: tuple[float, float, float, float]
    gyro: Triple
    accelerometer: Triple
    base_gyro: Triple
    base_accelerometer: Triple
    pulse: Triple
    switches: tuple[bool, bool, bool, bool]
    joystick: Pair
    flags: int
