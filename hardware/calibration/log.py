"""Limit switches of the calibration rig, and what a calibration run records there."""

from dataclasses import dataclass, field
from math import radians

from hardware.calibration.linearisation import Linearisation
from hardware.calibration.result import NEUTRAL
from hardware.frames import Pair, Triple
from hardware.parts import POTENTIOMETER_TRAVEL, SWITCH_ANGLE

SWITCHES = ("+x", "-x", "+y", "-y")


@dataclass(frozen=True, slots=True)
class CalibrationRig:
    """The printed rig with its switches, the mechanism in it, and how to drive to them.

    Attributes
    ----------
    switch_angle : at which +x, −x, +y, −y close [rad]
    switch_sigma : standard deviation of these angles [rad]
    neutral : pulse widths to start from [s]
    lowest, highest : pulse widths that are safe [s]
    coarse, fine : steps per dwell, while searching and near a switch [s]
    dwell : time for the servo to follow a step; two PWM frames [s]
    reading : time over which potentiometers are averaged, at rest behind each switch [s]
    backoff : distance from a switch at which the fine approach begins [s]
    offsets : places at which the other servo is held [s]
    repeats : approaches per switch and place
    seed : of the random start of each approach, which spreads quantisation evenly
    linearisation : of the mechanism that is calibrated
    minimal : the rig has no potentiometers; its holder's accelerometer shows the angle at rest
    track : travel of the potentiometers' tracks by their data sheet [rad]
    """

    switch_angle: tuple[float, float, float, float] = (
        SWITCH_ANGLE,
        -SWITCH_ANGLE,
        SWITCH_ANGLE,
        -SWITCH_ANGLE,
    )
    switch_sigma: float = radians(0.03)
    neutral: Pair = (NEUTRAL, NEUTRAL)
    lowest: float = 1.0e-3
    highest: float = 2.0e-3
    coarse: float = 10e-6
    fine: float = 2e-6
    dwell: float = 0.04
    reading: float = 0.1
    backoff: float = 24e-6
    offsets: tuple[float, ...] = (0.0, 70e-6, -70e-6)  # 3°: the lever for the coupling
    repeats: int = 3
    seed: int = 0
    linearisation: Linearisation = field(default_factory=Linearisation)
    minimal: bool = False
    track: float = POTENTIOMETER_TRAVEL


@dataclass(frozen=True, slots=True)
class Event:
    """One switch closing or opening.

    Attributes
    ----------
    switch : index into `SWITCHES`
    closed : it closed, on the way out; else it opened, on the way in
    pulses : in force as it did, moved back by half a step [s]
    settled : in force at rest afterwards, when the sensors were read [s]
    potentiometer : mean readings at rest [1]; tilts x, x, y, y by the accelerometer of a rig
        without potentiometers [rad]
    time : device time, at rest [s]
    gyro : integral of the holder gyro's reading since the start, bias included, at rest [rad]
    came : direction in which the other axis moved last, +1 or −1; 0 where that is not recorded
    """

    switch: int
    closed: bool
    pulses: Pair
    settled: Pair
    potentiometer: tuple[float, float, float, float]
    time: float
    gyro: Triple
    came: int = 0


@dataclass(slots=True)
class Log:
    """What a run has seen."""

    events: list[Event] = field(default_factory=list)
    gyro_bias: Triple = (0.0, 0.0, 0.0)
    gyro_bias_sigma: float = 0.0
