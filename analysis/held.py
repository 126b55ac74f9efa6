"""A mark on a recording that a process is still writing, seen by whoever wants to mend it."""

import contextlib
import os
from pathlib import Path
from typing import IO


def hold(path: Path) -> IO[bytes]:
    """Mark a file as being written until the result, or this process, is closed.

    The mark is an advisory lock of the operating system, so a killed process leaves none. Where
    there are no such locks (Windows), nothing is marked.

    Raises
    ------
    OSError : the file is not there
    """
    file = path.open("rb")
    if os.name == "posix":
        import fcntl

        with contextlib.suppress(OSError):
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    return file


def held(path: Path) -> bool:
    """Whether a process says that it is writing the file; false where there is none."""
    if os.name != "posix":
        return False
    import fcntl

    try:
        with path.open("rb") as file:
            fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    except OSError:
        return False
    return False
