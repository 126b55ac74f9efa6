"""Whole commands: start-up, file size, memory."""

import json
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

from tests.benchmarks.timing import row

TWIN = [sys.executable, "-c", "from twin.cli.main import main; main()"]


def table() -> Iterator[str]:
    """Lines of the table."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder, "fly.rrd")
        flights = [_timed([*TWIN, "fly", "--json", "--out", str(out)]) for _ in range(4)][1:]
        whole = statistics.median(seconds for seconds, _ in flights)
        numbers = json.loads(flights[-1][1])
        yield row("twin fly, prompt to prompt, warm", f"{whole:.2f} s", "≤ 4 s", whole <= 4)
        load = [
            _timed([sys.executable, "-c", "import twin.cli.main, twin.experiments.fly"])[0]
            for _ in range(4)
        ][1:]
        imports = statistics.median(load)
        yield row("its imports", f"{imports:.2f} s", "≤ 1.5 s", imports <= 1.5)
        minute = out.stat().st_size / numbers["flight_time_s"] * 60 / 1e6
        yield row("recording per simulated minute", f"{minute:.1f} MB", "≤ 20 MB", minute <= 20)
    grown = _growth()
    yield row("memory over 30 simulated minutes", f"{grown:+.1f} MB", "±5 MB", abs(grown) <= 5)


def _timed(command: list[str]) -> tuple[float, str]:
    began = time.perf_counter()
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    return time.perf_counter() - began, done.stdout


def _growth() -> float:
    """Resident memory gained between the first and the thirtieth simulated minute [MB]."""
    with tempfile.TemporaryDirectory() as folder:
        module = [sys.executable, "-m", "tests.benchmarks.long_run"]
        _, told = _timed([*module, str(Path(folder, "long.rrd")), "30"])
    sizes = [int(line) for line in told.split()]
    return (sizes[30] - sizes[1]) / 1e6
