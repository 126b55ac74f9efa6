"""Where results may be written: the one gate for every `--out`."""

import os
import stat
from collections.abc import Callable, Mapping
from pathlib import Path

from analysis import schema
from analysis.schema import AnalysisError
from twin.config.seats import is_port
from twin.errors import TwinError

HEAD = 4096  # bytes of a page in which its generator is named


def writable(path: Path, *suffixes: str, force: bool = False) -> Path:
    """Check, before anything is computed, that a result can be written here; create its folder.

    A result is written beside its place under the name `PATH.partial` and then renamed, so both
    names are checked: each must be free or a regular file. Devices, FIFOs, sockets and folders are
    refused, and links that lead out of the folder or nowhere. A file that a simulation or a report
    wrote is replaced without a question, since it can be had again; any other needs `force`.

    Parameters
    ----------
    suffixes : allowed file name extensions, in lower case; any if none is given
    force : replace a file of any content

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
            if not force and name.exists() and not _renewable(name, path.suffix.lower()):
                raise TwinError(
                    f"--out {path}: {name} exists; give another name, or --force to replace it"
                )
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


def _renewable(file: Path, suffix: str) -> bool:
    """Whether a file is empty, or a simulation or report of this program wrote it."""
    return file.stat().st_size == 0 or (suffix in _RENEWABLE and _RENEWABLE[suffix](file))


def _simulated(file: Path) -> bool:
    """Whether a recording is one of the twin's, and not of a rig; a replay of a rig has no date."""
    from analysis.recording import properties

    try:
        run = properties(file)
    except AnalysisError:
        return False
    settings = run.get("configuration")
    gimbal = settings.get("gimbal") if isinstance(settings, dict) else None
    return not ("date" in run and isinstance(gimbal, str) and is_port(gimbal))


def _page(file: Path) -> bool:
    """Whether a page names this program as its generator."""
    with file.open("rb") as page:
        return f'name="generator" content="{schema.APPLICATION}"'.encode() in page.read(HEAD)


_RENEWABLE: Mapping[str, Callable[[Path], bool]] = {
    ".rrd": _simulated, ".html": _page, ".htm": _page,
}  # fmt: skip
