"""How late the wall clock's ticks begin, beside `cyclictest` of the same seconds (Debian rt-tests).

Both wake every 4 ms. `cyclictest` is what C can reach on this machine at this load. With a rig, the
emulator behind the port is a process of its own on the same processors.
"""

import json
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis.recording import read
from tests.benchmarks.line import answering, echo, peer, served
from tests.benchmarks.timing import Row

SECONDS = int(os.environ.get("TWIN_BENCH_SECONDS", "60"))
PERIOD_US = 4000
TWIN = [sys.executable, "-m", "twin"]
RUN = [
    *TWIN, "step", "--clock", "wall", "--control-hz", "250", "--signal", "chirp", "--axis", "x",
    "--hold-s", "0.2", "--repeats", "1", "--json",
]  # fmt: skip
RIG = {"pty": [*TWIN, "rig", "--json"], "tcp": [*TWIN, "rig", "--json", "--port", "0"]}
SHORT = min(SECONDS, 20)  # seconds for a round trip, five of them a second


def table() -> Iterator[Row]:
    """Lines of the table."""
    yield from _run("real time, simulated", [])[0]
    for kind, command in RIG.items():
        with served(command) as url:
            lines, trips = _run(f"hardware in the loop, emulator over a {kind}", ["--gimbal", url])
        yield from lines
        yield from _round_trips(kind, trips)


def _run(title: str, options: list[str]) -> tuple[list[Row], NDArray[np.float64]]:
    """Lines about one run beside `cyclictest`, and its round trips [ms]."""
    beside = _cyclictest()
    timing, late, trips = _recorded(SECONDS, options)
    stolen = timing["stolen_s"] * 1e3
    reference = _reference(beside) if beside else None
    calm, worst = reference or (None, None)
    note = "cyclictest" if reference else "cyclictest is not here: apt-get install rt-tests"
    p50, p99, p999 = (float(v) for v in np.percentile(late, (50, 99, 99.9)))
    once = float(np.percentile(_stalls_once(late), 99.9))
    rights = ", ".join(f"{k} {v}" for k, v in timing["rights"].items())
    load = os.getloadavg()[0]
    why = "; ".join(timing["reasons"])
    drift = float(np.median(late[-250:]) - np.median(late[:250]))
    said = f"{timing['verdict']} {why}; {rights}; load {load:.1f}, {stolen:.0f} ms stolen"
    most = 3 * calm if calm else None
    lines = [
        Row(f"{title}, ticks at 250 Hz", timing["ticks"], note=said),
        Row("lateness p50", p50, "µs"),
        Row("lateness p99", p99, "µs"),
        Row("lateness p99.9, every tick", p999, "µs", peer=calm, note=note),
        Row("the same, a stall counted once", once, "µs", most=most, peer=calm, note=note),
        Row("lateness, worst", float(late.max()), "µs", peer=worst, note=note),
        Row("overruns", timing["overruns"], most=0),
        Row("drift over the run", abs(drift), "µs", most=1000),
    ]
    return lines, trips


def _stalls_once(late: NDArray[np.float64]) -> NDArray[np.float64]:
    """Lateness [µs] without the ticks that were missed together with the one before.

    After a stall `cyclictest` skips the wake-ups it has missed and notes one late one; the loop
    skips no tick, and notes them all.
    """
    kept, k = [], 0
    while k < len(late):
        kept.append(late[k])
        k += 1 + int(late[k] // PERIOD_US)
    return np.array(kept)


def _round_trips(kind: str, trips: NDArray[np.float64]) -> Iterator[Row]:
    """Lines about PING and PONG: what the emulator takes, what a bare line does, what is ours.

    Ours is the round trip to a peer that answers at once, less that answer's making and a bare echo
    over the same kind of port: encoding, decoding, and the wait until the loop has time to look.
    """
    bare = echo(kind)
    yield from _pair(f"round trip to the emulator over a {kind}", trips, bare)
    with served(peer("prompt", kind)) as url:
        prompt = _recorded(SHORT, ["--gimbal", url, "--no-check"])[2]  # it has no gimbal to move
    yield from _pair("round trip to a peer that answers at once", prompt, bare)
    theirs = answering()
    ours = float(np.median(prompt)) - theirs - bare[0]
    note = "the peer's decoding and encoding"
    yield Row("own share of a round trip, p50", ours, "ms", most=0.5, peer=theirs, note=note)


def _pair(claim: str, trips: NDArray[np.float64], bare: tuple[float, float]) -> Iterator[Row]:
    for name, trip, of in zip(("p50", "p99"), np.percentile(trips, (50, 99)), bare, strict=True):
        yield Row(f"{claim}, {name}", float(trip), "ms", peer=of, note="bare pyserial echo")


def _recorded(
    seconds: int, options: list[str]
) -> tuple[dict[str, Any], NDArray[np.float64], NDArray[np.float64]]:
    """Timing of a run as JSON, its lateness [µs] and its round trips [ms]."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder, "run.rrd")
        asked = [*RUN, "--duration-s", str(seconds), "--out", str(out), *options]
        done = subprocess.run(asked, stdout=subprocess.PIPE, text=True, check=True)
        run = read(out)
    trips = run.series.get("timing/round_trip")
    return (
        json.loads(done.stdout)["timing"],
        run["timing/lateness"].values[:, 0] * 1e6,
        np.zeros(0) if trips is None else trips.values[:, 0] * 1e3,
    )


def _cyclictest() -> "subprocess.Popen[str] | None":
    """Threads on every processor: a virtual machine's may stand still one by one."""
    tool = shutil.which("cyclictest")
    if tool is None:
        return None
    return subprocess.Popen(
        [tool, "-q", "-m", "-p", "40", "-t", "-a", "-i", str(PERIOD_US), "-h", "20000",
         "-D", str(SECONDS)],
        stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True,
    )  # fmt: skip


def _reference(process: "subprocess.Popen[str]") -> tuple[float, float] | None:
    """99.9 % and worst of histograms of microseconds; None where it was not allowed to run."""
    told, _ = process.communicate(timeout=2 * SECONDS + 60)
    lines = told.splitlines()
    bins = [line.split()[1:] for line in lines if line and not line.startswith("#")]
    counts = np.array([sum(map(int, b)) for b in bins if b])
    worst = [line.split(":")[1].split() for line in lines if line.startswith("# Max Latencies")]
    if not counts.sum() or not worst:
        return None
    p999 = np.searchsorted(np.cumsum(counts), 0.999 * counts.sum())
    return float(p999), float(max(map(int, worst[0])))
