"""Limit switches to zero, command matrix and sensor maps, each with covariance."""

from hardware.calibration.file import parsed, read, write
from hardware.calibration.log import SWITCHES, CalibrationRig, Event, Log
from hardware.calibration.procedure import Procedure
from hardware.calibration.result import (
    Calibration,
    CalibrationError,
    GyroMap,
    PotentiometerMap,
    nominal,
)

__all__ = [
    "SWITCHES",
    "Calibration",
    "CalibrationError",
    "CalibrationRig",
    "Event",
    "GyroMap",
    "Log",
    "PotentiometerMap",
    "Procedure",
    "nominal",
    "parsed",
    "read",
    "write",
]
