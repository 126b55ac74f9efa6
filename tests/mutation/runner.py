"""Runs the tests of a mutant in a copy of the tree, several mutants at once."""

import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from multiprocessing import get_context
from multiprocessing.connection import wait
from multiprocessing.context import ForkProcess
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
FOLDERS = ("analysis", "hardware", "meshes", "mjcf", "tests", "twin", "docs", ".ci")
LONGEST = 240.0  # s; whether a mutant or the machine's load takes that long is not known
OURS = ("analysis", "hardware", "meshes", "mjcf", "tests", "twin")
PRELOADED = (
    "control", "filterpy.kalman", "hypothesis", "mujoco", "numba", "numpy", "pytest",
    "scipy.optimize", "scipy.signal", "scipy.stats", "trimesh",
)  # fmt: skip
NOTHING_RUN = 4, 5  # exit codes of pytest; also 4 where what conftest imports is broken


@dataclass(frozen=True, slots=True)
class Mutant:
    """One wrong line, and the tests that should turn red.

    Attributes
    ----------
    name : for the report
    file : in the repository
    before, after : text that occurs once, and what replaces it
    tests : arguments of pytest
    at : character of `before` in the file where it occurs more than once; −1 where it does not
    """

    name: str
    file: str
    before: str
    after: str
    tests: tuple[str, ...]
    at: int = -1

    def applied(self, text: str) -> str:
        """The file's text with the mutation.

        Raises
        ------
        ValueError : the text has changed since the mutation was written
        """
        if self.at >= 0:
            end = self.at + len(self.before)
            if text[self.at : end] != self.before:
                raise ValueError(f"{self.name}: {self.file} has changed")
            return text[: self.at] + self.after + text[end:]
        if (count := text.count(self.before)) != 1:
            raise ValueError(f"{self.name}: {self.before!r} occurs {count} times in {self.file}")
        return text.replace(self.before, self.after)


@dataclass(frozen=True, slots=True)
class Verdict:
    """What became of a mutant, and the time it took [s].

    Attributes
    ----------
    outcome : "killed", "survived", "timed out", "no test ran", or "not tried" where its tests are
        red without it
    """

    mutant: Mutant
    outcome: str
    seconds: float
    output: str


def tree() -> Path:
    """A copy of the working tree with its compiled functions, in a temporary folder."""
    copy = Path(tempfile.mkdtemp(prefix="mutant-"))
    for name in FOLDERS:
        shutil.copytree(ROOT / name, copy / name, symlinks=True)
    for file in [*ROOT.glob("*.toml"), *ROOT.glob("*.md"), ROOT / "Makefile", ROOT / "LICENSE"]:
        shutil.copy2(file, copy)
    return copy


def _test(folder: Path, tests: tuple[str, ...], output: Path) -> None:
    """Run pytest in this forked process on the sources of a folder."""
    os.setsid()
    log = os.open(output, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
    os.dup2(log, 1), os.dup2(log, 2)
    os.chdir(folder)
    for name in [m for m in sys.modules if m.partition(".")[0] in OURS]:
        del sys.modules[name]
    sys.path[:] = [str(folder), *(p for p in sys.path if p not in ("", str(ROOT)))]
    os.environ["PYTHONPATH"] = str(folder)
    os.environ.pop("PYTEST_ADDOPTS", None)
    sys.dont_write_bytecode = True
    import hypothesis
    import pytest

    hypothesis.settings.register_profile("mutation", derandomize=True, database=None)
    options = ["-x", "-q", "--tb=line", "-p", "no:cacheprovider", "--hypothesis-profile=mutation"]
    os._exit(int(pytest.main([*options, *tests])))


class Workers:
    """Copies of the tree, in each of which one mutant at a time is tested."""

    def __init__(self, jobs: int) -> None:
        for name in PRELOADED:
            __import__(name)
        self._context = get_context("fork")
        self._idle = [tree() for _ in range(jobs)]
        self._busy: dict[int, tuple[ForkProcess, Path, Mutant, float]] = {}

    def __enter__(self) -> "Workers":
        return self

    def __exit__(self, *_: object) -> None:
        for process, folder, *_rest in self._busy.values():
            _end(process)
            shutil.rmtree(folder, ignore_errors=True)
        for folder in self._idle:
            shutil.rmtree(folder, ignore_errors=True)

    def run(self, mutants: Iterable[Mutant]) -> Iterator[Verdict]:
        """Test mutants; give their verdicts as they come."""
        for mutant in mutants:
            while not self._idle:
                yield from self._collect()
            self._begin(mutant)
        while self._busy:
            yield from self._collect()

    def _begin(self, mutant: Mutant) -> None:
        folder = self._idle.pop()
        target = folder / mutant.file
        if mutant.file:
            times = target.stat()
            target.write_text(mutant.applied(target.read_text()))
            if times.st_mtime_ns == target.stat().st_mtime_ns:  # compiled files go by it
                os.utime(target)
        arguments = (folder, mutant.tests, folder / "output.txt")
        process = self._context.Process(target=_test, args=arguments)
        process.start()
        self._busy[process.sentinel] = process, folder, mutant, time.monotonic()

    def _collect(self) -> Iterator[Verdict]:
        ready = set(wait(list(self._busy), timeout=1.0))
        for sentinel, (process, folder, mutant, began) in list(self._busy.items()):
            took = time.monotonic() - began
            if sentinel not in ready and took < LONGEST:
                continue
            _end(process)
            del self._busy[sentinel]
            self._idle.append(folder)
            if mutant.file:
                shutil.copy2(ROOT / mutant.file, folder / mutant.file)
            text = (folder / "output.txt").read_text(errors="replace")
            late = sentinel not in ready
            yield Verdict(mutant, outcome(process.exitcode, text, late=late), took, text)


def verdicts(workers: Workers, mutants: Sequence[Mutant]) -> Iterator[Verdict]:
    """Run each set of tests without a mutation, then the mutants of those that are green."""
    red = set()
    bare = [Mutant("", "", "", "", tests) for tests in dict.fromkeys(m.tests for m in mutants)]
    for v in workers.run(bare):
        if v.outcome != "survived":
            red.add(v.mutant.tests)
            for m in mutants:
                if m.tests == v.mutant.tests:
                    yield Verdict(m, "not tried", v.seconds, v.output)
    yield from workers.run([m for m in mutants if m.tests not in red])


def _end(process: ForkProcess) -> None:
    if process.is_alive() and process.pid:
        try:
            os.killpg(process.pid, signal.SIGKILL)
        except ProcessLookupError:
            process.kill()
    process.join()


def outcome(code: int | None, text: str, *, late: bool = False) -> str:
    """What an exit code and the output of pytest say about a mutant."""
    if late:
        return "timed out"
    if code in NOTHING_RUN and "while loading conftest" not in text:
        return "no test ran"
    return "survived" if code == 0 else "killed"  # also by a crash


def compiles(folder: Path, source: str) -> bool:
    """Whether a C++ source passes the compiler's checks; no mutant is killed by the compiler."""
    command = ["g++", "-std=gnu++11", "-fsyntax-only", f"-I{folder}", "-x", "c++", "-"]
    return subprocess.run(command, input=source, text=True, capture_output=True).returncode == 0
