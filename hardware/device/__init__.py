"""Behaviour of every board, and the ports and the server that run it on the wall clock."""

from hardware.device.device import BYTE_US, LOOP_US, Device, Sample
from hardware.device.inbox import Inbox
from hardware.device.ports import Port, PtyPort, ServerError
from hardware.device.server import Server, SteppedDevice, serve
from hardware.device.tcp import TcpPort, refusals

__all__ = [
    "BYTE_US",
    "LOOP_US",
    "Device",
    "Inbox",
    "Port",
    "PtyPort",
    "Sample",
    "Server",
    "ServerError",
    "SteppedDevice",
    "TcpPort",
    "refusals",
    "serve",
]
