"""Simulated rigs with random tolerances: each calibrated, stepped, identified and compared.

python -m tests.benchmarks.units [COUNT]

Every unit is calibrated and stepped twice, with other seeds. The difference of the two identified
models, over both deviations, says how many true values the 95 % intervals hold: a gimbal with dead
band and play has no true linear model, but two measurements of it must agree.
"""

import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from analysis.comparison import errors
from analysis.recording import Recording, read
from analysis.schema import AnalysisError
from twin.config import Calibrate, Identify, Step
from twin.errors import TwinError
from twin.evaluation.identify import identify
from twin.experiments.calibrate import calibrate
from twin.experiments.step import step

COUNT = 20


Figures = dict[str, tuple[float, float]]


def measured(folder: Path, unit: int, seed: int) -> tuple[list[float], Recording, Figures]:
    """Of a calibrated unit: rise times [ms], x and y down and up, recording, identified figures."""
    calibration, out = folder / f"{unit}-{seed}.json", folder / f"{unit}-{seed}.rrd"
    calibrate(Calibrate(unit=unit, seed=seed, repeats=1, out=calibration))
    # another hold, so that other commands meet other phases of the pulse frame
    asked = Step(
        gimbal="emulator", unit=unit, calibration=calibration, repeats=2,
        hold_s=0.4 + 0.037 * (seed - 1), seed=seed, out=out, on_fault="ignore",
    )  # fmt: skip
    stepped = step(asked)
    if stepped.fault is not None:
        print(f"unit {unit}: named although healthy: {stepped.fault}", flush=True)
    figures = [f for axis in stepped.figures for f in axis.figures]
    model = identify(Identify(sources=(out,), out=folder / f"{unit}-{seed}-model.json")).model
    rises = [1e3 * f.value for f in figures if f.name.startswith("rise_time")]
    return rises, read(out), {e.name: (e.value, e.std) for e in model.estimates if e.determined}


def scores(one: Figures, other: Figures) -> dict[str, float]:
    """Difference of each figure over the deviation of a difference."""
    return {
        name: (one[name][0] - other[name][0]) / float(np.hypot(one[name][1], other[name][1]))
        for name in one.keys() & other.keys()
        if one[name][1] > 0.0 and other[name][1] > 0.0
    }


def fits(run: Recording) -> list[float]:
    """Fit of the simulated to the measured angle of each axis [%]."""
    seen, shown = run["gimbal/measured"], run["gimbal/simulated"]
    there = [np.interp(seen.time, shown.time, shown.column(a)) for a in "xy"]
    return [errors(seen.column(a), s).fit for a, s in zip("xy", there, strict=True)]


def table(count: int = COUNT) -> Iterator[str]:
    """One line a unit, then the spread of the rise times, the fits and the coverage."""
    times: list[list[float]] = []
    fit, found = [], []
    with tempfile.TemporaryDirectory() as folder:
        for unit in range(1, count + 1):
            try:
                rise, run, one = measured(Path(folder), unit, 1)
                z = scores(one, measured(Path(folder), unit, 2)[2])
            except (TwinError, AnalysisError) as error:
                yield f"unit {unit:<3} not measured: {error}"
                continue
            times.append(rise)
            fit.append(fits(run))
            found += list(z.values())
            shown = "  ".join(f"{t:.1f}" for t in rise)
            held = sum(abs(e) < 1.96 for e in z.values())
            yield (
                f"unit {unit:<3} rise {shown} ms, fit {fit[-1][0]:.1f}  {fit[-1][1]:.1f} %, "
                f"{held} of {len(z)} figures agree"
            )
    if len(times) > 1:
        yield from _summary(times, fit, found)


def _summary(times: list[list[float]], fit: list[list[float]], found: list[float]) -> Iterator[str]:
    spread = np.std(times, axis=0, ddof=1) / np.mean(times, axis=0)
    yield f"rise times spread {100 * np.sqrt(np.mean(spread**2)):.1f} % rms over {len(times)} units"
    low, middle, high = np.quantile(fit, (0.0, 0.5, 1.0))
    yield f"fit of the linkage: {low:.1f} to {high:.1f} %, median {middle:.1f} %"
    z = np.array(found)
    yield (
        f"intervals of two measurements agree in {100 * np.mean(abs(z) < 1.96):.1f} % of {len(z)} "
        f"figures, score rms {np.sqrt(np.mean(z**2)):.2f}"
    )


if __name__ == "__main__":
    for text in table(*map(int, sys.argv[1:2])):
        print(text, flush=True)
