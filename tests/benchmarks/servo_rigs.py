"""Emulated rigs with random tolerances, identified with `--servo`, on records held out.

python -m tests.benchmarks.servo_rigs [COUNT] [FIRST UNIT] [STRUCTURE]

Each unit records a PRBS and a multisine of 5° to fit, and one of each with another seed to predict,
from pulses, as `twin identify prbs.rrd multisine.rrd --servo --from-pulses --check other.rrd`. A
record commands one axis after the other: the fit to all of it, which the command prints, and that
to the stretch in which the axis is commanded. Where an axis rests within play and dead band while
the other one moves, its model does not know.
"""

import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Literal

import numpy as np

from analysis import recording
from analysis.identify import by_pulses
from analysis.identify.model import IdentifiedModel
from analysis.identify.prediction import nrmse_fit, predict
from twin.config import Identify, Step
from twin.evaluation.identify import identify
from twin.experiments.step import step

COUNT = 10
REST = 0.2  # s; after the last command, in which an axis comes to rest
Signal = Literal["prbs", "multisine"]
SIGNALS: tuple[Signal, ...] = ("prbs", "multisine")
Structure = Literal["best", "speed", "clipped", "command", "set-point"]


def records(folder: Path, unit: int, seed: int) -> tuple[Path, ...]:
    """One recording of each signal."""
    files = tuple(folder / f"{unit}-{signal}-{seed}.rrd" for signal in SIGNALS)
    for file, signal in zip(files, SIGNALS, strict=True):
        asked = Step(
            gimbal="emulator", unit=unit, signal=signal, repeats=1, seed=seed, shadow="none",
            out=file,
        )  # fmt: skip
        step(asked)
    return files


def commanded(model: IdentifiedModel, file: Path) -> list[float]:
    """Fit of each axis while it is commanded [%]."""
    run = by_pulses(recording.load(file))
    angle, found = predict(model, run)[0], []
    for k in range(len(run.outputs)):
        at = run.command.time[run.command.changes(k)]
        time = run.angles.time
        rows = (time >= at[0]) & (time <= at[-1] + REST)
        said = angle[np.searchsorted(run.time, time[rows]), k]
        found.append(nrmse_fit(run.angles.values[rows, k], said))
    return found


def held_out(
    folder: Path, unit: int, structure: Structure
) -> tuple[list[float], list[float], str, float]:
    """Fits [%] of both axes to each signal held out, whole and commanded; structure, CPU time."""
    fitted, kept = (records(folder, unit, seed) for seed in (1, 2))
    begin = time.process_time()
    found = identify(
        Identify(
            sources=fitted, servo=True, structure=structure, from_pulses=True, check=kept,
            out=folder / f"{unit}.json",
        )
    )  # fmt: skip
    took = time.process_time() - begin
    assert found.model.servo is not None
    own = [f for file in kept for f in commanded(found.model, file)]
    whole = [f for both in found.checks.values() for f in both]
    return whole, own, found.model.servo[0].structure, took


def table(count: int = COUNT, first: int = 1, structure: Structure = "best") -> Iterator[str]:
    """One line a unit, then the lowest, the median and how many reach 95 %."""
    every = []
    yield "fit to PRBS x, y and multisine x, y; the same while the axis is commanded [%]"
    with tempfile.TemporaryDirectory() as folder:
        for unit in range(first, first + count):
            whole, own, found, took = held_out(Path(folder), unit, structure)
            every.append((whole, own))
            a, b = (" ".join(f"{f:5.1f}" for f in fits) for fits in (whole, own))
            yield f"unit {unit:<4} {a}  commanded {b}  {found}, {took:.0f} s"
    for name, fits in zip(("all of it", "commanded"), np.moveaxis(every, 1, 0), strict=True):
        yield (
            f"{name}: lowest {fits.min():.1f}, median {np.median(fits):.1f} %, "
            f"{int((fits >= 95.0).sum())} of {fits.size} at 95 % or above"
        )


if __name__ == "__main__":
    numbers = [int(a) for a in sys.argv[1:3]]
    for text in table(*numbers, *sys.argv[3:4]):
        print(text, flush=True)
