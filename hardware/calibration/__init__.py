"""Limit switches to the command map and the sensor maps of one board, each with covariance."""

from hardware.calibration.errors import CalibrationError
from hardware.calibration.file import parsed, read, write
from hardware.calibration.linearisation import Linearisation
from hardware.calibration.log import SWITCHES, CalibrationRig, Event, Log
from hardware.calibration.procedure import Procedure
from hardware.calibration.result import Calibration, GyroMap, PotentiometerMap, nominal

__all__ = [
    "SWITCHES",
    "Calibration",
    "CalibrationError",
    "CalibrationRig",
    "Event",
    "GyroMap",
    "Linearisation",
    "Log",
    "PotentiometerMap",
    "Procedure",
    "nominal",
    "parsed",
    "read",
    "write",
]
