"""Repair a recording, and show it on the screen or in a browser."""

import contextlib
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from analysis.files import FileError, opened
from analysis.recording.lock import held
from analysis.recording.rrd import MAGIC
from twin.viewer.process import LOOPBACK, ViewerError, binary, check_free
from twin.viewer.web import serve_web

LARGEST = 1 << 50  # bytes
WRITER_WAIT_S = 5.0  # the file of a killed run is complete after 0.2 s; else the run is still on
EMPTY_BYTES = 1000  # Rerun writes 100 to 400 for a recording without content


def complete(path: Path) -> bool:
    """Whether a recording is complete, including its footer."""
    if path.stat().st_size < EMPTY_BYTES:
        return False
    return _rerun("rrd", "verify", str(path)).returncode == 0


def _let_finish(path: Path) -> Path:
    """The file of a killed run, after its writer has had time to complete it."""
    if path.suffix != ".partial":
        return path
    deadline = time.monotonic() + WRITER_WAIT_S
    while held(path) and time.monotonic() < deadline:
        time.sleep(0.05)
    whole = path.with_suffix("")
    return whole if whole.exists() and not path.exists() else path


def repaired(path: Path) -> Path:
    """Return `path` if it is complete, else a new file beside it with what can be recovered.

    Raises
    ------
    ViewerError : the file is missing, is not a recording, or nothing can be recovered
    """
    path = _let_finish(path)
    try:
        with opened(path, LARGEST) as file:
            start = file.read(len(MAGIC))
    except FileError as error:
        raise ViewerError(f"cannot open {error}") from None
    if not start and path.suffix == ".partial":
        raise ViewerError(f"{path}: empty; its run was killed before it had written anything")
    if start != MAGIC:
        raise ViewerError(f"{path}: not a Rerun recording (.rrd)")
    if path.suffix == ".rrd" and complete(path):
        return path
    stem = path.name.removesuffix(".partial").removesuffix(".rrd")
    fresh = path.with_name(f"{stem}.repaired.rrd")
    try:
        with tempfile.TemporaryDirectory(dir=path.parent, prefix=".repair-") as folder:
            part = Path(folder) / fresh.name
            done = _rerun("rrd", "optimize", "--continue-on-error", str(path), "-o", str(part))
            if done.returncode != 0 or not part.is_file() or not complete(part):
                raise ViewerError(f"{path}: nothing can be recovered")
            part.replace(fresh)
    except OSError as error:
        reason = error.strerror or error
        raise ViewerError(f"{path}: incomplete, and {fresh} cannot be written: {reason}") from None
    return fresh


def view(path: Path, *, web: bool = False, port: int = 0) -> int:
    """Open a recording on the screen, or with `web` serve it to browsers on this machine.

    Repairs an incomplete recording first. Returns the exit code of the viewer.

    Raises
    ------
    ViewerError : the recording cannot be opened
    """
    if web and port:
        check_free(port)
    path = repaired(Path(path))
    if not web:
        if not has_display():
            raise ViewerError(f"no display: give --web, `twin view --web {path}`, to use a browser")
        return subprocess.call([str(binary()), "--bind", LOOPBACK, "--port", "auto", str(path)])
    with serve_web(path, port) as url:
        print(f"{url}\n(on this machine only; end with Ctrl-C)", file=sys.stderr, flush=True)
        with contextlib.suppress(KeyboardInterrupt):
            while True:
                time.sleep(3600.0)
    return 0


def has_display() -> bool:
    """Whether a window can open; elsewhere than on Linux the system decides."""
    if not sys.platform.startswith("linux"):
        return True
    return any(os.environ.get(name) for name in ("DISPLAY", "WAYLAND_DISPLAY", "WAYLAND_SOCKET"))


def _rerun(*options: str) -> subprocess.CompletedProcess[bytes]:
    return subprocess.run(
        [str(binary()), *options], capture_output=True, stdin=subprocess.DEVNULL, check=False
    )
