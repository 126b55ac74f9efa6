"""What the model beside a rig costs: pairs of runs with and without it.

python -m tests.benchmarks.shadow [PAIRS]
"""

import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from twin.config import Fly, Step
from twin.experiments.flight.fly import fly
from twin.experiments.step import step

KINDS = ("none", "linkage")
FLIGHT_S = 6.0


def lockstep(folder: Path, shadow: str) -> float:
    """CPU time of a step test on the emulator [s]."""
    began = time.process_time()
    step(Step(gimbal="emulator", shadow=shadow, repeats=1, out=folder / "step.rrd"))
    return time.process_time() - began


def late(folder: Path, shadow: str) -> tuple[int, float, float]:
    """Overruns, and lateness at 50 and 99 % [ms], of a flight in real time at 250 Hz."""
    flight = Fly(
        gimbal="emulator", clock="wall", shadow=shadow, duration_s=FLIGHT_S, out=folder / "fly.rrd"
    )
    timing = fly(flight).timing
    assert timing is not None
    assert timing.lateness is not None
    return timing.overruns, 1e3 * timing.lateness.p50, 1e3 * timing.lateness.p99


def table(pairs: int = 5) -> Iterator[str]:
    """The ratio in lockstep, then overruns and lateness in real time."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        lockstep(folder, "linkage")  # compiles
        spent = [[lockstep(folder, kind) for kind in KINDS] for _ in range(pairs)]
        without, beside = np.min(spent, axis=0)
        yield f"lockstep: {beside / without:.2f} × the time without, {without:.2f} s"
        runs = [[late(folder, kind) for kind in KINDS] for _ in range(pairs)]
    for kind, (overruns, median, rare) in zip(KINDS, np.median(runs, axis=0), strict=True):
        yield f"real time, {kind}: {overruns:g} overruns, lateness {median:.3f} and {rare:.3f} ms"


if __name__ == "__main__":
    for text in table(*map(int, sys.argv[1:2])):
        print(text, flush=True)
