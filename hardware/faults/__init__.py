"""Fault detection: which sensor or servo is wrong, and how the filter treats it."""

from hardware.faults.actuation import Actuation
from hardware.faults.evidence import POTENTIOMETERS, Prediction, Reading, Remedy
from hardware.faults.monitor import Monitor
from hardware.faults.servo import ServoLimits, Tolerance
from hardware.faults.states import SENSORS, TRANSITIONS, Fault, Sign, State

__all__ = [
    "POTENTIOMETERS",
    "SENSORS",
    "TRANSITIONS",
    "Actuation",
    "Fault",
    "Monitor",
    "Prediction",
    "Reading",
    "Remedy",
    "ServoLimits",
    "Sign",
    "State",
    "Tolerance",
]
