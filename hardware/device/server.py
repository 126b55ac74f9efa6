"""A device on the wall clock, behind a port."""

import os
import time
from collections.abc import Callable
from pathlib import Path
from typing import Protocol, Self

from hardware.device.device import LOOP_US
from hardware.device.inbox import Inbox
from hardware.device.ports import Port, PtyPort
from hardware.device.tcp import TcpPort, refusals
from hardware.key import configured

TICK_NS = 1000 * LOOP_US
LONGEST_LAG_NS = 200_000_000  # after a longer pause of the machine the device does not catch up


class SteppedDevice(Protocol):
    """A device whose clock its caller advances: `Emulator`, or a simulated Nano."""

    def write(self, data: bytes) -> object:
        """Send bytes to the device."""

    def read(self) -> bytes:
        """Return the bytes it has sent."""

    def advance_us(self, duration: int) -> object:
        """Advance its clock [µs]."""


class Server:
    """Runs a device on the wall clock behind a port.

    Parameters
    ----------
    device : the rig
    port : where hosts connect

    Attributes
    ----------
    inbox : what the host has sent and the device has not taken yet
    """

    def __init__(self, device: SteppedDevice, port: Port) -> None:
        self.device, self.port = device, port
        self.inbox = Inbox()
        self._next = time.monotonic_ns()
        self._stopped = False
        self._pulled = False

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.port.close()

    @property
    def strangers(self) -> str:
        """What the port has refused and dropped so far in one line, "" for nothing."""
        return refusals(self.port, self.inbox)

    def stop(self) -> None:
        """End `run` after the current tick; for another thread."""
        self._stopped = True

    def run(self, until: Callable[[], bool] = lambda: False) -> None:
        """Serve until `stop` or until the predicate holds."""
        self._next = time.monotonic_ns()
        while not self._stopped and not until():
            self.tick()
            self._next += TICK_NS
            late = time.monotonic_ns() - self._next
            if late > LONGEST_LAG_NS:
                self._next += late
            elif late < 0:
                time.sleep(-late * 1e-9)

    def tick(self) -> None:
        """Pass the host's bytes on, advance one millisecond, pass the answers back."""
        if not self._pulled:
            self.inbox.add(self.port.read())
        incoming = self.inbox.take(LOOP_US)
        try:
            if incoming:
                self.device.write(incoming)
            self.device.advance_us(LOOP_US)
            outgoing = self.device.read()
        except OSError:
            if not self._pulled:
                self.port.drop()
            self._pulled = True
            return
        if self._pulled:
            self.port.restore()
            self._pulled = False
        if outgoing:
            self.port.write(outgoing)


def serve(device: SteppedDevice, *, tcp: int | None = None, link: Path | None = None) -> Server:
    """Return a server for a device: on TCP if a port number is given, else on a pseudo-terminal.

    Parameters
    ----------
    device : the rig
    tcp : port on 127.0.0.1, 0 for a free one
    link : path of the pseudo-terminal's link

    Raises
    ------
    ServerError : the port is taken
    KeyFileError : the session key of a TCP port cannot be written
    """
    if tcp is None and os.name == "posix":
        return Server(device, PtyPort(link))
    return Server(device, TcpPort(tcp or 0, configured()))
