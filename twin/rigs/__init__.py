"""Rigs in the gimbal seat: on a serial line, or simulated over the bench scene.

>>> from twin.rigs import is_rig
>>> is_rig("emulator"), is_rig("/dev/ttyUSB0"), is_rig("linkage")
(True, True, False)
"""

from twin.readings import Readings
from twin.rigs.bench import BenchPlant
from twin.rigs.devices import Device, drawing, drawn, make_device, parameters, switch_angles
from twin.rigs.opening import RigOptions, device, open_rig, opened
from twin.rigs.seat import RigGimbal
from twin.seat_names import SIMULATED, check_seat, is_port, is_rig

__all__ = [
    "SIMULATED",
    "BenchPlant",
    "Device",
    "Readings",
    "RigGimbal",
    "RigOptions",
    "check_seat",
    "device",
    "drawing",
    "drawn",
    "is_port",
    "is_rig",
    "make_device",
    "open_rig",
    "opened",
    "parameters",
    "switch_angles",
]
