"""What a host has sent and the board has not taken yet: bounded, the oldest makes room."""

from hardware.device.device import BYTE_US

ROOM = 4096  # bytes, as in a terminal: 80 ms of the line, so that no command waits for long


class Inbox:
    """Bytes from a host at the speed of the line, however fast they come.

    Attributes
    ----------
    lost : bytes dropped so far
    """

    def __init__(self) -> None:
        self.lost = 0
        self._bytes = bytearray()

    def add(self, data: bytes) -> None:
        """Append received bytes; beyond `ROOM` the oldest frames are dropped."""
        self._bytes += data
        excess = len(self._bytes) - ROOM
        if excess > 0:
            # up to the end of a frame, so that the next one is not damaged
            excess = self._bytes.find(0, excess - 1) + 1 or excess
            del self._bytes[:excess]
            self.lost += excess

    def take(self, duration_us: int) -> bytes:
        """Return what the line carries in a time [µs]."""
        count = duration_us // BYTE_US
        taken = bytes(self._bytes[:count])
        del self._bytes[:count]
        return taken
