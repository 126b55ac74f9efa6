"""What the fault monitor sees of a frame, and what it asks of the filters."""

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
    fresh : the gyro was read for this frame; else it is the last reading again
    """

    dt: float
    fraction: Quad
    angle: Quad
    gain: Quad
    gyro: Triple
    rate: Pair
    fresh: bool = True


class Prediction(NamedTuple):
    """What the filters expect before they see the frame.

    Attributes
    ----------
    angle, rate, bias : per axis [rad], [rad/s], [rad/s]
    variance : of each potentiometer's innovation [rad²]
    tolerance : what each potentiometer's map leaves open [rad]
    gyro_delay : by which the gyro's reading is late [s]
    """

    angle: Pair
    rate: Pair
    bias: Pair
    variance: Quad
    tolerance: Quad = (0.0, 0.0, 0.0, 0.0)
    gyro_delay: float = 0.0


class Remedy(NamedTuple):
    """How the filters should treat this frame.

    Attributes
    ----------
    use : per potentiometer
    use_gyro : per axis
    supply_sigma : standard deviation of a common supply error; 0 keeps the usual one [1]
    forget : per axis, standard deviations to add to angle [rad] and bias [rad/s], or None
    """

    use: tuple[bool, bool, bool, bool]
    use_gyro: tuple[bool, bool]
    supply_sigma: float = 0.0
    forget: tuple[Pair | None, Pair | None] = (None, None)
