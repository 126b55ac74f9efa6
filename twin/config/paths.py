"""Files that commands write."""

import os
from pathlib import Path

from twin.errors import TwinError


def writable(path: Path) -> Path:
    """Check that a file can be written before anything is computed, and create its folder.

    Raises
    ------
    TwinError : the path is a folder, or its folder cannot be created or written
    """
    folder = path.parent
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise TwinError(f"cannot write {path}: {error.strerror}") from None
    if path.is_dir() or not os.access(folder, os.W_OK):
        raise TwinError(f"cannot write {path}: {'a folder' if path.is_dir() else 'no permission'}")
    return path
