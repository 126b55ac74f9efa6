"""Input of the fault monitor for one frame, and its output to the filter."""

from typing import NamedTuple

from hardware.frames import POTENTIOMETER_NAMES, Pair, Triple

POTENTIOMETERS = len(POTENTIOMETER_NAMES)
Quad = tuple[float, float, float, float]


class Reading(NamedTuple):
    """One frame in angles and rates.

    Attributes
    ----------
    dt : time since the previous frame [s]
    fraction : potentiometer readings [1]
    angle : the same as angles [rad]
    gain : angle per full supply, signed [rad]
    gyro : raw reading of the holder gyro [rad/s]
    rate : calibrated x rate · cos y, and y rate, bias not removed [rad/s]
    fresh : the gyro was read for this frame; else its last reading is repeated
    command : gimbal angles of the pulse widths in force; None while the servos are not driven [rad]
    switches : closed limit switches +x, −x, +y, −y
    carried : rates of the base about the same axes, which were subtracted from it [rad/s]
    turn : of the base about x by its accelerometer, since neutral [rad]
    force, base_force : readings of the accelerometers on holder and base [m/s²]
    """

    dt: float
    fraction: Quad
    angle: Quad
    gain: Quad
    gyro: Triple
    rate: Pair
    fresh: bool = True
    command: Pair | None = None
    switches: tuple[bool, bool, bool, bool] = (False, False, False, False)
    force: Triple = (0.0, 0.0, 0.0)
    base_force: Triple = (0.0, 0.0, 0.0)
    carried: Pair = (0.0, 0.0)
    turn: float = 0.0


class Prediction(NamedTuple):
    """Prediction of the filter before the frame is applied.

    Attributes
    ----------
    angle, rate, bias : per axis [rad], [rad/s], [rad/s]
    variance : of each potentiometer's innovation [rad²]
    tolerance : uncertainty of each potentiometer's map, 3 σ [rad]
    slope : uncertainty of each potentiometer's angle per angle, 3 σ [1]
    gyro_delay : of the gyro's reading [s]
    scale : uncertainty of the difference of both gyros per rate of the base, 3 σ [1]
    """

    angle: Pair
    rate: Pair
    bias: Pair
    variance: Quad
    tolerance: Quad = (0.0, 0.0, 0.0, 0.0)
    slope: Quad = (0.0, 0.0, 0.0, 0.0)
    gyro_delay: float = 0.0
    scale: float = 0.0


class Remedy(NamedTuple):
    """How the filter treats this frame.

    Attributes
    ----------
    use : whether to apply each potentiometer
    use_gyro : whether to apply the gyro, per axis
    supply_sigma : standard deviation of a common supply error; 0 keeps the usual one [1]
    forget : per axis, standard deviations to add to angle [rad] and bias [rad/s], or None
    """

    use: tuple[bool, bool, bool, bool]
    use_gyro: tuple[bool, bool]
    supply_sigma: float = 0.0
    forget: tuple[Pair | None, Pair | None] = (None, None)
