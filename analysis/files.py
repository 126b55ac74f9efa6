"""Files of unknown origin, read within limits, and files that appear whole or not at all."""

import hashlib
import os
import stat
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from io import BufferedReader
from pathlib import Path

from analysis.schema import AnalysisError

_noted: ContextVar[dict[str, bytes] | None] = ContextVar("files that are read", default=None)


class FileError(AnalysisError):
    """A file that cannot be read, in one line."""


@contextmanager
def opened(path: Path | str, largest: int) -> Iterator[BufferedReader]:
    """A regular file of at most `largest` bytes, open for reading.

    Devices, FIFOs, sockets and folders are refused before they are opened, which may block for
    ever. Errors while it is read become `FileError` as well.

    Raises
    ------
    FileError : the path and what is wrong with it
    """
    try:
        _check(path, os.stat(path), largest)  # noqa: PTH116  also of a text with a zero byte
        # a file that has become a FIFO since then must not block
        descriptor = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0))
    except OSError as error:
        raise FileError(f"{path}: {error.strerror or 'cannot be read'}") from None
    except ValueError as error:
        if isinstance(error, FileError):
            raise
        raise FileError(f"{str(path)!r}: not a file name") from None
    with os.fdopen(descriptor, "rb") as file:
        _check(path, os.fstat(descriptor), largest)
        try:
            yield file
        except OSError as error:
            raise FileError(f"{path}: {error.strerror or 'cannot be read'}") from None


def _check(path: Path | str, state: os.stat_result, largest: int) -> None:
    if not stat.S_ISREG(state.st_mode):
        raise FileError(f"{path}: not a regular file")
    if state.st_size > largest:
        raise FileError(f"{path}: larger than {largest} bytes, the limit for its kind")


def content(path: Path | str, largest: int) -> bytes:
    """Bytes of a regular file.

    Raises
    ------
    FileError : it cannot be read, is not a regular file, or has more than `largest` bytes
    """
    with opened(path, largest) as file:
        data = file.read(largest + 1)
    if len(data) > largest:  # of files in /proc, whose size is said to be zero
        raise FileError(f"{path}: larger than {largest} bytes, the limit for its kind")
    if (found := _noted.get()) is not None:
        digest = hashlib.sha256(data).digest()
        same = found.setdefault(str(path), digest) == digest
        found[str(path)] = digest if same else b""
    return data


@contextmanager
def noted() -> Iterator[dict[str, bytes]]:
    """Digests of the files that `content` reads in the block, by path.

    Empty for a file that changed meanwhile.
    """
    found: dict[str, bytes] = {}
    token = _noted.set(found)
    try:
        yield found
    finally:
        _noted.reset(token)


def write_text(path: Path, text: str) -> None:
    """Write beside the path and rename over it; an older file of that name is replaced.

    Raises
    ------
    AnalysisError : the folder cannot be created or written
    """
    temporary = None
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.NamedTemporaryFile(
            "w", encoding="utf-8", newline="\n", dir=path.parent, prefix=f".{path.name}.",
            delete=False,
        ) as stream:  # fmt: skip
            temporary = Path(stream.name)
            stream.write(text)
            stream.flush()
            os.fsync(stream.fileno())
        temporary.chmod(0o644)
        temporary.replace(path)
    except OSError as error:
        if temporary is not None:
            temporary.unlink(missing_ok=True)
        raise AnalysisError(f"cannot write {path}: {error.strerror or error}") from None


_FOREIGN = (
    (b"\x1f\x8b", "compressed by gzip; unpack it first"),
    (b"PK\x03\x04", "a ZIP archive or an Excel workbook; unpack it, or save it as CSV"),
    (b"\xd0\xcf\x11\xe0", "an old Excel workbook; save it as CSV"),
    (b"%PDF", "a PDF document"),
    (b"<!doctype html", "a web page; download the file itself"),
    (b"<html", "a web page; download the file itself"),
    (b"<table", "a web page; save it as CSV"),
)


def foreign(head: bytes) -> str:
    """What a file is that begins like one of another kind, and what helps; "" of all others."""
    begin = head.removeprefix(b"\xef\xbb\xbf").lstrip()[:20].lower()
    return next((what for mark, what in _FOREIGN if begin.startswith(mark.lower())), "")
