"""The gimbal seat over a link.

>>> from hardware.emulator import Emulator
>>> device = Emulator()
>>> rig = in_process(device)
>>> rig.connect().board
2
"""

from typing import Protocol

from hardware.calibration.result import Calibration
from hardware.rig.clock import ClockEstimate
from hardware.rig.connection import Connection
from hardware.rig.hello import RigError
from hardware.rig.line import Endpoint, Line, LockstepLine
from hardware.rig.phases import Phase, RigStatistics
from hardware.rig.reading import Converter, unwrap
from hardware.rig.rig import TIMEOUT_MS, Rig

__all__ = [
    "TIMEOUT_MS",
    "ClockEstimate",
    "Connection",
    "Converter",
    "Endpoint",
    "Line",
    "LockstepLine",
    "Phase",
    "Rig",
    "RigError",
    "RigStatistics",
    "SimulatedDevice",
    "in_process",
    "unwrap",
]


class SimulatedDevice(Endpoint, Protocol):
    """A device in this process that lives on simulated time."""

    @property
    def time_us(self) -> float:
        """Time since power-up [µs]."""

    def advance_us(self, duration: int) -> object:
        """Let time pass [µs]."""


def in_process(
    device: SimulatedDevice,
    calibration: Calibration | None = None,
    *,
    arm: bool = True,
    fuse: bool = True,
) -> Rig:
    """Return a rig in lockstep with a simulated device, whose time is the experiment's."""

    def clock() -> int:
        return round(device.time_us * 1000)

    def wait(duration_ns: int) -> None:
        device.advance_us(max(1, duration_ns // 1000))

    line = LockstepLine(device, clock)
    return Rig(line, calibration, clock=clock, wait=wait, arm=arm, fuse=fuse)
