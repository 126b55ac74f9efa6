"""Servos of each structure, simulated by small Euler steps: truths that 95 % intervals hold.

python -m tests.benchmarks.servo_structures KIND FIRST:LAST [dead-band] [play] [noise=RAD]

KIND is `speed`, `clipped` or `set-point`. Each seed draws delay, frequency, damping and limits, and
records 15 s of steps of 1 to 14° at 200 Hz. A row has the seed, the structure found,
its processor time and the truths that its intervals miss; the last row counts. Truths of a servo
that was given another structure do not count.
"""

import sys
import time
from collections.abc import Mapping

import numpy as np

from analysis.array import Array
from analysis.compiled import njit
from analysis.identify import IdentifiedModel, identify
from analysis.recording import measurement
from analysis.recording.measurements import Measurement

KINDS = ("speed", "clipped", "set-point")
NOISE = 2e-4  # rad
PERIOD, GAP = 0.005, 0.6  # s
STEP = 1e-5  # s; of the simulation
UNBOUNDED = 1e9


@njit(nogil=True)  # pragma: no cover - compiled
def simulate(
    kind: int, count: int, at: Array, command: Array, delay: float, frequency: float,
    damping: float, up: float, down: float, slew: float, dead_band: float, play: float,
) -> Array:  # fmt: skip
    """Angle (count,) behind the play, every `STEP`."""
    w, k = 2.0 * damping * frequency, 0.5 * frequency / damping
    y = v = r = u = out = 0.0
    event, angle = 0, np.empty(count)
    for j in range(count):
        while event < len(at) and at[event] + delay <= j * STEP + 1e-12:
            u = command[event]
            event += 1
        out = min(max(out, y - 0.5 * play), y + 0.5 * play)
        angle[j] = out
        if kind == 1:
            after = min(max(v + w * (k * (u - y) - v) * STEP, -up), up)
        else:
            r = u if kind == 0 else r + min(max(u - r, -slew * STEP), slew * STEP)
            error = r - y - min(max(r - y, -dead_band), dead_band)
            after = v + w * (min(max(k * error, -down), up) - v) * STEP
        y += 0.5 * (v + after) * STEP
        v = after
    return angle


def drawn(kind: str, rng: np.random.Generator, *, dead_band: bool, play: bool) -> dict[str, float]:
    """True parameters, by the names of the estimates."""
    low, high = [0.005, 25.0, 0.5, 0.6], [0.03, 60.0, 1.0, 1.6]
    names = ("x/x delay", "x/x natural frequency", "x/x damping", "x rate limit")
    found = dict(zip(names, rng.uniform(low, high).tolist(), strict=True)) | {"x/x gain": 1.0}
    if kind == "set-point":
        up = found["x rate limit"]
        down = up * float(rng.uniform(0.8, 1.25))
        found["x rate limit back"] = down
        found["x slew of the set point"] = max(up, down) * float(rng.uniform(1.05, 1.5))
    if dead_band:
        found["x dead band"] = float(rng.uniform(2e-3, 8e-3))
    if play:
        found["x backlash"] = float(rng.uniform(5e-3, 15e-3))
    return found


def recorded(
    kind: str, truth: Mapping[str, float], rng: np.random.Generator, noise: float, duration: float
) -> Measurement:
    """Steps to and fro of all sizes in random order, stamps off by up to 0.2 ms."""
    t = np.arange(0.0, duration, PERIOD)
    t[1:] += rng.uniform(-2e-4, 2e-4, len(t) - 1)
    at = np.arange(0.2, duration, GAP)
    at += rng.uniform(-0.02, 0.02, len(at))
    size = np.radians(rng.permutation(np.geomspace(1.0, 14.0, len(at))))
    u = size * np.where(np.arange(len(at)) % 2, -1.0, 1.0)
    up = truth["x rate limit"]
    angle = simulate(
        KINDS.index(kind), int((t[-1] + 0.01) / STEP) + 2, at, u, truth["x/x delay"],
        truth["x/x natural frequency"], truth["x/x damping"], up,
        truth.get("x rate limit back", up), truth.get("x slew of the set point", UNBOUNDED),
        truth.get("x dead band", 0.0), truth.get("x backlash", 0.0),
    )  # fmt: skip
    seen = np.interp(t, STEP * np.arange(len(angle)), angle) + noise * rng.normal(size=len(t))
    return measurement(t, u, command_time=at, before=[0.0], angle=seen)


def missed(model: IdentifiedModel, truth: Mapping[str, float]) -> list[str]:
    """Truths outside their 95 % interval, with value and half width."""
    found = []
    for name, true in truth.items():
        e = model.estimate(name)
        if not abs(e.value - true) <= 1.96 * e.std:
            found.append(f"{name} {true:.4g}: {e.value:.4g} ± {1.96 * e.std:.2g}")
    return found


def main(kind: str, seeds: range, *, dead_band: bool, play: bool, noise: float) -> None:
    """Print a row of each seed, and the counts."""
    chosen, held, truths, times = 0, 0, 0, []
    for seed in seeds:
        rng = np.random.default_rng(seed)
        truth = drawn(kind, rng, dead_band=dead_band, play=play)
        record = recorded(kind, truth, rng, noise, 15.0)
        begin = time.process_time()
        model = identify([record], servo=True)
        times.append(time.process_time() - begin)
        assert model.servo is not None
        structure, outside = model.servo[0].structure, []
        if structure == kind:
            outside = missed(model, truth)
            chosen, truths = chosen + 1, truths + len(truth)
            held += len(truth) - len(outside)
        print(f"{seed}  {structure}  {times[-1]:.1f} s  {'; '.join(outside)}", flush=True)
    print(
        f"{kind}: chosen {chosen} of {len(seeds)}, held {held} of {truths} truths, "
        f"{np.mean(times):.1f} s of processor time each"
    )


if __name__ == "__main__":
    asked = sys.argv[1:]
    level = next((float(a[6:]) for a in asked if a.startswith("noise=")), NOISE)
    main(
        asked[0], range(*map(int, asked[1].split(":"))), dead_band="dead-band" in asked,
        play="play" in asked, noise=level,
    )  # fmt: skip
