"""A ring of rows in memory shared by two processes: one appends, one takes; neither waits."""

import os
import tempfile
from contextlib import suppress
from dataclasses import dataclass
from enum import IntEnum
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

# Memory on Linux; elsewhere a file that the system keeps in its cache. Names come from `mkstemp`.
SHARED = Path("/dev/shm")  # noqa: S108
PREFIX = "tvc-twin-ring-"
_HEAD, _TAIL = 0, 8  # words of the counters, a cache line apart


class Kind(IntEnum):
    """Kind of an entry."""

    ROW = 0
    POSE = 1


@dataclass(frozen=True)
class Shape:
    """Description of a ring, for both processes.

    Attributes
    ----------
    path : its file
    capacity : entries
    width : values of an entry
    """

    path: str
    capacity: int
    width: int

    @property
    def words(self) -> int:
        """Size in words of eight bytes."""
        return 16 + self.capacity * (3 + self.width)


def make(capacity: int, width: int) -> Shape:
    """Create the file of a ring and write every page of it; the caller deletes it.

    Files that processes killed before that have left are deleted here.

    Raises
    ------
    OSError : no memory or disk space
    """
    folder = SHARED if os.access(SHARED, os.W_OK) else None
    _sweep(folder or Path(tempfile.gettempdir()))
    handle, path = tempfile.mkstemp(prefix=f"{PREFIX}{os.getpid()}-", dir=folder)
    shape = Shape(path, capacity, width)
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(bytes(8 * shape.words))
    except OSError:
        Path(path).unlink(missing_ok=True)
        raise
    return shape


def _sweep(folder: Path) -> None:
    """Delete the files of this user's processes that are gone; their names have the process."""
    for path in folder.glob(f"{PREFIX}*-*"):
        process = path.name.removeprefix(PREFIX).partition("-")[0]
        if not process.isdecimal() or os.name != "posix":
            continue
        try:
            os.kill(int(process), 0)
        except ProcessLookupError:
            with suppress(OSError):  # another user's, or deleted by another process meanwhile
                path.unlink()
        except (PermissionError, OverflowError):
            continue


class Ring:
    """One end of a ring; a process uses either `put` or `take`.

    An entry is written before it is counted, but another processor may see the count first.
    Therefore the taker leaves newly counted entries for its next call (`settled`).
    """

    def __init__(self, shape: Shape) -> None:
        words = np.memmap(shape.path, np.int64, "r+", shape=(shape.words,))
        whole: NDArray[np.int64] = np.asarray(words)
        self._counters = whole[:16]
        end = 16 + 3 * shape.capacity
        self._stamps = whole[16:end].reshape(shape.capacity, 3)
        self._values = whole[end:].view(np.float64).reshape(shape.capacity, shape.width)
        self._capacity = shape.capacity
        self._count = 0
        self._settled = 0
        self.lost = 0

    def put(self, kind: Kind, time_ns: int, wall_ns: int, values: NDArray[np.float64]) -> None:
        """Append an entry; without room it is counted in `lost`."""
        n = self._count
        if n - self._counters[_TAIL] >= self._capacity:
            self.lost += 1
            return
        k = n % self._capacity
        stamp = self._stamps[k]
        stamp[0], stamp[1], stamp[2] = time_ns, wall_ns, kind
        self._values[k, : values.size] = values
        self._count = n + 1
        self._counters[_HEAD] = n + 1

    def take(self, *, settled: bool = True) -> list[tuple[Kind, int, int, NDArray[np.float64]]]:
        """Entries in order, copied: kind, time [ns], time since 1970 [ns], values.

        Parameters
        ----------
        settled : leave entries counted since the last call; False takes all
        """
        head = int(self._counters[_HEAD])
        until = self._settled if settled else head
        self._settled = head
        entries = []
        while self._count < until:
            k = self._count % self._capacity
            time_ns, wall_ns, kind = self._stamps[k].tolist()
            entries.append((Kind(kind), time_ns, wall_ns, self._values[k].copy()))
            self._count += 1
        self._counters[_TAIL] = self._count
        return entries
