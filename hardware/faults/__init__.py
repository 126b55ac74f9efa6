"""Fault detection: which sensor is wrong, and how the filter treats it."""

from hardware.faults.evidence import POTENTIOMETERS, Prediction, Reading, Remedy
from hardware.faults.monitor import Monitor
from hardware.faults.states import SENSORS, TRANSITIONS, Fault, Sign, State

__all__ = [
    "POTENTIOMETERS",
    "SENSORS",
    "TRANSITIONS",
    "Fault",
    "Monitor",
    "Prediction",
    "Reading",
    "Remedy",
    "Sign",
    "State",
]
