"""The processes with limits of `analysis.limited`, forked from one that has imported already.

Such a process imports MuJoCo or pyarrow for a third of a second and works for some milliseconds,
and tests start hundreds. Here one process for each of pytest's makes the imports and forks; limits,
exit codes, signals and output are those of a process started anew. Modules of tests about the start
itself are marked `started`.
"""

import contextlib
import importlib
import json
import os
import signal
import socket
import subprocess
import sys
import tempfile
import time
import traceback
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import SimpleNamespace

import pytest

from analysis import limited

MODULES = ("twin.physics.trial", "analysis.recording.unpacking", "analysis.recording.mat")
ROOT = Path(__file__).resolve().parents[1]


class Nursery:
    """Stands for `subprocess` in `analysis.limited`."""

    PIPE = subprocess.PIPE
    TimeoutExpired = subprocess.TimeoutExpired

    def __init__(self) -> None:
        self._socket: socket.socket | None = None
        self._parent: subprocess.Popen[bytes] | None = None

    def run(self, command: Sequence[str], **options) -> SimpleNamespace:
        """As `subprocess.run` of `python -P -m MODULE SECONDS MEGABYTES`."""
        module, *arguments = command[3:]
        if module not in MODULES:
            return subprocess.run(command, **options)
        asked = {"module": module, "arguments": arguments, "timeout": options["timeout"]}
        with tempfile.TemporaryFile() as request, ThreadPoolExecutor(2) as readers:
            request.write(options["input"])
            request.seek(0)
            out, err = os.pipe(), os.pipe()
            told = [readers.submit(_all, end[0]) for end in (out, err)]
            try:
                code = self._ask(
                    {**asked, "cwd": str(Path.cwd())}, request.fileno(), out[1], err[1]
                )
            finally:
                os.close(out[1])
                os.close(err[1])
            shown = [t.result() for t in told]
        if code is None:
            raise subprocess.TimeoutExpired(list(command), options["timeout"])
        return SimpleNamespace(returncode=code, stdout=shown[0], stderr=shown[1])

    def _ask(self, asked: dict, *streams: int) -> int | None:
        if self._socket is None:
            self._socket, other = socket.socketpair()
            self._parent = subprocess.Popen(
                [sys.executable, "-P", "-m", "tests.confined", str(other.fileno())],
                stdin=subprocess.DEVNULL, env={**os.environ, "PYTHONPATH": str(ROOT)},
                pass_fds=[other.fileno()], start_new_session=True,
            )  # fmt: skip
            other.close()
        socket.send_fds(self._socket, [json.dumps(asked).encode()], list(streams))
        answer: int | None = json.loads(self._socket.recv(100))
        return answer

    @contextlib.contextmanager
    def at_work(self) -> Iterator[None]:
        """Let `analysis.limited` fork within the block."""
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(limited, "subprocess", self)
            yield

    def close(self) -> None:
        """End the process that forks."""
        if self._socket is not None and self._parent is not None:
            self._socket.close()
            self._parent.wait()


def _all(end: int) -> bytes:
    with open(end, "rb") as pipe:
        return pipe.read()


def main() -> None:
    """Fork a process for each request on the socket; answer with its exit code, or null."""
    entries = {module: importlib.import_module(module).main for module in MODULES}
    line = socket.socket(fileno=int(sys.argv[1]))
    while True:
        message, streams, _, _ = socket.recv_fds(line, 100_000, 3)
        if not message:
            return
        asked = json.loads(message)
        if (child := os.fork()) == 0:
            line.close()
            os._exit(_run(asked, entries[asked["module"]], streams))
        for stream in streams:
            os.close(stream)
        until, done = time.monotonic() + asked["timeout"], (0, 0)
        while done[0] == 0 and time.monotonic() < until:
            time.sleep(0.002)
            done = os.waitpid(child, os.WNOHANG)
        if done[0] == 0:
            os.kill(child, signal.SIGKILL)
            os.waitpid(child, 0)
        line.send(json.dumps(os.waitstatus_to_exitcode(done[1]) if done[0] else None).encode())


def _run(asked: dict, entry: Callable[[], None], streams: list[int]) -> int:
    for number, stream in enumerate(streams):
        os.dup2(stream, number)
        os.close(stream)
    for number, name in enumerate(("stdin", "stdout", "stderr")):
        setattr(sys, name, open(number, "w" if number else "r", encoding="utf-8", closefd=False))  # noqa: SIM115
    sys.argv = [asked["module"], *asked["arguments"]]
    os.chdir(asked["cwd"])
    code = 0
    try:
        entry()
    except SystemExit as end:
        code = end.code if isinstance(end.code, int) else 1
    except BaseException:
        traceback.print_exc()
        code = 1
    sys.stdout.flush()
    sys.stderr.flush()
    return code


if __name__ == "__main__":
    main()
