"""Rerun's program as a child process, and ports of the loopback interface."""

import contextlib
import importlib.util
import os
import socket
import subprocess
import tempfile
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

from twin.errors import TwinError

LOOPBACK = "127.0.0.1"
START_SECONDS = 30.0


class ViewerError(TwinError):
    """A recording that cannot be shown, as one line."""


def binary() -> Path:
    """Return Rerun's program itself; `rerun` on the path is a wrapper that outlives its parent."""
    package = importlib.util.find_spec("rerun_cli")
    if package is None or package.origin is None:
        raise ViewerError("Rerun's viewer is not installed; install the package rerun-sdk")
    return Path(package.origin).parent / ("rerun.exe" if os.name == "nt" else "rerun")


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


def check_free(port: int) -> None:
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
