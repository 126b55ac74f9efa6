"""A mark on a recording that a process is still writing, seen by whoever wants to mend it."""

import os
from pathlib import Path
from typing import IO


def claim(path: Path) -> IO[bytes]:
    """Open a file to write, marked as being written until the result, or this process, is closed.

    The mark is an advisory lock of the operating system, so a killed process leaves none. Where
    there are no such locks (Windows), nothing is marked. What was in the file is gone.

    Raises
    ------
    BlockingIOError : somebody else is writing it; it is left alone
    OSError : it cannot be written
    """
    file = path.open("ab")
    try:
        if os.name == "posix":
            import fcntl

            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        file.truncate(0)
    except OSError:
        file.close()
        raise
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
