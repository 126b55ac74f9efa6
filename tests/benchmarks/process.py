"""Whole commands: start-up, file size, memory."""

import json
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

from tests.benchmarks.timing import Row

PEER = "mujoco, numba, numpy, rerun"
TWIN = [sys.executable, "-m", "twin"]


def table() -> Iterator[Row]:
    """Lines of the table."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder, "fly.rrd")
        flights = [_timed([*TWIN, "fly", "--json", "--out", str(out)]) for _ in range(4)][1:]
        whole = statistics.median(seconds for seconds, _ in flights)
        numbers = json.loads(flights[-1][1])
        yield Row("twin fly, prompt to prompt, warm", whole, "s", most=4)
        program = "twin.cli.main, twin.experiments.flight.fly"
        ours, theirs = (_imported(names) for names in (program, PEER))
        yield Row("its imports", ours, "s", most=1.5, peer=theirs, note=f"import {PEER}")
        minute = out.stat().st_size / numbers["flight_time_s"] * 60 / 1e6
        yield Row("recording per simulated minute", minute, "MB", most=20)
    yield Row("memory gained in a simulated hour, after ten minutes", _growth(), "MB", most=20)


def _imported(names: str) -> float:
    """Median time of a process that imports, without the first [s]."""
    command = [sys.executable, "-c", f"import {names}"]
    return statistics.median([_timed(command)[0] for _ in range(4)][1:])


def _timed(command: list[str]) -> tuple[float, str]:
    began = time.perf_counter()
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    return time.perf_counter() - began, done.stdout


def _growth() -> float:
    """Memory of its own gained between minutes 10 to 15 and 25 to 30, as of an hour [MB]."""
    with tempfile.TemporaryDirectory() as folder:
        module = [sys.executable, "-m", "tests.benchmarks.long_run"]
        _, told = _timed([*module, str(Path(folder, "long.rrd")), "30"])
    sizes = [float(line) for line in told.split()]
    early, late = (statistics.median(sizes[a:b]) for a, b in ((10, 15), (25, 30)))
    return (late - early) / 15.0 * 60.0
