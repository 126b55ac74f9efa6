"""Emulated rigs with random tolerances, identified with `--servo`, on records held out.

python -m tests.benchmarks.servo_rigs [COUNT] [FIRST UNIT]

Each unit records a PRBS and a multisine of 5° to fit, and one of each with another seed to predict,
from pulses, as `twin identify prbs.rrd multisine.rrd --servo --from-pulses --check other.rrd`.
"""

import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from twin.config import Identify, Step
from twin.evaluation.identify import identify
from twin.experiments.step import step

COUNT = 10
SIGNALS = ("prbs", "multisine")


def records(folder: Path, unit: int, seed: int) -> tuple[Path, ...]:
    """One recording of each signal."""
    files = []
    for signal in SIGNALS:
        files.append(folder / f"{unit}-{signal}-{seed}.rrd")
        step(
            Step(
                gimbal="emulator", unit=unit, signal=signal, repeats=1, seed=seed, shadow="none",
                out=files[-1],
            )
        )  # fmt: skip
    return tuple(files)


def held_out(folder: Path, unit: int) -> tuple[list[float], str, float]:
    """Fits of both axes to each signal held out [%], structure, processor time of the fit [s]."""
    fitted, kept = (records(folder, unit, seed) for seed in (1, 2))
    begin = time.process_time()
    found = identify(
        Identify(
            sources=fitted, servo=True, from_pulses=True, check=kept, out=folder / f"{unit}.json"
        )
    )
    took = time.process_time() - begin
    assert found.model.servo is not None
    fits = [f for both in found.checks.values() for f in both]
    return fits, found.model.servo[0].structure, took


def table(count: int = COUNT, first: int = 1) -> Iterator[str]:
    """One line a unit, then the lowest and the median."""
    every = []
    with tempfile.TemporaryDirectory() as folder:
        for unit in range(first, first + count):
            fits, structure, took = held_out(Path(folder), unit)
            every.append(fits)
            shown = " ".join(f"{f:5.1f}" for f in fits)
            yield f"unit {unit:<4} PRBS x, y, multisine x, y {shown} %  {structure}, {took:.0f} s"
    yield (
        f"lowest {np.min(every):.1f}, median {np.median(every):.1f} %, "
        f"{int((np.array(every) >= 95.0).sum())} of {np.size(every)} at 95 % or above"
    )


if __name__ == "__main__":
    for text in table(*map(int, sys.argv[1:3])):
        print(text, flush=True)
