"""Where results may be written: the one gate for every `--out`."""

import os
import stat
from pathlib import Path

from twin.errors import TwinError


def writable(path: Path, *suffixes: str) -> Path:
    """Check, before anything is computed, that a result can be written here; create its folder.

    A result is written beside its place under the name `PATH.partial` and then renamed, so both
    names are checked: each must be free or a regular file. Devices, FIFOs, sockets and folders are
    refused, and links that lead out of the folder or nowhere.

    Parameters
    ----------
    suffixes : allowed file name extensions, in lower case; any if none is given

    Raises
    ------
    TwinError : the path and what it must be
    """
    if suffixes and path.suffix.lower() not in suffixes:
        raise TwinError(f"--out {path}: must be a file name that ends with {' or '.join(suffixes)}")
    folder = path.parent
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for name in (path, path.with_name(path.name + ".partial")):
            _check_place(name)
    except OSError as error:
        raise TwinError(f"cannot write {path}: {error.strerror}") from None
    except RuntimeError:  # raised by pathlib before Python 3.13
        raise TwinError(f"cannot write {path}: it is a loop of links") from None
    if not os.access(folder, os.W_OK):
        raise TwinError(f"cannot write {path}: no permission in {folder}")
    return path


def _check_place(path: Path) -> None:
    """Refuse what is not a regular file, and links to other places."""
    if not os.path.lexists(path):
        return
    if path.is_symlink():
        target = path.resolve()
        if target.parent != path.parent.resolve() or not target.exists():
            raise TwinError(f"cannot write {path}: it is a link to {target}")
    mode = path.stat().st_mode
    if stat.S_ISDIR(mode):
        raise TwinError(f"cannot write {path}: it is a folder")
    if not stat.S_ISREG(mode):
        raise TwinError(f"cannot write {path}: it is not a regular file")
