"""One attempt with a random input, what counts as its failure, and a table of many."""

import contextlib
import random
import resource
import signal
import time
import traceback
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path

from tests.twin.test_mutations import REFUSED
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
    """Count of one kind: attempts, seconds, and the failed attempts with what happened."""

    kind: str
    attempts: int = 0
    seconds: float = 0.0
    failed: list[tuple[Attempt, str]] = field(default_factory=list)


@contextlib.contextmanager
def _alarm() -> Iterator[None]:
    def ring(*_: object) -> None:
        raise TimeoutError(f"has not ended after {WAITS} s")

    before = signal.signal(signal.SIGALRM, ring)
    signal.alarm(WAITS)
    try:
        yield
    finally:
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


def abuse(
    kinds: Mapping[str, tuple[Kind, int]],
    seed: int,
    folder: Path,
    minutes: float = 0.0,
    progress: Callable[[Row], None] = lambda _: None,
) -> list[Row]:
    """Try every kind its number of times, and again until the time is up; one row each."""
    rows = [Row(kind) for kind in kinds]
    end = time.monotonic() + 60 * minutes
    with contextlib.ExitStack() as stack:
        sources = {}
        for kind, (make, _) in kinds.items():
            (folder / kind).mkdir(parents=True)
            source = make(random.Random(f"{seed} {kind}"), folder / kind)
            sources[kind] = stack.enter_context(contextlib.closing(source))
        while True:
            for row in rows:
                _count(row, islice(sources[row.kind], kinds[row.kind][1]))
                progress(row)
            if time.monotonic() >= end:
                return rows


def _count(row: Row, attempts: Iterator[Attempt]) -> None:
    began = time.monotonic()
    for attempt in attempts:
        row.attempts += 1
        if text := failure(attempt):
            row.failed.append((attempt, text))
    row.seconds += time.monotonic() - began


def table(rows: list[Row]) -> str:
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


def save(rows: list[Row], folder: Path) -> None:
    """Write the first failed inputs of each kind, each beside a text with what happened."""
    for row in rows:
        for k, (attempt, text) in enumerate(row.failed[:SAVED]):
            folder.mkdir(parents=True, exist_ok=True)
            path = folder / f"{row.kind.replace(' ', '-')}-{k}"
            path.with_suffix(".input").write_bytes(attempt.given)
            path.with_suffix(".txt").write_text(f"{attempt.name}\n\n{text}\n")
