"""Serial line to a rig: any pyserial URL, polled without blocking, reopened when it comes back."""

import contextlib
import time
from collections.abc import Callable
from dataclasses import dataclass
from types import TracebackType
from typing import Self

import serial

from hardware.link.port import LinkError, close_port, open_port, writer
from hardware.protocol import DELIMITER, Counters, Decoder, Encoder, Frame, Message

RETRY_NS = 200_000_000
# Bytes taken in by one poll, about fourteen telemetry frames: a backlog is processed over several
# polls instead of making one long.
_CHUNK = 1024


@dataclass(frozen=True, slots=True)
class Gap:
    """A time without a connection, on the link's clock.

    Attributes
    ----------
    start_ns, end_ns : when it broke and when it was open again; None while it is broken [ns]
    reason : the operating system's message
    """

    start_ns: int
    end_ns: int | None
    reason: str


@dataclass(frozen=True, slots=True)
class LinkStatistics:
    """Counts of a link since its creation, over all connections.

    Attributes
    ----------
    received, sent : bytes
    refused : messages not sent, because the line was broken or the other end did not read
    decoder : frames, CRC errors and losses
    gaps : times without a connection, in order
    """

    received: int
    sent: int
    refused: int
    decoder: Counters
    gaps: tuple[Gap, ...]


class Link:
    """Messages over one serial port; never blocks, never raises once it has been open.

    An unplugged cable turns `connected` false and begins a gap; `poll` then tries to open the port
    again five times a second. `generation` counts connections: when it has changed, the device
    has probably been reset and needs a new handshake.

    Parameters
    ----------
    url : a port name or pyserial URL
    reset : let DTR reset the board on opening; `False` needs a driver that supports it
    clock : monotonic nanoseconds, for gaps and `polled_ns`

    Raises
    ------
    LinkError : the port cannot be opened the first time
    """

    def __init__(
        self, url: str, *, reset: bool = True, clock: Callable[[], int] = time.monotonic_ns
    ) -> None:
        self.url = url
        self.generation = 0
        self.polled_ns = clock()
        self._reset = reset
        self._clock = clock
        self._port: serial.SerialBase | None = None
        self._encoder = Encoder()
        self._decoder = Decoder()
        self._write: Callable[[bytes], int] = len
        self._rest = b""  # of a message that was sent in part
        self._earlier = Counters()
        self._received = self._sent = self._refused = 0
        self._gaps: list[Gap] = []
        self._retry_ns = 0
        self._closed = False
        self._connect()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    @property
    def connected(self) -> bool:
        """Whether the port is open now."""
        return self._port is not None

    @property
    def statistics(self) -> LinkStatistics:
        """Counts so far."""
        decoder = _sum(self._earlier, self._decoder.counters)
        return LinkStatistics(self._received, self._sent, self._refused, decoder, tuple(self._gaps))

    def poll(self) -> list[Frame]:
        """Return the frames that have arrived; `polled_ns` is when they were fetched."""
        if self._port is None and not self._reconnect():
            return []
        assert self._port is not None
        try:
            # Only what is there is read. On a terminal, `read` and `select` without input wait for
            # the kernel's worker that carries input (n_tty: tty_buffer_flush_work), an ordinary
            # thread: up to 18 ms on a busy machine, measured. Asking for the count never waits.
            data = self._port.read(_CHUNK) if self._port.in_waiting else b""
        except (serial.SerialException, OSError) as error:
            self._break(error)
            return []
        self.polled_ns = self._clock()
        self._received += len(data)
        self._decoder.receive_data(data)
        return list(self._decoder)

    def send(self, message: Message) -> int | None:
        """Send a message and return its sequence number; None if it was not sent."""
        if self._port is None:
            self._refused += 1
            return None
        sequence = self._encoder.sequence
        frame = self._rest + self._encoder.encode(message)
        try:
            taken = self._write(frame)
        except (serial.SerialException, OSError) as error:
            self._refused += 1
            self._break(error)
            return None
        self._sent += taken
        if taken < len(self._rest) or not taken:  # the other end does not read
            self._rest = self._rest[taken:]
            self._refused += 1
            return None
        self._rest = frame[taken:]
        return sequence

    def close(self) -> None:
        """Close the port; closing it twice is harmless."""
        self._closed = True
        self._drop()

    def _drop(self) -> None:
        if self._port is not None:
            with contextlib.suppress(serial.SerialException, OSError):
                close_port(self._port)
            self._port = None

    def _connect(self) -> None:
        self._port = open_port(self.url, reset=self._reset)
        self._earlier = _sum(self._earlier, self._decoder.counters)
        self._decoder = Decoder()
        self._encoder = Encoder()
        self._write = writer(self._port)
        self.generation += 1
        # Ends a frame that the device has half received, so that our first frame is decoded.
        self._rest = DELIMITER

    def _reconnect(self) -> bool:
        now = self._clock()
        if self._closed or now < self._retry_ns:
            return False
        self._retry_ns = now + RETRY_NS
        try:
            self._connect()
        except LinkError:
            return False
        gap = self._gaps[-1]
        self._gaps[-1] = Gap(gap.start_ns, self._clock(), gap.reason)
        return True

    def _break(self, error: Exception) -> None:
        self._drop()
        now = self._clock()
        self._gaps.append(Gap(now, None, str(error)))
        self._retry_ns = now + RETRY_NS


def _sum(a: Counters, b: Counters) -> Counters:
    return Counters(
        frames=a.frames + b.frames,
        crc_errors=a.crc_errors + b.crc_errors,
        lost=a.lost + b.lost,
        garbage=a.garbage + b.garbage,
        unknown=a.unknown + b.unknown,
    )
