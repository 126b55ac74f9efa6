"""Processes of verbs, forked from one that has imported every verb and run none."""

import atexit
import contextlib
import os
import resource
import signal
import sys
import threading
import traceback
from collections.abc import Iterator
from dataclasses import dataclass
from multiprocessing import get_context
from multiprocessing.connection import Connection
from pathlib import Path

from twin.cli.main import main
from twin.config.verbs import VERBS

Request = tuple[list[str], Path, int, Path]  # arguments, folder, largest file, errors


@dataclass
class Child:
    """A verb that has begun: `code` is its exit code, negative for a signal, once it has ended."""

    pid: int
    code: int | None
    _line: Connection
    _errors: int

    def ended(self, seconds: float) -> bool:
        """Whether it ends within a time."""
        if self.code is None and self._line.poll(seconds):
            self.code = self._line.recv()
        return self.code is not None

    def errors(self) -> str:
        """What it has printed as errors and nobody has read."""
        text = b""
        with contextlib.suppress(BlockingIOError):
            while piece := os.read(self._errors, 65_536):
                text += piece
        return text.decode(errors="replace")


class Children:
    """The process that the verbs are forked from; begun by a process without threads at work."""

    def __init__(self) -> None:
        context = get_context("fork")
        self._line, theirs = context.Pipe()
        self._server = context.Process(target=_serve, args=(theirs, self._line))
        self._server.start()
        theirs.close()

    def close(self) -> None:
        """End the process."""
        self._line.close()
        self._server.join()

    @contextlib.contextmanager
    def verb(self, arguments: list[str], place: Path, largest: int = 0) -> Iterator[Child]:
        """Begin a verb in a folder and a session of its own; `largest` limits its files [bytes].

        What is left of its session is killed in the end.
        """
        fifo = place.with_name(f"{place.name}.errors")
        os.mkfifo(fifo)
        errors = os.open(fifo, os.O_RDONLY | os.O_NONBLOCK)
        self._line.send((arguments, place, largest, fifo))
        child = Child(self._line.recv(), None, self._line, errors)
        try:
            yield child
        finally:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(child.pid, signal.SIGKILL)
            child.ended(60)
            os.close(errors)
            fifo.unlink()


def _serve(line: Connection, others: Connection) -> None:
    others.close()
    for verb in VERBS:
        verb.function  # noqa: B018  imports it
    with contextlib.suppress(EOFError):
        while True:
            request: Request = line.recv()
            begun, begins = os.pipe()
            if not (pid := os.fork()):
                _run(begins, *request)
            os.close(begins)
            os.read(begun, 1)
            os.close(begun)
            line.send(pid)
            line.send(os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]))


def _run(begins: int, arguments: list[str], place: Path, largest: int, errors: Path) -> None:
    """Be the verb, and end as an interpreter does."""
    code: object = 1
    try:
        os.setsid()
        os.chdir(place)
        os.dup2(os.open(os.devnull, os.O_RDWR), 1)
        os.dup2(os.open(errors, os.O_WRONLY), 2)
        sys.stdout, sys.stderr = os.fdopen(1, "w"), os.fdopen(2, "w")
        signal.signal(signal.SIGINT, signal.default_int_handler)  # a background shell ignores it
        if largest:
            resource.setrlimit(resource.RLIMIT_FSIZE, (largest, largest))
        os.write(begins, b"\0")
        os.close(begins)
        main(arguments)
    except SystemExit as end:
        code = end.code
    except BaseException:
        traceback.print_exc()
    threading._shutdown()
    atexit._run_exitfuncs()
    with contextlib.suppress(OSError):
        sys.stdout.flush(), sys.stderr.flush()
    os._exit(code if isinstance(code, int) else int(code is not None))
