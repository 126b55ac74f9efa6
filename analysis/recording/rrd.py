"""Rerun's file format, read without trusting the file.

Rerun's own reader ends the whole process on one file in a hundred with a few flipped bytes (a Rust
panic on a thread of its own, 0.41), which no `except` catches. This one walks the frames itself and
leaves decompression and Arrow to pyarrow, whose readers are made for hostile input.

A file is `RRF2`, version and options (12 bytes), then frames of kind u64, length u64, payload.
Data frames hold a protobuf message: store (1), compression (2), uncompressed size (3), encoding (4)
and an Arrow stream (5); the last frame is the footer. Layout read off the files of rerun-sdk 0.41.
"""

import os
import struct
from collections.abc import Container, Iterator
from pathlib import Path
from typing import IO

import pyarrow as pa

from analysis.files import opened

MAGIC, TRAILER = b"RRF2", b"RRF2FOOT"
MAX_BYTES = 4 * 2**30  # a day of flight; more is a mistake or an attack
HEADER_BYTES = 12
_FRAME = struct.Struct("<QQ")
END, DATA = 0, 2
RECORDING = 1  # kind of store; blueprints are 2
NO_COMPRESSION, LZ4 = 1, 2
MAX_RATIO, SLACK = 255, 4096  # LZ4 cannot expand further

_LENGTH, _VARINT = 2, 0


class FormatError(ValueError):
    """Bytes that are no sound Rerun file."""


class CutOffError(FormatError):
    """A file whose end is missing."""


def batches(
    path: Path, entities: Container[str], *, growing: bool = False
) -> Iterator[tuple[str, pa.RecordBatch]]:
    """Yield entity path and Arrow data of the first recording's chunks that have rows.

    Parameters
    ----------
    path : an `.rrd` file
    entities : paths of the entities wanted
    growing : it is still being written; what is whole of it counts

    Raises
    ------
    FormatError : at the first unsound byte met; `CutOffError` if the file ends before its footer
    FileError : it cannot be read, or is not a regular file
    """
    with opened(path, MAX_BYTES) as file:
        store = None
        for start, end in _data_frames(file, growing=growing):
            found = _fields(_read(file, start, end), 0, end - start)
            name = found.get(1)
            if not isinstance(name, bytes) or _store_kind(name) != RECORDING:
                continue
            store = store or name
            if name == store:
                stream = _stream(found)
                entity = (stream.schema.metadata or {}).get(b"rerun:entity_path", b"").decode()
                if entity in entities and (batch := _batch(stream)).num_rows:
                    yield entity, batch


def complete(path: Path) -> bool:
    """Tell whether a file is a Rerun recording to its last byte; OSError if it cannot be read."""
    with path.open("rb") as file:
        try:
            for _ in _data_frames(file):
                pass
        except FormatError:
            return False
        size = _size(file)
        return _read(file, size - 12, size - 4) == TRAILER  # and a count of footers


def _size(file: IO[bytes]) -> int:
    return os.fstat(file.fileno()).st_size


def _read(file: IO[bytes], start: int, end: int) -> bytes:
    """Bytes from start to end; fewer at the end of the file."""
    file.seek(start)
    return file.read(end - start)


def _data_frames(file: IO[bytes], *, growing: bool = False) -> Iterator[tuple[int, int]]:
    """Places of the data in a file; it is not mapped, since pages of a map count as memory."""
    size = _size(file)
    if _read(file, 0, len(MAGIC)) != MAGIC:
        raise FormatError("not a Rerun recording (.rrd)")
    at = HEADER_BYTES
    while at + _FRAME.size <= size:
        kind, length = _FRAME.unpack(_read(file, at, at + _FRAME.size))
        at += _FRAME.size
        if at + length > size:
            break
        if kind == END:
            return
        if kind == DATA:
            yield at, at + length
        at += length
    if not growing:
        raise CutOffError("its end is missing")


def _stream(found: dict[int, int | bytes]) -> pa.RecordBatchReader:
    size, payload = found.get(3, 0), found.get(5)
    if not isinstance(payload, bytes) or not isinstance(size, int) or found.get(4, 1) != 1:
        raise FormatError("a chunk is not Arrow data")
    if found.get(2, NO_COMPRESSION) == LZ4:
        if size > MAX_RATIO * len(payload) + SLACK:
            raise FormatError(f"a chunk of {len(payload)} bytes claims to hold {size}")
        data = pa.Codec("lz4_raw").decompress(payload, decompressed_size=size)
    else:
        data = pa.py_buffer(payload)
    return pa.ipc.open_stream(data)


def _batch(stream: pa.RecordBatchReader) -> pa.RecordBatch:
    try:
        batch = stream.read_next_batch()
    except StopIteration:
        raise FormatError("a chunk is empty") from None
    batch.validate(full=True)
    names = batch.schema.names
    if len(set(names)) < len(names):
        raise FormatError("a chunk has two columns of one name")
    return batch


def _store_kind(store: bytes) -> int | bytes:
    return _fields(store, 0, len(store)).get(1, 0)


def _fields(data: bytes, at: int, end: int) -> dict[int, int | bytes]:
    """Protobuf fields of data[at:end] by number: integers, and byte strings."""
    found: dict[int, int | bytes] = {}
    while at < end:
        key, at = _varint(data, at, end)
        number, wire = key >> 3, key & 7
        if wire not in (_VARINT, _LENGTH):
            raise FormatError("a frame is not what Rerun 0.41 writes")
        value, at = _varint(data, at, end)
        if wire == _VARINT:
            found[number] = value
        else:
            if at + value > end:
                raise FormatError("a field runs past its frame")
            found[number] = data[at : at + value]
            at += value
    return found


def _varint(data: bytes, at: int, end: int) -> tuple[int, int]:
    value = shift = 0
    while at < end and shift < 64:
        byte = data[at]
        at += 1
        value |= (byte & 0x7F) << shift
        if byte < 0x80:
            return value, at
        shift += 7
    raise FormatError("a number runs past its frame")
