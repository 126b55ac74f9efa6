"""A device on the wall clock, behind a port."""

import os
import time
from collections.abc import Callable
from pathlib import Path
from types import TracebackType
from typing import Protocol, Self

from hardware.device.device import LOOP_US
from hardware.device.ports import Port, PtyPort, TcpPort

TICK_NS = 1000 * LOOP_US
LONGEST_LAG_NS = 200_000_000  # a machine that slept must not make the rig race to catch up


class SteppedDevice(Protocol):
    """A device whose clock its caller advances: `Emulator`, or a simulated Nano."""

    def write(self, data: bytes) -> object:
        """Send bytes to it."""

    def read(self) -> bytes:
        """Return what has come from it."""

    def advance_us(self, duration: int) -> object:
        """Let its time pass [µs]."""


class Server:
    """Lets a device live on the wall clock and carries its bytes.

    Parameters
    ----------
    device : the rig
    port : where hosts connect
    """

    def __init__(self, device: SteppedDevice, port: Port) -> None:
        self.device, self.port = device, port
        self._next = time.monotonic_ns()
        self._stopped = False
        self._pulled = False

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.port.close()

    def stop(self) -> None:
        """End `run` after its present tick; for another thread."""
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
        """Carry what the host sent, let a millisecond pass, carry the answers."""
        incoming = b"" if self._pulled else self.port.read()
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
    """Return a server for a device: a pty, or TCP on loopback when a port is given or needed.

    Parameters
    ----------
    device : the rig
    tcp : port on 127.0.0.1, 0 for a free one
    link : name of the pty

    Raises
    ------
    ServerError : the port is taken
    """
    if tcp is None and os.name == "posix":
        return Server(device, PtyPort(link))
    return Server(device, TcpPort(tcp or 0))
