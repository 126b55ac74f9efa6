"""Rigs in the gimbal seat: on a serial line, or simulated with the bench scene.

>>> from twin.hil import is_rig
>>> is_rig("emulator"), is_rig("/dev/ttyUSB0"), is_rig("linkage")
(True, True, False)
"""

from twin.config.seats import SIMULATED, check_seat, is_port, is_rig
from twin.hil.bench import BenchPlant
from twin.hil.connect import RigOptions, device, open_rig, opened
from twin.hil.gimbal import RigGimbal
from twin.hil.linearisation import MechanismMap, mechanism_map
from twin.hil.simulated import (
    Device,
    make_device,
    nominal_calibration,
    parameters,
    switch_angles,
)
from twin.loop.readings import Readings

__all__ = [
    "SIMULATED",
    "BenchPlant",
    "Device",
    "MechanismMap",
    "Readings",
    "RigGimbal",
    "RigOptions",
    "check_seat",
    "device",
    "is_port",
    "is_rig",
    "make_device",
    "mechanism_map",
    "nominal_calibration",
    "open_rig",
    "opened",
    "parameters",
    "switch_angles",
]
