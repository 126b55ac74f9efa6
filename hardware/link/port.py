"""Opening, writing and closing a serial port without ever waiting for it."""

import contextlib
import errno
import os
import socket
from collections.abc import Callable
from functools import partial

import serial

from hardware.frames import HardwareError
from hardware.protocol import BAUD

# Of ports that only pyserial can write to. With a timeout of zero it would spin for ever on a
# full buffer (serialposix.write loops on EAGAIN).
_WRITE_TIMEOUT_S = 0.002
_EXAMPLES = "/dev/ttyUSB0, COM3 or socket://127.0.0.1:5555"


class LinkError(HardwareError):
    """A port cannot be opened; the message is one line and says what to do."""


def open_port(url: str, *, reset: bool) -> serial.SerialBase:
    """Open a port that neither reads nor writes with waiting.

    Parameters
    ----------
    url : a port name or pyserial URL
    reset : let DTR reset the board

    Raises
    ------
    LinkError : the port cannot be opened
    """
    try:
        port = serial.serial_for_url(
            url,
            do_not_open=True,
            baudrate=BAUD,
            timeout=0,
            write_timeout=_WRITE_TIMEOUT_S,
            exclusive=None if "://" in url else True,
        )
        if not reset:
            port.dtr = False
        port.open()
    except Exception as error:  # pyserial lets termios, URL and socket errors through
        raise LinkError(_explain(url, error)) from None
    _lower_latency(port)
    return port


def writer(port: serial.SerialBase) -> Callable[[bytes], int]:
    """Return a function that writes what there is room for without waiting; it returns the count.

    pyserial's own `write` looks with `select`, after it has written, whether there is room for
    more. On a terminal that waits for the kernel's worker just as reading does, see `Link.poll`;
    writing itself only puts the bytes into a buffer (92 µs at most in the same measurement).
    """
    line = getattr(port, "_socket", None)
    native = os.name == "posix" and type(port) is serial.Serial
    if not native and not isinstance(line, socket.socket):
        return lambda data: _written(port, data)  # Windows, rfc2217:// and others
    raw = line.send if isinstance(line, socket.socket) else partial(os.write, port.fileno())

    def write(data: bytes) -> int:
        try:
            return int(raw(data))
        except BlockingIOError:
            return 0

    return write


def _written(port: serial.SerialBase, data: bytes) -> int:
    try:
        port.write(data)
    except serial.SerialTimeoutException:
        return 0
    return len(data)


def close_port(port: serial.SerialBase) -> None:
    """Close at once: pyserial sleeps 0.3 s after closing a socket, which would hold up the loop."""
    line = getattr(port, "_socket", None)
    if isinstance(line, socket.socket):
        line.close()
        port._socket, port.is_open = None, False
    else:
        port.close()


def _lower_latency(port: serial.SerialBase) -> None:
    # FTDI adapters hold bytes back for 16 ms otherwise. Ports without the setting (a pty, a
    # driver that knows it not, another system) are right as they are.
    with contextlib.suppress(AttributeError, NotImplementedError, ValueError, OSError):
        port.set_low_latency_mode(True)
    # Nagle's algorithm would hold a command back until the previous one is acknowledged.
    line = getattr(port, "_socket", None)
    if isinstance(line, socket.socket):
        line.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)


def _explain(url: str, error: Exception) -> str:
    number = getattr(error, "errno", None)
    text = str(error)
    if "://" in url:
        if "refused" in text:
            return f"nothing listens at {url}: start a rig with `twin rig`, or check the address"
        if "debug|info" in text:  # pyserial trips over its own message about a bad address
            text = "no host and port from 1 to 65535 in it"
        return f"cannot open {url}: {text}; a port is {_EXAMPLES}"
    if number in {errno.EBUSY, errno.EAGAIN} or "exclusively lock" in text:
        return f"{url} is in use by another program; close it (only one can hold the port)"
    if number in {errno.EACCES, errno.EPERM}:
        return f"no permission to open {url}: `sudo usermod -aG dialout $USER`, then log in again"
    if number in {errno.ENOENT, errno.ENODEV, errno.ENXIO} or "FileNotFoundError" in text:
        return f"there is no port {url}; ports here: {_ports()}"
    return f"{url} is no serial port ({text}); ports here: {_ports()}"


def available() -> dict[str, str]:
    """Serial ports of this machine: device name and what the operating system calls it."""
    from serial.tools import list_ports

    return {str(p.device): str(p.description) for p in list_ports.comports()}


def _ports() -> str:
    return ", ".join(sorted(available())) or "none"
