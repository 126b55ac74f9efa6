"""The error of everything about calibrations."""

from hardware.frames import HardwareError


class CalibrationError(HardwareError):
    """A calibration run, file or map that cannot be used; says why in one line."""
