"""Simulated rigs with random tolerances: each calibrated, stepped, and compared with the linkage.

python -m tests.benchmarks.units [COUNT]
"""

import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from analysis.comparison import errors
from analysis.recording import Recording, read
from twin.config import Calibrate, Step
from twin.experiments.calibrate import calibrate
from twin.experiments.step import step

COUNT = 20


def rises(folder: Path, unit: int) -> tuple[list[float], Recording]:
    """Rise times of a calibrated unit [ms], x and y down and up, and its recording."""
    calibration, out = folder / f"{unit}.json", folder / f"{unit}.rrd"
    calibrate(Calibrate(unit=unit, repeats=1, out=calibration))
    asked = Step(
        gimbal="emulator", unit=unit, calibration=calibration, repeats=1, hold_s=0.4, out=out
    )
    figures = [f for axis in step(asked).figures for f in axis.figures]
    return [1e3 * f.value for f in figures if f.name.startswith("rise_time")], read(out)


def fits(run: Recording) -> list[float]:
    """Fit of the simulated to the measured angle of each axis [%]."""
    seen, shown = run["gimbal/measured"], run["gimbal/simulated"]
    there = [np.interp(seen.time, shown.time, shown.column(a)) for a in "xy"]
    return [errors(seen.column(a), s).fit for a, s in zip("xy", there, strict=True)]


def table(count: int = COUNT) -> Iterator[str]:
    """One line a unit, then the spread of the rise times and the fits."""
    times, fit = [], []
    with tempfile.TemporaryDirectory() as folder:
        for unit in range(1, count + 1):
            rise, run = rises(Path(folder), unit)
            times.append(rise)
            fit.append(fits(run))
            shown = "  ".join(f"{t:.1f}" for t in rise)
            yield f"unit {unit:<3} rise {shown} ms, fit {fit[-1][0]:.1f}  {fit[-1][1]:.1f} %"
    spread = np.std(times, axis=0, ddof=1) / np.mean(times, axis=0)
    yield f"rise times spread {100 * np.sqrt(np.mean(spread**2)):.1f} % rms over {count} units"
    low, middle, high = np.quantile(fit, (0.0, 0.5, 1.0))
    yield f"fit of the linkage: {low:.1f} to {high:.1f} %, median {middle:.1f} %"


if __name__ == "__main__":
    for text in table(*map(int, sys.argv[1:2])):
        print(text, flush=True)
