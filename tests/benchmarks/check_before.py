"""Is what a record cannot determine named before the fit, and nothing else?

python -m tests.benchmarks.check_before [RECORDS [FIRST SEED]]
python -m tests.benchmarks.check_before emulator [UNITS [FIRST UNIT]]

Servos with bounded speed, dead band and play (small Euler steps, not the estimator's motion); every
other record is poor: steps of one size, one way only, few of them, or sampled slowly and noisily.
A parameter misses where its interval is wider than the bar: poles, delay and gain of the linear
fit, bounds of the servo's. With `emulator`: the interval that is promised for emulated gimbals with
tolerances over the one that the fit states.
"""

import sys
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

import numpy as np

import twin
from analysis.compiled import njit
from analysis.identify import expectations, identify, identify_gimbal
from analysis.recording import Measurement, measurement
from twin.config import Identify
from twin.evaluation.inputs import given

POOR = ("one size", "one way", "few", "slow")
STEP = 1e-4  # s of the simulation


class Servo(NamedTuple):
    """True parameters [rad/s, 1, s, rad/s, rad, rad]."""

    frequency: float
    damping: float
    delay: float
    limit: float
    band: float
    play: float


@njit()
def _moved(command: np.ndarray, servo: Servo, step: float) -> np.ndarray:
    """Angle behind play of a servo whose speed loop saturates, of a command every `step` (n,)."""
    w = 2.0 * servo.damping * servo.frequency
    stiff = servo.frequency**2 / w
    out = np.empty(len(command))
    y = v = seen = 0.0
    for i, c in enumerate(command):
        error = c - y
        if error > servo.band:
            error -= servo.band
        elif error < -servo.band:
            error += servo.band
        else:
            error = 0.0
        aim = min(max(stiff * error, -servo.limit), servo.limit)
        v += w * (aim - v) * step
        y += v * step
        seen = min(max(seen, y - servo.play / 2.0), y + servo.play / 2.0)
        out[i] = seen
    return out


def record(seed: int) -> tuple[Measurement, Servo, str]:
    """A record, its servo, and in what it is poor; of even seeds in nothing."""
    rng = np.random.default_rng(seed)
    poor = POOR[seed // 2 % 4] if seed % 2 else ""
    span = np.radians(12.0)
    servo = Servo(
        rng.uniform(35, 70), rng.uniform(0.6, 0.9), rng.uniform(0.005, 0.02),
        rng.uniform(1.5, 3.0), *(span * rng.uniform(0.007, 0.014, 2)),
    )  # fmt: skip
    period, noise = (0.02, 2e-3) if poor == "slow" else (0.004, 3e-4)
    count = 4 if poor == "few" else 28
    size = span / 2.0 * rng.permutation(np.geomspace(0.1, 1.0, count))
    level = size * np.where(np.arange(count) % 2, -1.0, 1.0)
    if poor == "one size":
        level = span / 2.0 * (1.0 - np.arange(count) % 2)
    if poor == "one way":
        level = np.cumsum(np.sort(size))
        level *= span / level[-1]
    at = 0.4 + 0.45 * np.arange(count) + rng.uniform(0.0, 0.04, count)
    grid = np.arange(0.0, at[-1] + 0.6, STEP)
    held = np.append(0.0, level)[np.searchsorted(at + servo.delay, grid, side="right")]
    time = np.arange(0.0, grid[-1], period)
    angle = np.interp(time, grid, _moved(held, servo, STEP)) + noise * rng.normal(size=len(time))
    run = measurement(time, level, command_time=at, before=[0.0], angle=angle)
    return run, servo, poor


def judged(seed: int) -> tuple[str, dict[str, tuple[float, float]]]:
    """In what a record is poor; by parameter, half widths over bars before and after the fit."""
    run, _, poor = record(seed)
    after = {}
    for model in (identify([run]), identify([run], servo="speed")):
        estimates = model.servo[0].estimates if model.servo else model.estimates
        after |= {e.name.partition(" ")[2]: e for e in estimates}
    rows = {}
    for expected in expectations([run]):
        name = expected.name.partition(" ")[2]
        size = 1.0 if name == "delay" else abs(after[name].value)
        known = after[name].determined and size > 0.0
        half = 1.96 * after[name].std / size if known else np.inf
        rows[name] = (expected.half / expected.bar, half / expected.bar)
    return poor, rows


def counted(rows: dict[str, tuple[float, float]]) -> np.ndarray:
    """Parameters by whether they were named (rows) and missed (columns)."""
    found = np.zeros((2, 2), int)
    for before, after in rows.values():
        found[int(before > 1.0), int(after > 1.0)] += 1
    return found


def table(records: int = 40, first: int = 0) -> Iterator[str]:
    """A line for each record, and the counts."""
    total = np.zeros((2, 2), int)
    for seed in range(first, first + records):
        poor, rows = judged(seed)
        total += counted(rows)
        wrong = [
            f"{name} {before:.2g} before, {after:.2g} after"
            for name, (before, after) in rows.items()
            if (before > 1.0) != (after > 1.0)
        ]
        text = "; ".join(wrong) or "all as named"
        yield f"seed {seed}, {poor or 'good'}: {text} (half widths over bars)"
    yield f"{total[:, 1].sum()} missed their bar, {total[1, 1]} of them named before"
    yield f"{total[1].sum()} were named, {total[1, 0]} of them in vain"


def promised(units: int = 10, first: int = 0) -> Iterator[str]:
    """A line for each emulated unit, and how many promises are within a factor of two."""
    kept = total = 0
    for unit in range(first, first + units):
        with TemporaryDirectory() as folder:
            file = Path(folder) / "rig.rrd"
            twin.step(gimbal="emulator", unit=unit, repeats=2, out=file)
            runs = given(Identify(sources=(file,)), (file,)).runs
        stated = {e.name: e for e in identify_gimbal(runs, servo=True).estimates}
        ratios = {}
        for e in (e for e in expectations(runs) if "/" not in e.name):
            after = stated[e.name]
            known = np.isfinite(after.std) and 1.96 * after.std < e.size
            size, half = (e.size, 1.96 * after.std) if known else (1.0, np.inf)
            # neither interval leaves anything out: both say that the record shows nothing
            ratios[e.name] = 1.0 if e.half >= 1.0 and not known else e.half * size / half
        total += len(ratios)
        kept += sum(0.5 <= r <= 2.0 for r in ratios.values())
        yield f"unit {unit}: " + ", ".join(f"{n} {r:.2g}" for n, r in ratios.items())
    yield f"{kept} of {total} promised intervals are within a factor of two of the stated ones"


if __name__ == "__main__":
    lines = promised if sys.argv[1:2] == ["emulator"] else table
    for text in lines(*(int(a) for a in sys.argv[1:] if a.isdecimal())):
        print(text, flush=True)
