"""Where results may be written: the one gate for every `--out`."""

import os
import re
import stat
from collections.abc import Callable, Mapping
from contextlib import suppress
from datetime import datetime
from itertools import count
from pathlib import Path

from analysis import schema
from analysis.schema import AnalysisError
from twin import status
from twin.config.seats import is_port
from twin.errors import TwinError

RUNS = Path("runs")
LATEST = "latest-"
_DATED = re.compile(r"(?P<name>.+)-\d{8}-\d{6}(-\d+)?")
HEAD = 4096  # bytes of a page in which its generator is named


def named(out: Path | None, name: str, *suffixes: str, force: bool = False) -> Path:
    """Where a result is written: the file that was asked for, or NAME-DATE-TIME in a folder.

    Parameters
    ----------
    out : file or folder; the folder `runs` if None
    suffixes, force : see `writable`; the first suffix is that of a dated name

    Raises
    ------
    TwinError : it cannot be written, see `writable`
    """
    place = out or RUNS
    if out is None or place.is_dir() or (not place.suffix and ".rrd" in suffixes):
        place = dated(place, name, suffixes[0])
    return writable(place, *suffixes, force=force)


def dated(folder: Path, name: str, suffix: str) -> Path:
    """A name with the local time that nothing in the folder has yet, finished or not."""
    stem = f"{name}-{datetime.now().astimezone():%Y%m%d-%H%M%S}"
    for k in count(1):
        path = folder / f"{stem}{f'-{k}' if k > 1 else ''}{suffix}"
        if not any(map(os.path.lexists, (path, path.with_name(path.name + ".partial")))):
            break
    return path


def point_latest(path: Path) -> None:
    """Let `latest-NAME` lead to a result with a dated name, if it was written.

    A symbolic link, or a hard link where the system grants none (Windows); left out where the
    folder takes neither, or has something else of that name.
    """
    if (match := _DATED.fullmatch(path.stem)) is None or not path.exists():
        return
    link = path.with_name(f"{LATEST}{match['name']}{path.suffix}")
    beside = path.with_name(f".{link.name}-{os.getpid()}")
    with suppress(OSError):
        if os.path.lexists(link) and not _leads_to(link, match["name"]):
            return
        try:
            try:
                beside.symlink_to(path.name)
            except OSError:
                beside.hardlink_to(path)
            beside.replace(link)
        finally:
            beside.unlink(missing_ok=True)  # also left by a rename over another link of the file


def _leads_to(link: Path, name: str) -> bool:
    """Whether this is a link to a result with a dated name, in its own folder."""
    folder = link.parent
    if link.is_symlink():
        paths = [folder / link.readlink()]
    else:
        paths = [p for p in folder.iterdir() if p.is_file() and p.samefile(link)]
    found = (_DATED.fullmatch(path.stem) for path in paths if path.parent == folder)
    return any(match is not None and match["name"] == name for match in found)


def writable(path: Path, *suffixes: str, force: bool = False) -> Path:
    """Check, before anything is computed, that a result can be written here; create its folder.

    A result is written beside its place under the name `PATH.partial` and then renamed, so both
    names are checked: each must be free or a regular file. Devices, FIFOs, sockets and folders are
    refused, and links that lead out of the folder or nowhere. A file that a simulation or a report
    wrote is replaced with a note, since it can be had again; any other needs `force`.

    Parameters
    ----------
    suffixes : allowed file name extensions, in lower case; any if none is given
    force : replace a file of any content

    Raises
    ------
    TwinError : the path and what it must be
    """
    if path.name.startswith(LATEST):
        raise TwinError(f"--out {path}: {LATEST}… names the newest result; give another name")
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
    if path.exists() and path.stat().st_size:
        status.note(f"twin: {path} exists and is replaced")
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
