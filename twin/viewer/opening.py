"""Rerun's program: repair a recording, open it on the screen, serve it to a browser."""

import contextlib
import importlib.util
import os
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

from analysis.files import FileError, opened
from analysis.recording.lock import held
from analysis.recording.rrd import MAGIC
from twin.errors import TwinError

LOOPBACK = "127.0.0.1"
START_SECONDS = 30.0
LARGEST = 1 << 50  # bytes
WRITER_WAIT_S = 5.0  # the file of a killed run is complete after 0.2 s; else the run is still on
EMPTY_BYTES = 1000  # Rerun writes 100 to 400 for a recording without content


class ViewerError(TwinError):
    """A recording that cannot be shown, as one line."""


def binary() -> Path:
    """Return Rerun's program itself; `rerun` on the path is a wrapper that outlives its parent."""
    package = importlib.util.find_spec("rerun_cli")
    if package is None or package.origin is None:
        raise ViewerError("Rerun's viewer is not installed; install the package rerun-sdk")
    return Path(package.origin).parent / ("rerun.exe" if os.name == "nt" else "rerun")


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
        _check_free(port)
    path = repaired(Path(path))
    if not web:
        return subprocess.call([str(binary()), "--bind", LOOPBACK, "--port", "auto", str(path)])
    with serve_web(path, port) as url:
        print(f"{url}\n(on this machine only; end with Ctrl-C)", file=sys.stderr)
        with contextlib.suppress(KeyboardInterrupt):
            while True:
                time.sleep(3600.0)
    return 0


@contextlib.contextmanager
def serve_web(path: Path, port: int = 0) -> Iterator[str]:
    """Serve a recording to browsers on the loopback interface; yields the address.

    Parameters
    ----------
    path : recording
    port : of the page; 0 for a free one

    Raises
    ------
    ViewerError : the port is invalid or in use, or the viewer does not start
    """
    if port:
        _check_free(port)
    page, data = port or free_port(), free_port()
    options = ["--serve-web", "--bind", LOOPBACK, "--port", str(data)]
    with running([*options, "--web-viewer-port", str(page), str(path)], page):
        yield f"http://{LOOPBACK}:{page}?url=rerun%2Bhttp%3A%2F%2F{LOOPBACK}%3A{data}%2Fproxy"


@contextlib.contextmanager
def running(options: Sequence[str], port: int) -> Iterator[subprocess.Popen[bytes]]:
    """Run Rerun's program for the length of the block, which begins when it listens on `port`.

    It starts with empty settings: pictures must not depend on the user's, and Rerun sends no usage
    data before its second session.
    """
    with tempfile.TemporaryDirectory(prefix="twin-viewer-") as home:
        environment = {**os.environ, **dict.fromkeys(_SETTINGS, home)}
        process = subprocess.Popen(
            [str(binary()), *options],
            env=environment,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        try:
            _await_port(process, port)
            yield process
        finally:
            process.kill()
            process.wait()


_SETTINGS = ("XDG_CONFIG_HOME", "XDG_DATA_HOME", "XDG_CACHE_HOME", "XDG_STATE_HOME")


def free_port() -> int:
    """Return a free port of the loopback interface."""
    with socket.socket() as probe:
        probe.bind((LOOPBACK, 0))
        return int(probe.getsockname()[1])


def _check_free(port: int) -> None:
    """Refuse an invalid port or one in use, which Rerun would not report."""
    if not 1 <= port <= 65535:
        raise ViewerError(f"--port {port}: must be 1 to 65535, or 0 for a free one")
    try:
        with socket.socket() as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            probe.bind((LOOPBACK, port))
    except OSError as error:
        raise ViewerError(f"cannot serve on port {port}: {error.strerror or error}") from None


def _await_port(process: subprocess.Popen[bytes], port: int) -> None:
    until = time.monotonic() + START_SECONDS
    while time.monotonic() < until:
        if process.poll() is not None:
            raise ViewerError(
                f"the viewer ended at once with code {process.returncode}; "
                "without a screen it needs a Vulkan driver (Debian: mesa-vulkan-drivers libvulkan1)"
            )
        with contextlib.suppress(OSError), socket.create_connection((LOOPBACK, port), 0.2):
            return
        time.sleep(0.05)
    raise ViewerError(f"the viewer does not listen on port {port} after {START_SECONDS:.0f} s")


def _rerun(*options: str) -> subprocess.CompletedProcess[bytes]:
    return subprocess.run(
        [str(binary()), *options], capture_output=True, stdin=subprocess.DEVNULL, check=False
    )
