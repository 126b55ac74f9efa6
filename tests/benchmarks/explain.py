"""Is the one effect in which a rig differs from its model given the difference?

python -m tests.benchmarks.explain [SEEDS [FIRST SEED]]

Rigs as in tests.benchmarks.drift, with one effect changed, under 20 s of ordinary motion.
"""

import sys
import time
from collections.abc import Iterator

import numpy as np

from tests.benchmarks.drift import PERIOD, commands, made, sensed
from twin.evaluation.explain import RunExplanation, explain
from twin.evaluation.motions import lagging
from twin.hil.resimulation import Resimulation, Variant
from twin.plant.compiled import compiled

FRICTION = {f"gimbal_servo_{a}.frictionloss": 0.012 for a in "xy"}
EFFECTS = {
    "backlash": Variant({"gimbal_backlash": 0.0087 + np.radians(0.5)}),
    "dead band": Variant({"gimbal_servo_dead_band": 0.0132}),
    "friction": Variant(FRICTION),
    "servo gain": Variant({"gimbal_servo_gain": 1.08}),
    "slew limit": Variant({"gimbal_servo_slew": 5.0}),
    "wait for the pulse frame": Variant(at_once=True),
    "load": Variant({"gimbal_motor.mass": 0.25}),
    "delay": Variant(late=0.010),
    "calibration error": Variant(shaft=np.radians(1.0)),
}


def explained(angles: np.ndarray, motion: np.ndarray, seed: int) -> RunExplanation:
    """Shares of a run whose gimbal moved like this."""
    measured = np.column_stack([sensed(m, 2 * seed + k) for k, m in enumerate(motion.T)])
    return explain(made(angles, measured))


def shares(seed: int) -> dict[str, float]:
    """By changed effect the smaller share that it gets of the two axes."""
    angles = commands(seed, 20.0)
    with compiled():
        motions = Resimulation(made(angles)).motions([Variant(), *EFFECTS.values()])
    rigs = dict(zip(EFFECTS, motions[1:], strict=True))
    rigs["sensor lag"] = lagging(motions[0], 0.008, PERIOD)
    found = {}
    for name, motion in rigs.items():
        axes = explained(angles, motion, seed).axes
        found[name] = min(sum(s.share for s in a.shares if s.effect == name) for a in axes)
    return found


def table(seeds: int = 5, first: int = 0) -> Iterator[str]:
    """A line for each effect."""
    began = time.process_time()
    results = [shares(seed) for seed in range(first, first + seeds)]
    for name in results[0]:
        low, middle = np.quantile([r[name] for r in results], (0.0, 0.5))
        yield f"{name:<25} share {100 * low:.0f} % at least, {100 * middle:.0f} % in the median"
    spent = (time.process_time() - began) / seeds / len(results[0])
    yield f"{spent:.1f} s of processor time for one explanation"


if __name__ == "__main__":
    for text in table(*map(int, sys.argv[1:3])):
        print(text, flush=True)
