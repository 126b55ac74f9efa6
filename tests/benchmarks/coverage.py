"""Coverage of 95 % intervals of identified figures.

python -m tests.benchmarks.coverage [SEEDS] [--first SEED] [--only KIND]

Records of every kind whose intervals differ: exact stamps, commands and readings dated up to 0.3 ms
off, noise of an autoregression, a potentiometer quieter than its step, two axes with a coupling
that has a zero, and a single step. Motions are closed forms, not the estimator's.
"""

import argparse
import math
import time
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from analysis.identify import IdentifiedModel, identify
from analysis.recording import Measurement, measurement
from tests.benchmarks.identification import LSB, Gimbal, gimbal, moved, sensed, stamps, step_pair

KINDS = ("exact", "late", "coloured", "quantised", "coupled", "single")
Truth = dict[str, float]


def _steps(rng: np.random.Generator, count: int, hold: float, size: float) -> tuple:
    at = 0.4 + hold * np.arange(count) + rng.uniform(-0.1, 0.1, count)
    u = np.radians(size) * np.where(np.arange(count) % 2, -1.0, 1.0)
    u[-1] = 0.0
    return at, u[:, None]


def _truth(g: Gimbal) -> Truth:
    values = {"gain": g.gain, "delay": g.delay}
    return values | {"natural frequency": g.frequency, "damping": g.damping}


def one_axis(kind: str, seed: int) -> tuple[Measurement, dict[str, Truth]]:
    """A record of one axis and the true parameters of its channel."""
    rng = np.random.default_rng([seed, KINDS.index(kind)])
    g = gimbal(rng)
    t = stamps(rng, 8.0, 0.005)
    at, u = _steps(rng, 11, 0.68, 8.5)
    before = [0.0]
    if kind == "coloured":
        g = Gimbal(rng.uniform(6, 12), rng.uniform(0.6, 1.0), 0.05, 1.0)
        t, at, u = np.arange(0.0, 6.0, 0.01), np.array([0.5, 3.2]), np.radians([[10.0], [0.0]])
    if kind == "single":
        t, at, u = np.arange(0.0, 1.5, 0.005), np.array([0.5]), np.radians([[5.0]])
    angle, rate = moved([g], t, at, u)
    if kind == "coloured":
        noise = np.zeros(len(t))
        drive = math.radians(0.05) * rng.normal(size=len(t))
        for k in range(1, len(t)):
            noise[k] = 0.93 * noise[k - 1] + drive[k]
        r = measurement(t, u, command_time=at, before=before, angle=angle + noise)
    elif kind == "single":
        angle = angle + math.radians(0.05) * rng.normal(size=len(t))
        r = measurement(t, u, command_time=at, before=before, angle=angle)
    elif kind == "quantised":
        angle = np.round((angle + rng.uniform(0.0, LSB)) / LSB) * LSB
        rate = rate + math.radians(0.3) * rng.normal(size=len(t))
        r = measurement(t, u, command_time=at, before=before, angle=angle, rate=rate)
    else:
        angle, rate = sensed(rng, angle, rate)
        dated, read = at, t
        if kind == "late":
            dated = at + rng.uniform(-3e-4, 3e-4, len(at))
            read = t + rng.uniform(-3e-4, 3e-4, len(t))
        r = measurement(read, u, command_time=dated, before=before, angle=angle, rate=rate)
    return r, {"x/x": _truth(g)}


@dataclass(frozen=True)
class Coupling:
    """A second-order channel with one zero: g·(1 − s/zero)·ω²/(s² + 2ζωs + ω²)."""

    gimbal: Gimbal
    zero: float

    def pair(self, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Unit step response and its derivative."""
        g = self.gimbal
        y, v = step_pair(g, t)
        root = np.sqrt(complex(g.damping**2 - 1.0)) * g.frequency
        p, q = -g.damping * g.frequency + root, -g.damping * g.frequency - root
        late = np.clip(t - g.delay, 0.0, None)
        bend = p * q * (p * np.exp(p * late) - q * np.exp(q * late)) / (p - q)
        return y - v / self.zero, v - g.gain * bend.real * (t > g.delay) / self.zero


def two_axes(seed: int) -> tuple[Measurement, dict[str, Truth]]:
    """A record of two axes, one of which follows the other's command through a zero."""
    rng = np.random.default_rng([seed, 5])
    delays = rng.uniform(0.008, 0.03, 2)

    def drawn(delay: float, gain: float) -> Gimbal:
        return Gimbal(rng.uniform(30, 80), rng.uniform(0.4, 0.9), delay, gain)

    own = [drawn(delays[i], rng.uniform(0.9, 1.1)) for i in range(2)]
    i = int(rng.integers(2))
    sign, turn = rng.choice([-1.0, 1.0], 2)
    cross = Coupling(
        drawn(delays[1 - i], sign * rng.uniform(0.05, 0.15)), turn * rng.uniform(40, 120)
    )
    t = stamps(rng, 13.0, 0.005, lost=0.02)
    first, steps = _steps(rng, 9, 0.65, 6.0)
    at = np.concatenate([first, first + 6.5])
    u = np.zeros((18, 2))
    u[:9, 0], u[9:, 1] = steps[:, 0], steps[:, 0]
    angle, rate = np.zeros((len(t), 2)), np.zeros((len(t), 2))
    for k in range(2):
        angle[:, k], rate[:, k] = moved([own[k]], t, at, u[:, [k]])
    for begin, jump in zip(at, np.diff(u[:, 1 - i], prepend=0.0), strict=True):
        y, v = cross.pair(t - begin)
        angle[:, i] += jump * y
        rate[:, i] += jump * v
    angle = angle + math.radians(0.15) * rng.normal(size=angle.shape)
    rate = rate + 0.02 + math.radians(0.4) * rng.normal(size=rate.shape)
    r = measurement(t, u, command_time=at, before=[0.0, 0.0], angle=angle, rate=rate)
    names = ("x", "y")
    true = {f"{n}/{n}": _truth(g) for n, g in zip(names, own, strict=True)}
    true[f"{names[i]}/{names[1 - i]}"] = {**_truth(cross.gimbal), "zero": cross.zero}
    true[f"{names[1 - i]}/{names[i]}"] = {"gain": 0.0}
    return r, true


def scores(model: IdentifiedModel, true: dict[str, Truth]) -> Iterator[tuple[str, float]]:
    """Name and error over deviation of every figure that has a true value and is determined."""
    for e in model.estimates:
        channel, _, figure = e.name.partition(" ")
        if e.determined and figure in true[channel]:
            yield e.name, (e.value - true[channel][figure]) / max(e.std, 1e-300)


def study(kind: str, seeds: range) -> tuple[float, float, float]:
    """Share of true values inside their intervals, rms of the scores, and CPU time of a fit [s]."""
    found: list[float] = []
    began = time.process_time()
    for seed in seeds:
        r, true = two_axes(seed) if kind == "coupled" else one_axis(kind, seed)
        model = identify([r], 2, 1) if kind == "coupled" else identify([r])
        found += [z for _, z in scores(model, true)]
    z = np.array(found)
    took = (time.process_time() - began) / len(seeds)
    return float(np.mean(np.abs(z) < 1.96)), float(np.sqrt(np.mean(z**2))), took


def main() -> None:
    """Print the coverage of every kind."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("seeds", nargs="?", type=int, default=100)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--only", choices=KINDS)
    options = parser.parse_args()
    for kind in KINDS:
        if options.only in (None, kind):
            share, rms, took = study(kind, range(options.first, options.first + options.seeds))
            print(f"{kind:10s} {100 * share:5.1f} %, score rms {rms:.2f}, {took:.2f} s", flush=True)


if __name__ == "__main__":
    main()
