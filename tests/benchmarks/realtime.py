"""How late the wall clock's ticks begin, beside `cyclictest` of the same seconds (Debian rt-tests).

Both wake every 4 ms. `cyclictest` is what C can reach on this machine at this load.
"""

import json
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from analysis.recording import read
from tests.benchmarks.timing import row

SECONDS = int(os.environ.get("TWIN_BENCH_SECONDS", "60"))
PERIOD_US = 4000
TWIN = [sys.executable, "-c", "from twin.cli import main; main()"]
RUN = [
    *TWIN, "step", "--clock", "wall", "--control-hz", "250", "--signal", "chirp", "--axis", "x",
    "--hold-s", "0.2", "--repeats", "1", "--json", "--duration-s", str(SECONDS),
]  # fmt: skip


def table() -> Iterator[str]:
    """Lines of the table."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder, "run.rrd")
        beside = _cyclictest()
        done = subprocess.run([*RUN, "--out", str(out)], capture_output=True, text=True, check=True)
        timing = json.loads(done.stdout)["timing"]
        late = read(out)["timing/lateness"].values[:, 0] * 1e6
        reference = _percentile(beside) if beside else None
    p50, p99, p999 = (float(v) for v in np.percentile(late, (50, 99, 99.9)))
    rights = ", ".join(f"{k} {v}" for k, v in timing["rights"].items())
    yield row(f"real time, {SECONDS} s at 250 Hz, recorded: {rights}", timing["verdict"], "", True)
    yield row(
        "lateness p50 / p99 / worst", f"{p50:.0f} / {p99:.0f} / {late.max():.0f} µs", "", True
    )
    claim = "lateness p99.9"
    if reference is None:
        yield row(claim, f"{p999:.0f} µs", "cyclictest is not here: apt-get install rt-tests", True)
    else:
        good = p999 <= 3 * reference
        yield row(claim, f"{p999:.0f} µs", f"≤ 3 × cyclictest, {reference:.0f} µs", good)
    overruns = timing["overruns"]
    yield row("overruns", f"{overruns} of {timing['ticks']}", "none", overruns == 0)
    drift = float(np.median(late[-250:]) - np.median(late[:250]))
    yield row("drift over the run", f"{drift:+.0f} µs", "< 1 ms", abs(drift) < 1000)


def _cyclictest() -> "subprocess.Popen[str] | None":
    tool = shutil.which("cyclictest")
    if tool is None:
        return None
    return subprocess.Popen(
        [tool, "-q", "-m", "-p", "40", "-t", "1", "-i", str(PERIOD_US), "-h", "20000",
         "-D", str(SECONDS)],
        stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True,
    )  # fmt: skip


def _percentile(process: "subprocess.Popen[str]") -> float | None:
    """99.9th percentile of a histogram of microseconds; None where it was not allowed to run."""
    told, _ = process.communicate(timeout=2 * SECONDS + 60)
    bins = [line.split() for line in told.splitlines() if line and not line.startswith("#")]
    counts = np.array([int(b[1]) for b in bins if len(b) == 2])
    if not counts.sum():
        return None
    return float(np.searchsorted(np.cumsum(counts), 0.999 * counts.sum()))
