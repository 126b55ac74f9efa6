"""Where a host connects to a device, and a pseudo-terminal for that; TCP is in `tcp`."""

import contextlib
import os
import tempfile
from array import array
from collections.abc import Callable
from pathlib import Path
from typing import Protocol

from hardware.frames import HardwareError

_CHUNK = 4096


class ServerError(HardwareError):
    """The port cannot be opened for hosts."""


class Port(Protocol):
    """Where a host connects; reads and writes never block."""

    url: str

    def read(self) -> bytes:
        """Return what the host has sent."""

    def write(self, data: bytes) -> None:
        """Send to the host; bytes that the host does not read are lost."""

    def drop(self) -> None:
        """Disconnect: the port disappears."""

    def restore(self) -> None:
        """Reconnect under the same name."""

    def close(self) -> None:
        """Close the port."""


class PtyPort:
    """A raw pseudo-terminal behind a symbolic link, which survives a disconnection. POSIX only.

    Parameters
    ----------
    link : path of the link, `url` then; a temporary one if omitted

    Raises
    ------
    ServerError : this system has no pseudo-terminals, or the link cannot be made
    """

    def __init__(self, link: Path | None = None) -> None:
        try:
            import pty
            import tty
        except ImportError:
            raise ServerError("no pseudo-terminals on this system; use TCP instead") from None
        self._make: Callable[[], tuple[int, int]] = pty.openpty
        self._raw = tty.setraw
        self._folder = None if link else tempfile.TemporaryDirectory(prefix="tvc-rig-")
        self._link = link or Path(self._folder.name if self._folder else "") / "port"
        self.url = str(self._link)
        self._ours = self._theirs = -1
        self.restore()

    def restore(self) -> None:
        """Open a terminal and point the link at it."""
        self._ours, self._theirs = self._make()
        self._raw(self._theirs)
        os.fchmod(self._theirs, 0o600)  # some systems let the group tty write
        os.set_blocking(self._ours, False)
        try:
            self._link.symlink_to(os.ttyname(self._theirs))
        except OSError as error:
            self._hang_up()
            raise ServerError(f"cannot make the link {self._link}: {error.strerror}") from None

    def _hang_up(self) -> None:
        for end in (self._ours, self._theirs):
            with contextlib.suppress(OSError):
                os.close(end)
        self._ours = self._theirs = -1

    def read(self) -> bytes:
        """Return what the host has sent."""
        try:
            # a read without input waits for the kernel's worker, see `hardware.link.Link.poll`
            return os.read(self._ours, _CHUNK) if _waiting(self._ours) else b""
        except OSError:
            return b""

    def write(self, data: bytes) -> None:
        """Send to the host."""
        with contextlib.suppress(OSError):
            os.write(self._ours, data)

    def drop(self) -> None:
        """Hang up; the host's reads then fail."""
        if self._ours >= 0:
            self._link.unlink(missing_ok=True)
            self._hang_up()

    def close(self) -> None:
        """Close the terminal."""
        self.drop()
        if self._folder is not None:
            self._folder.cleanup()


def _waiting(terminal: int) -> int:
    """Bytes that can be read from a terminal now."""
    import fcntl
    import termios

    count = array("i", [0])
    fcntl.ioctl(terminal, termios.FIONREAD, count)
    return count[0]
