"""Bytes to messages and back: COBS frames `type u8 | sequence u16 | payload | CRC-16`, then 0."""

import struct
from binascii import crc_hqx
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from cobs import cobs  # type: ignore[import-untyped]

from hardware.protocol.messages import MESSAGES, SESSION, Hello, Message
from hardware.protocol.wire import layout

DELIMITER = b"\0"
MAX_PAYLOAD = 96
HEADER = struct.Struct("<BH")
_CRC = struct.Struct("<H")
_OVERHEAD = HEADER.size + _CRC.size
MAX_ENCODED = MAX_PAYLOAD + _OVERHEAD + 1  # COBS adds one byte below 255; without the delimiter


def crc16(data: bytes) -> int:
    """Return the CRC-16 (polynomial 0x1021, initial 0xFFFF), `_crc_xmodem_update` of avr-libc."""
    return crc_hqx(data, 0xFFFF)


@dataclass(frozen=True, slots=True)
class Unknown:
    """A valid frame of a type or length outside this version's message table.

    Attributes
    ----------
    type_id : first byte of the frame
    payload : the bytes between sequence and CRC
    """

    type_id: int
    payload: bytes


@dataclass(frozen=True, slots=True)
class Frame:
    """One frame that passed its CRC.

    Attributes
    ----------
    sequence : the sender's counter, 0…65535
    message : its content
    """

    sequence: int
    message: Message | Unknown


@dataclass(frozen=True, slots=True)
class Counters:
    """Counts of a decoder since its creation.

    Attributes
    ----------
    frames : frames that passed
    crc_errors : delimited runs that failed CRC, COBS or length, after the first valid frame
    lost : sequence numbers that never arrived
    garbage : bytes outside of any valid frame
    unknown : valid frames of unknown type or length
    """

    frames: int = 0
    crc_errors: int = 0
    lost: int = 0
    garbage: int = 0
    unknown: int = 0


class _Codec:
    """Packs and unpacks one message class; tuples in the class are flat on the wire."""

    def __init__(self, cls: type[Any]) -> None:
        self.cls = cls
        self.layout = layout(cls)
        self.names = tuple(f.name for f in self.layout.fields)
        self.slots: list[int | slice] = []
        at = 0
        for f in self.layout.fields:
            count = f.wire.count
            self.slots.append(at if count == 1 else slice(at, at + count))
            at += count

    def pack(self, message: Message) -> bytes:
        values: list[int] = []
        for name, slot in zip(self.names, self.slots, strict=True):
            value = getattr(message, name)
            if isinstance(slot, int):
                values.append(value)
            else:
                values.extend(value)
        return self.layout.packing.pack(*values)

    def unpack(self, payload: bytes) -> Message:
        flat = self.layout.packing.unpack(payload)
        message: Message = self.cls(*[flat[slot] for slot in self.slots])
        return message


_CODECS = {layout(cls).type_id: _Codec(cls) for cls in (*MESSAGES, *SESSION)}


def encode(message: Message, sequence: int) -> bytes:
    """Return one delimited frame.

    Parameters
    ----------
    message : any class of `MESSAGES` or `SESSION`
    sequence : 0…65535, one counter per direction

    Raises
    ------
    ValueError : a field does not fit its width
    """
    codec = _CODECS[message.TYPE_ID]  # type: ignore[union-attr]
    try:
        body = HEADER.pack(codec.layout.type_id, sequence) + codec.pack(message)
    except struct.error as error:
        raise ValueError(f"{message} does not fit the wire: {error}") from None
    encoded: bytes = cobs.encode(body + _CRC.pack(crc16(body)))
    return encoded + DELIMITER


class Encoder:
    """Numbers the frames of one direction."""

    def __init__(self) -> None:
        self.sequence = 0

    def encode(self, message: Message) -> bytes:
        """Return the next frame and count `sequence` up."""
        frame = encode(message, self.sequence)
        self.sequence = (self.sequence + 1) & 0xFFFF
        return frame


class Decoder:
    """Incremental decoder of the byte stream; never raises, whatever the bytes.

    Pass any piece of the stream to `receive_data`, then call `next_event` until it returns None.
    """

    def __init__(self) -> None:
        self._buffer = bytearray()
        self._start = 0  # first byte not yet decoded
        self._skipping = False  # inside a run too long to be a frame
        self._expected: int | None = None
        self._frames = self._crc_errors = self._lost = self._garbage = self._unknown = 0

    @property
    def counters(self) -> Counters:
        """Counts so far."""
        return Counters(self._frames, self._crc_errors, self._lost, self._garbage, self._unknown)

    def receive_data(self, data: bytes) -> None:
        """Append received bytes; without a delimiter at most one frame's length is kept."""
        if self._start:
            del self._buffer[: self._start]
            self._start = 0
        self._buffer += data

    def skip(self) -> None:
        """Forget the frame begun: what follows is not its continuation, and no loss is counted."""
        self._start = len(self._buffer)
        self._skipping = False
        self._expected = None

    def next_event(self) -> Frame | None:
        """Return the next frame, or None until more data is received."""
        while (end := self._buffer.find(0, self._start)) >= 0:
            run = self._buffer[self._start : end]
            self._start = end + 1
            if self._skipping:
                self._skipping = False
                self._garbage += len(run) + 1
            elif run and (frame := self._open(run)) is not None:
                return frame
        self._drop_overlong()
        return None

    def __iter__(self) -> Iterator[Frame]:
        """Yield the frames that are complete."""
        while (frame := self.next_event()) is not None:
            yield frame

    def _drop_overlong(self) -> None:
        pending = len(self._buffer) - self._start
        if pending <= MAX_ENCODED and not self._skipping:
            return
        if not self._skipping:
            self._skipping = True
            self._crc_errors += self._frames > 0
        self._garbage += pending
        self._start = len(self._buffer)

    def _open(self, run: bytearray) -> Frame | None:
        body = _unstuff(run)
        if body is None:
            # The first run is usually the end of a frame that began before the port was opened.
            self._crc_errors += self._frames > 0
            self._garbage += len(run) + 1
            return None
        type_id, sequence = HEADER.unpack_from(body)
        payload = body[HEADER.size : -_CRC.size]
        codec = _CODECS.get(type_id)
        message: Message | Unknown
        if codec is None or codec.layout.size != len(payload):
            message = Unknown(type_id, payload)
            self._unknown += 1
        else:
            message = codec.unpack(payload)
        if not isinstance(message, SESSION):  # these are not numbered
            self._count(sequence, message)
        return Frame(sequence, message)

    def _count(self, sequence: int, message: Message | Unknown) -> None:
        self._frames += 1
        # HELLO with number 0 follows a boot: the sender's counter restarted.
        if self._expected is not None and not (sequence == 0 and isinstance(message, Hello)):
            missed = (sequence - self._expected) & 0xFFFF
            # A serial line cannot reorder: an earlier number is another sender, not a loss.
            self._lost += missed if missed < 0x8000 else 0
        self._expected = (sequence + 1) & 0xFFFF


def _unstuff(run: bytearray) -> bytes | None:
    """Return a frame's content if COBS, length and CRC hold."""
    if not _OVERHEAD < len(run) <= MAX_ENCODED:
        return None
    try:
        content: bytes = cobs.decode(run)
    except cobs.DecodeError:
        return None
    if len(content) < _OVERHEAD:
        return None
    (stored,) = _CRC.unpack_from(content, len(content) - _CRC.size)
    return content if stored == crc16(content[: -_CRC.size]) else None
