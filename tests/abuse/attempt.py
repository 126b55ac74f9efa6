"""One attempt with a random input, what counts as its failure, and a table of many."""

import contextlib
import faulthandler
import random
import resource
import signal
import time
import traceback
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import islice
from multiprocessing import get_context
from multiprocessing.connection import Connection, wait
from multiprocessing.context import ForkProcess
from pathlib import Path
from typing import Any

from tests.twin.cli.test_mutations import REFUSED
from twin.errors import CheckError, DivergenceError

LONGEST = 10.0  # s of processor time
WAITS = 90  # s on the clock; what waits for something does not end by itself
LARGEST = 1_000_000  # kB that the memory may grow by
SAVED = 5  # failures of a kind


@dataclass(frozen=True)
class Attempt:
    """What is tried.

    Attributes
    ----------
    name : of the target, with what reproduces the attempt
    act : raises one of `REFUSED` with one line, or nothing; anything else is a failure
    given : the input as bytes
    """

    name: str
    act: Callable[[], object]
    given: bytes = b""


# endless attempts, from a source of chance and a folder for its files
Kind = Callable[[random.Random, Path], Iterator[Attempt]]


@dataclass
class Row:
    """Count of one kind: attempts, seconds, and of the failed name, input and what happened."""

    kind: str
    attempts: int = 0
    seconds: float = 0.0
    failed: list[tuple[str, bytes, str]] = field(default_factory=list)


@contextlib.contextmanager
def _alarm() -> Iterator[None]:
    def ring(*_: object) -> None:
        raise TimeoutError(f"has not ended after {WAITS} s")

    before = signal.signal(signal.SIGALRM, ring)
    signal.alarm(WAITS)
    faulthandler.dump_traceback_later(2 * WAITS, exit=True)  # for one that waits in C
    try:
        yield
    finally:
        faulthandler.cancel_dump_traceback_later()
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)


def failure(attempt: Attempt) -> str:
    """What is wrong with the outcome of an attempt; "" if nothing is."""
    began, size = time.process_time(), resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    try:
        with _alarm():
            attempt.act()
    except (*REFUSED, DivergenceError, CheckError) as error:
        if "\n" in str(error):
            return f"refused in several lines: {error}"
    except BaseException as error:
        if isinstance(error, KeyboardInterrupt):
            raise
        return traceback.format_exc()
    if (took := time.process_time() - began) > LONGEST:
        return f"took {took:.0f} s of processor time"
    if (grown := resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - size) > LARGEST:
        return f"took {grown / 1000:.0f} MB of memory"
    return ""


def tried(kind: str, make: Kind, count: int, seed: int, folder: Path, seconds: float = 0.0) -> Row:
    """Try a kind its number of times, and again until the time is up.

    The attempt that is under way is kept beside the folder, for whoever looks after a crash.
    """
    folder.mkdir(parents=True)
    row, began = Row(kind), time.monotonic()
    with contextlib.closing(make(random.Random(f"{seed} {kind}"), folder)) as source:
        while not row.attempts or time.monotonic() < began + seconds:
            for attempt in islice(source, count):
                _current(folder).write_bytes(attempt.name.encode() + b"\n" + attempt.given)
                row.attempts += 1
                if text := failure(attempt):
                    row.failed.append((attempt.name, attempt.given, text))
    row.seconds = time.monotonic() - began
    return row


def _current(folder: Path) -> Path:
    return folder.with_name(f"{folder.name}.current")


def abuse(
    kinds: Mapping[str, tuple[Kind, int]],
    seed: int,
    folder: Path,
    minutes: float = 0.0,
    jobs: int = 1,
    progress: Callable[[Row], None] = lambda _: None,
) -> list[Row]:
    """Try every kind in a process that is forked for it, `jobs` at a time; one row each.

    A process that crashes costs its kind's row, which then says in which attempt.
    """
    context, waiting, rows = get_context("fork"), list(kinds), {}
    seconds = 60 * minutes * jobs / max(len(kinds), 1)
    busy: dict[Connection, tuple[str, ForkProcess]] = {}
    try:
        while waiting or busy:
            while waiting and len(busy) < jobs:
                kind = waiting.pop(0)
                line, theirs = context.Pipe(duplex=False)
                arguments = (theirs, kind, *kinds[kind], seed, folder / kind, seconds)
                process = context.Process(target=_send, args=arguments)
                process.start()
                theirs.close()
                busy[line] = kind, process
            for line in wait(list(busy)):
                kind, process = busy.pop(line)
                rows[kind] = _received(line, kind, process, folder / kind)
                progress(rows[kind])
    finally:
        for _, process in busy.values():
            process.terminate()
            process.join()
    return [rows[kind] for kind in kinds]


def _send(line: Connection, *arguments: Any) -> None:
    line.send(tried(*arguments))


def _received(line: Connection, kind: str, process: ForkProcess, folder: Path) -> Row:
    """Row of a kind; where its process ended without one, the attempt that ended it."""
    with line:
        try:
            row = line.recv()
        except EOFError:
            process.join()
            name, _, given = _current(folder).read_bytes().partition(b"\n")
            text = f"ended the process, exit code {process.exitcode}"
            row = Row(kind, 1, failed=[(name.decode(), given, text)])
    process.join()
    return row


def table(rows: Sequence[Row]) -> str:
    """Rows and their sum as text."""
    total = Row("all", sum(r.attempts for r in rows), sum(r.seconds for r in rows))
    total.failed = [f for r in rows for f in r.failed]
    head = f"{'kind':20s} {'attempts':>9s} {'failures':>9s} {'seconds':>8s}"
    return "\n".join(
        [head]
        + [
            f"{r.kind:20s} {r.attempts:9d} {len(r.failed):9d} {r.seconds:8.1f}"
            for r in [*rows, total]
        ]
    )


def save(rows: Sequence[Row], folder: Path) -> None:
    """Write the first failed inputs of each kind, each beside a text with what happened."""
    for row in rows:
        for k, (name, given, text) in enumerate(row.failed[:SAVED]):
            folder.mkdir(parents=True, exist_ok=True)
            path = folder / f"{row.kind.replace(' ', '-')}-{k}"
            path.with_suffix(".input").write_bytes(given)
            path.with_suffix(".txt").write_text(f"{name}\n\n{text}\n")
