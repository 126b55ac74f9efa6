"""What a rig needs of a line, and the line of a rig that lives in this process."""

from collections.abc import Callable
from typing import Protocol

from hardware.link import Gap, LinkStatistics
from hardware.protocol import Counters, Decoder, Encoder, Frame, Message


class Line(Protocol):
    """Messages to and from a device; `hardware.link.Link` is one."""

    generation: int
    polled_ns: int

    @property
    def connected(self) -> bool:
        """Whether the line is open now."""

    @property
    def statistics(self) -> LinkStatistics:
        """What went over the line so far."""

    def poll(self) -> list[Frame]:
        """Return the frames that have arrived."""

    def send(self, message: Message) -> int | None:
        """Send a message; None when the line did not take it."""

    def close(self) -> None:
        """Close the line."""


class Endpoint(Protocol):
    """A simulated device: `emulator.Emulator` or `avr.SimulatedNano`; both take bytes."""

    def write(self, data: bytes) -> object:
        """Send bytes to the device."""

    def read(self) -> bytes:
        """Return what has come from it."""

    def close(self) -> None:
        """Release the device."""


class LockstepLine:
    """Line to a device in this process; an `OSError` of the device is a pulled cable.

    Parameters
    ----------
    device : takes and gives bytes
    clock : experiment time [ns]
    """

    def __init__(self, device: Endpoint, clock: Callable[[], int]) -> None:
        self.device = device
        self.generation = 1
        self.polled_ns = clock()
        self._clock = clock
        self._encoder, self._decoder = Encoder(), Decoder()
        self._received = self._sent = self._refused = 0
        self._gaps: list[Gap] = []

    @property
    def connected(self) -> bool:
        """Whether the cable is in."""
        return not self._gaps or self._gaps[-1].end_ns is not None

    @property
    def statistics(self) -> LinkStatistics:
        """What went over the line so far."""
        counters: Counters = self._decoder.counters
        return LinkStatistics(
            self._received, self._sent, self._refused, counters, tuple(self._gaps)
        )

    def poll(self) -> list[Frame]:
        """Return the frames that have arrived."""
        self.polled_ns = self._clock()
        try:
            data = self.device.read()
        except OSError as error:
            self._break(error)
            return []
        if not self.connected:
            gap = self._gaps[-1]
            self._gaps[-1] = Gap(gap.start_ns, self._clock(), gap.reason)
            self.generation += 1
        self._received += len(data)
        self._decoder.receive_data(data)
        return list(self._decoder)

    def send(self, message: Message) -> int | None:
        """Send a message and return its sequence number."""
        if not self.connected:
            self._refused += 1
            return None
        sequence = self._encoder.sequence
        data = self._encoder.encode(message)
        try:
            self.device.write(data)
        except OSError as error:
            self._refused += 1
            self._break(error)
            return None
        self._sent += len(data)
        return sequence

    def close(self) -> None:
        """Release the device."""
        self.device.close()

    def _break(self, error: OSError) -> None:
        if self.connected:
            self._gaps.append(Gap(self._clock(), None, str(error)))
