"""Open, write and close a serial port without blocking."""

import contextlib
import errno
import os
import socket
from collections.abc import Callable
from functools import partial
from urllib.parse import urlsplit

import serial

from hardware.frames import HardwareError
from hardware.protocol import BAUD

# Of ports that only pyserial can write to. With a timeout of zero it would spin without end on
# a full buffer (serialposix.write loops on EAGAIN).
_WRITE_TIMEOUT_S = 0.002
_EXAMPLES = "/dev/ttyUSB0, COM3 or socket://127.0.0.1:5555"


class LinkError(HardwareError):
    """A port cannot be opened; the message is one line with the remedy."""


def open_port(url: str, *, reset: bool) -> serial.SerialBase:
    """Open a port for reading and writing without blocking.

    Parameters
    ----------
    url : a port name or pyserial URL
    reset : let DTR reset the board

    Raises
    ------
    LinkError : the port cannot be opened
    """
    _check_address(url)
    try:
        port = serial.serial_for_url(
            url,
            do_not_open=True,
            baudrate=BAUD,
            timeout=0,
            write_timeout=_WRITE_TIMEOUT_S,
            exclusive=None if "://" in url else True,
        )
        if url.startswith("socket://"):
            port.reset_input_buffer = lambda: None  # on opening it would discard CHALLENGE
        if not reset:
            port.dtr = False
        port.open()
    except Exception as error:  # pyserial does not wrap termios, URL and socket errors
        raise LinkError(_explain(url, error)) from None
    _lower_latency(port)
    return port


def _check_address(url: str) -> None:
    """Refuse what pyserial would answer with a message about Python's types or its own options."""
    address = urlsplit(url)
    if address.scheme != "socket":
        return
    try:
        valid = bool(address.hostname) and bool(address.port)
    except ValueError:  # not a number, or above 65535
        valid = False
    if not valid or address.query or address.path not in ("", "/"):
        raise LinkError(
            f"{url}: must be socket://HOST:PORT with a port from 1 to 65535; give"
            " socket://127.0.0.1:5555, for example"
        )


def writer(port: serial.SerialBase) -> Callable[[bytes], int]:
    """Return a function that writes as many bytes as there is room for and returns their number.

    pyserial's own `write` looks with `select`, after it has written, whether there is room for
    more. On a terminal that waits for the kernel's worker just as reading does, see `Link.poll`;
    writing itself only puts the bytes into a buffer (92 µs at most in the same measurement).
    """
    line = _socket(port)
    native = os.name == "posix" and type(port) is serial.Serial
    if not native and line is None:
        return lambda data: _written(port, data)  # Windows, rfc2217:// and others
    raw = partial(os.write, port.fileno()) if line is None else line.send

    def write(data: bytes) -> int:
        try:
            return int(raw(data))
        except BlockingIOError:
            return 0

    return write


def is_socket(port: serial.SerialBase) -> bool:
    """Return whether a port is a TCP connection (`socket://`)."""
    return _socket(port) is not None


def _socket(port: serial.SerialBase) -> socket.socket | None:
    line = getattr(port, "_socket", None)
    return line if isinstance(line, socket.socket) else None


def _written(port: serial.SerialBase, data: bytes) -> int:
    try:
        port.write(data)
    except serial.SerialTimeoutException:
        return 0
    return len(data)


def close_port(port: serial.SerialBase) -> None:
    """Close at once: pyserial sleeps 0.3 s after closing a socket, which would delay the loop."""
    if (line := _socket(port)) is not None:
        line.close()
        port._socket, port.is_open = None, False
    else:
        port.close()


def _lower_latency(port: serial.SerialBase) -> None:
    # FTDI adapters delay bytes by 16 ms otherwise. Ports without the setting (a pty, a
    # driver without it, another system) need none.
    with contextlib.suppress(AttributeError, NotImplementedError, ValueError, OSError):
        port.set_low_latency_mode(True)
    # Nagle's algorithm would delay a command until the previous one is acknowledged.
    if (line := _socket(port)) is not None:
        line.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)


def closed_at_once(url: str, error: Exception, *, begun: bool) -> str:
    """Return the message about a TCP connection that ended during the greeting.

    Parameters
    ----------
    begun : the server has sent CHALLENGE
    """
    if begun:
        return f"{url}: the server closed the connection ({error})"
    return (
        f"{url}: the connection was closed at once: a tunnel without a gateway behind it; start"
        " `python -m hardware.raspberry_pi` on the Pi"
    )


def _explain(url: str, error: Exception) -> str:
    number = getattr(error, "errno", None)
    text = str(error)
    if "://" in url:
        if "refused" in text:
            return f"{url}: nothing listens there; start one with `twin rig`, or check the address"
        return f"{url}: cannot be opened ({text}); must be like {_EXAMPLES}"
    if number in {errno.EBUSY, errno.EAGAIN} or "exclusively lock" in text:
        return f"{url}: in use by another program; close that program"
    if number in {errno.EACCES, errno.EPERM}:
        return f"{url}: no permission; run `sudo usermod -aG dialout $USER`, then log in again"
    if number in {errno.ENOENT, errno.ENODEV, errno.ENXIO} or "FileNotFoundError" in text:
        return f"{url}: no such port; must be one of: {_ports()}"
    if number in {errno.ENOTTY, errno.EINVAL} or "Inappropriate ioctl" in text:
        return f"{url}: not a serial port; must be one of: {_ports()}"
    reason = getattr(error, "strerror", None) or text
    return f"{url}: cannot be opened ({reason}); must be one of: {_ports()}"


def available() -> dict[str, str]:
    """Serial ports of this machine: device name and the operating system's description."""
    from serial.tools import list_ports

    return {str(p.device): str(p.description) for p in list_ports.comports()}


def _ports() -> str:
    found = sorted(available())
    listed = ", ".join(found) or "none"
    built_in = all(name.startswith("/dev/ttyS") for name in found)
    return f"{listed} (no USB adapter found: check cable and driver)" if built_in else listed
