"""PID, low-pass, attitude loop, setpoint programmes and the steering demonstration.

All functions take arrays (..., n), so that one vehicle or thousands use the same compiled code.
"""

from twin.control.attitude import AttitudeController, ControlConfig
from twin.control.guidance import FixedPoint
from twin.control.setpoint import (
    PROGRAMMES,
    Doublet,
    Hold,
    PitchOver,
    Setpoint,
    Step,
    off_axis,
)

__all__ = [
    "PROGRAMMES",
    "AttitudeController",
    "ControlConfig",
    "Doublet",
    "FixedPoint",
    "Hold",
    "PitchOver",
    "Setpoint",
    "Step",
    "off_axis",
]
