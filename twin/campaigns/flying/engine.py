"""Flies the runs of a campaign in processes, fragment by fragment; see docs/decisions/0008."""

import os
import selectors
import signal
import warnings
from collections.abc import Callable, Generator, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any

from twin.campaigns.flying.store import Store
from twin.campaigns.statistics.figures import FIGURES
from twin.errors import TwinError

Work = Callable[[int], dict[str, Any]]
FAILED = 3  # exit code of a process that has sent its reason


@dataclass
class _Child:
    """A process that flies one fragment."""

    pid: int
    part: int
    pipe: int
    reached: int | None = None
    text: bytes = b""


@dataclass
class Engine:
    """Flies what is missing of a campaign, each fragment in a process of its own.

    The processes are forked, so that they begin with everything loaded, and end with their
    fragment, so that memory does not grow. A fragment depends on its runs alone: the table is the
    same whatever died and whatever was flown at the same time.

    Parameters
    ----------
    work : makes the row of a run
    store : takes the rows
    workers : processes at a time
    lost : gives the row of a run whose process died
    flown : called after every run
    meanwhile : called once, while the first runs fly
    """

    work: Work
    store: Store
    workers: int
    lost: Callable[[int], Mapping[str, Any]]
    flown: Callable[[], None] = lambda: None
    meanwhile: Callable[[], None] = lambda: None
    _children: dict[int, _Child] = field(default_factory=dict)
    _crashed: set[int] = field(default_factory=set)

    def fragments(self) -> Generator[int, None, None]:
        """Fly; yields the fragments in order, each when it and all before it are complete.

        Raises
        ------
        TwinError : rows cannot be written, or a process cannot fly at all
        """
        if not hasattr(os, "fork"):
            raise TwinError("twin campaign: needs a system with fork (Linux, macOS)")
        waiting = self.store.prepare()[::-1]
        present = set(range(self.store.parts)) - set(waiting)
        try:
            with selectors.DefaultSelector() as pipes:
                for part in range(self.store.parts):
                    while part not in present:
                        while waiting and len(self._children) < self.workers:
                            self._begin(waiting.pop(), pipes)
                        self._meanwhile()
                        present |= set(self._progress(pipes))
                    yield part
        finally:
            self._end()

    def _meanwhile(self) -> None:
        self.meanwhile, begin = (lambda: None), self.meanwhile
        begin()

    def _begin(self, part: int, pipes: selectors.BaseSelector) -> None:
        read, write = os.pipe()
        with warnings.catch_warnings():  # the child uses no thread of its parent
            warnings.simplefilter("ignore", DeprecationWarning)
            pid = os.fork()
        if pid == 0:
            os.close(read)
            self._fly(part, write)  # never returns
        os.close(write)
        child = _Child(pid, part, read)
        self._children[read] = child
        pipes.register(read, selectors.EVENT_READ, child)

    def _fly(self, part: int, pipe: int) -> None:
        """The child: fly a fragment, write it, and end. A dead parent ends it at its next run."""
        code = 1
        try:
            signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent decides
            signal.signal(signal.SIGTERM, signal.SIG_DFL)
            os.dup2(os.open(os.devnull, os.O_WRONLY), 2)  # MuJoCo's warnings; rows count them
            rows = []
            for run in self.store.runs_of(part):
                os.write(pipe, b"%d\n" % run)
                rows.append(self.lost(run) if run in self._crashed else self.work(run))
            self.store.write(part, rows)
            code = 0
        except BrokenPipeError:
            pass
        except BaseException as error:
            text = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
            what = f"cannot write {self.store.file(part)}: " if isinstance(error, OSError) else ""
            with suppress(OSError):
                os.write(pipe, b"!" + f"{what}{text or type(error).__name__}".encode()[:2000])
            code = FAILED
        finally:
            os._exit(code)

    def _progress(self, pipes: selectors.BaseSelector) -> Iterator[int]:
        """Wait for news of the processes; yields fragments that became complete."""
        for key, _ in pipes.select():
            child: _Child = key.data
            if news := os.read(child.pipe, 1 << 16):
                self._note(child, news)
                continue
            pipes.unregister(child.pipe)
            yield from self._ended(child, pipes)

    def _note(self, child: _Child, news: bytes) -> None:
        child.text += news
        head, mark, tail = child.text.partition(b"!")
        *lines, rest = head.split(b"\n")
        for line in lines:
            if child.reached is not None:
                self.flown()
            child.reached = int(line)
        child.text = mark + tail if mark else rest

    def _ended(self, child: _Child, pipes: selectors.BaseSelector) -> Iterator[int]:
        os.close(child.pipe)
        del self._children[child.pipe]
        _, status = os.waitpid(child.pid, 0)
        code = os.waitstatus_to_exitcode(status)
        if code == 0:
            self.flown()
            yield child.part
            return
        if child.text.startswith(b"!"):
            text = " ".join(child.text[1:].decode(errors="replace").split())
            raise TwinError(f"{text}; `twin campaign resume` continues")
        if child.reached is None or child.reached in self._crashed:
            raise TwinError(f"a process that flies runs ended with {code} before its first run")
        self._crashed.add(child.reached)
        self._begin(child.part, pipes)

    def _end(self) -> None:
        for child in self._children.values():
            with suppress(ProcessLookupError):
                os.kill(child.pid, signal.SIGTERM)
            os.close(child.pipe)
            os.waitpid(child.pid, 0)
        self._children.clear()


def lost_row(run: int, seed: int, values: Mapping[str, Any]) -> dict[str, Any]:
    """Row of a run whose process died."""
    reason = "the process that flew it died; `twin campaign refly` shows it"
    none = dict.fromkeys(FIGURES)
    return {"run": run, "seed": seed, **values, "outcome": "crashed", "reason": reason, **none}
