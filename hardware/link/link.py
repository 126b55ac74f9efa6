"""Serial line to a rig: any pyserial URL, polled without blocking, reopened when it comes back."""

import contextlib
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Self

import serial

from hardware.link.port import LinkError, close_port, closed_at_once, is_socket, open_port, writer
from hardware.link.session import Greeting
from hardware.protocol import DELIMITER, SESSION, Counters, Decoder, Encoder, Frame, Message

RETRY_NS = 200_000_000
# Bytes processed by one poll, about fourteen telemetry frames: a backlog is processed over several
# polls instead of making one long.
_CHUNK = 1024
# Bytes, 0.4 s of telemetry: of a longer backlog only the newest chunk is processed.
BACKLOG = 16_384
_MOST_READS = 256  # of the port in one poll


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
    dropped : bytes received and not processed, because they came faster than they were polled
    """

    received: int
    sent: int
    refused: int
    decoder: Counters
    gaps: tuple[Gap, ...]
    dropped: int = 0


class Link:
    """Messages over one serial port; never blocks, never raises once it has been open.

    An unplugged cable turns `connected` false and begins a gap; `poll` then tries to open the port
    again five times a second. `generation` counts connections: when it has changed, the device
    has probably been reset and needs a new handshake. On TCP a connection begins with the proof of
    the session key; see `Greeting`. Only the first connection waits for that, up to a second.

    Parameters
    ----------
    url : a port name or pyserial URL
    reset : let DTR reset the board on opening; `False` needs a driver that supports it
    clock : monotonic nanoseconds, for gaps and `polled_ns`

    Raises
    ------
    LinkError : the port cannot be opened the first time, or the server refuses
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
        self._received = self._sent = self._refused = self._dropped = 0
        self._backlog = bytearray()
        self._greeting: Greeting | None = None
        self._early: list[Frame] = []  # that came with the end of the greeting
        self._gaps: list[Gap] = []
        self._retry_ns = 0
        self._closed = False
        self._connect()
        self._greet()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @property
    def connected(self) -> bool:
        """Whether the port is open now, and the server's greeting over."""
        return self._port is not None and self._greeting is None

    @property
    def statistics(self) -> LinkStatistics:
        """Counts so far."""
        decoder = _sum(self._earlier, self._decoder.counters)
        return LinkStatistics(
            self._received, self._sent, self._refused, decoder, tuple(self._gaps), self._dropped
        )

    def poll(self) -> list[Frame]:
        """Return the frames that have arrived; `polled_ns` is when they were fetched."""
        if self._port is None and not self._reconnect():
            return []
        try:
            arrived = self._early + self._receive()
            self._early = []
            return arrived if self._greeting is None else self._greeted(arrived)
        except (serial.SerialException, OSError, LinkError) as error:
            self._break(error)
            return []

    def _receive(self) -> list[Frame]:
        assert self._port is not None
        # Only what is there is read. On a terminal, `read` and `select` without input wait for
        # the kernel's worker that carries input (n_tty: tty_buffer_flush_work), an ordinary
        # thread: up to 18 ms on a busy machine, measured. Asking for the count never waits.
        for _ in range(_MOST_READS):
            piece = self._port.read(_CHUNK) if self._port.in_waiting else b""
            self._backlog += piece
            self._received += len(piece)
            if len(piece) < _CHUNK:
                break
        self.polled_ns = self._clock()
        if len(self._backlog) > BACKLOG:
            self._skip()
        self._decoder.receive_data(bytes(self._backlog[:_CHUNK]))
        del self._backlog[:_CHUNK]
        return list(self._decoder)

    def _skip(self) -> None:
        """Drop all but the newest frames: what is old is useless to a controller."""
        end = self._backlog.find(0, len(self._backlog) - _CHUNK) + 1 or len(self._backlog)
        del self._backlog[:end]
        self._dropped += end
        self._decoder.skip()

    def _greet(self) -> None:
        """Wait for the end of the first greeting."""
        try:
            while self._greeting is not None:
                self._early += self._greeted(self._receive())
                time.sleep(1e-3)
        except (serial.SerialException, OSError) as error:
            begun = self._greeting is not None and self._greeting.begun
            self._drop()
            raise LinkError(closed_at_once(self.url, error, begun=begun)) from None
        except LinkError:
            self._drop()
            raise

    def _greeted(self, arrived: list[Frame]) -> list[Frame]:
        """Pass messages to the greeting; return those of the board that follow it."""
        assert self._greeting is not None
        self._greeting.wait(time.monotonic_ns())
        rest = []
        for frame in arrived:
            if self._greeting.done:
                rest.append(frame)
            elif answer := self._greeting.answer(frame.message):
                self._write(answer)
            elif not isinstance(frame.message, SESSION):
                rest.append(frame)
        if self._greeting.done:
            self._open()
        return rest

    def send(self, message: Message) -> int | None:
        """Send a message and return its sequence number; None if it was not sent."""
        if not self.connected:
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
        self._backlog.clear()
        self._early = []
        if is_socket(self._port):
            self._greeting = Greeting(self.url, time.monotonic_ns())
        else:
            self._open()

    def _open(self) -> None:
        self._greeting = None
        self.generation += 1
        # Ends a frame that the device has half received, so that our first frame is decoded.
        self._rest = DELIMITER
        if self._gaps:
            gap = self._gaps[-1]
            self._gaps[-1] = Gap(gap.start_ns, self._clock(), gap.reason)

    def _reconnect(self) -> bool:
        now = self._clock()
        if self._closed or now < self._retry_ns:
            return False
        self._retry_ns = now + RETRY_NS
        try:
            self._connect()
        except LinkError:
            return False
        return True

    def _break(self, error: Exception) -> None:
        self._drop()
        now = self._clock()
        if self._greeting is None:  # else the gap continues
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
