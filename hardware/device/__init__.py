"""Behaviour of every board, and the ports and the server that run it on the wall clock."""

from hardware.device.device import BYTE_US, LOOP_US, Device, Sample
from hardware.device.ports import Port, PtyPort, ServerError, TcpPort
from hardware.device.server import Server, SteppedDevice, serve

__all__ = [
    "BYTE_US",
    "LOOP_US",
    "Device",
    "Port",
    "PtyPort",
    "Sample",
    "Server",
    "ServerError",
    "SteppedDevice",
    "TcpPort",
    "serve",
]
