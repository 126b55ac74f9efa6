"""Is what a record cannot determine named before the fit, and nothing else?

python -m tests.benchmarks.check_before [RECORDS [FIRST SEED]]

Servos with bounded speed, dead band and play (small Euler steps, not the estimator's motion); every
other record is poor: steps of one size, one way only, few of them, or sampled slowly and noisily.
A parameter misses where the half width of its interval, or its error, is beyond the bar.
"""

import sys
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from analysis.compiled import njit
from analysis.identify import expectations, identify
from analysis.recording import Measurement, measurement

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
    if poor == "one size":
        size[:] = span / 2.0
    level = size * np.where(np.arange(count) % 2, -1.0, 1.0)
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


def judged(seed: int) -> tuple[str, dict[str, tuple[float, float, float]]]:
    """In what a record is poor; by parameter, half widths before and after, and the bar."""
    run, _, poor = record(seed)
    found = {e.name.partition(" ")[2]: e for e in expectations([run])}
    model = identify([run], servo="speed")
    linear = identify([run])
    after = {e.name.partition(" ")[2]: e for e in linear.estimates}
    after |= {e.name.partition(" ")[2]: e for e in model.servo[0].estimates}
    rows = {}
    for name, expected in found.items():
        e = after[name]
        size = 1.0 if name == "delay" else abs(e.value)
        half = 1.96 * e.std / size if e.determined and size > 0.0 else np.inf
        rows[name] = (expected.half, half, expected.bar)
    return poor, rows


def table(records: int = 40, first: int = 0) -> Iterator[str]:
    """A line for each record, and the counts."""
    counts = np.zeros((2, 2), int)  # named, missed
    for seed in range(first, first + records):
        poor, rows = judged(seed)
        texts = []
        for name, (before, after, bar) in rows.items():
            named, missed = before > bar, after > bar
            counts[int(named), int(missed)] += 1
            if named != missed:
                texts.append(f"{name} {before / bar:.2g} before, {after / bar:.2g} after")
        wrong = "; ".join(texts) or "all as named"
        yield f"seed {seed}, {poor or 'good':<9}{wrong} (half widths over bars)"
    yield f"{counts[:, 1].sum()} missed their bar, {counts[1, 1]} of them named before"
    yield f"{counts[1].sum()} were named, {counts[1, 0]} of them in vain"


if __name__ == "__main__":
    for text in table(*map(int, sys.argv[1:3])):
        print(text, flush=True)
