"""`twin identify --linkage` on rigs of known parameters: python -m tests.benchmarks.linkage [RIGS]

Each rig is an emulated one over a bench of other servos and gears, drawn by its number; the fit
sees its recording only. Friction stays as shipped, since a rig's bench takes no other by `--set`;
its search begins a quarter below. About two minutes a rig on two quiet cores.
"""

import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from twin.config import Identify, Step
from twin.evaluation.linkage import identify_linkage
from twin.experiments.step import step

FRICTION = 0.006  # N·m, mjcf/mechanism.xml
START = ("gimbal_servo_x.frictionloss=0.0045", "gimbal_servo_y.frictionloss=0.0045")


def truth(rig: int) -> dict[str, float]:
    """Parameters of a rig, within what units of one kind differ by."""
    rng = np.random.default_rng([rig, 77])
    return {
        "gimbal_servo_motor_constant": float(0.38 * rng.uniform(0.8, 1.2)),
        "gimbal_servo_gain": float(1.8 * rng.uniform(0.7, 1.3)),
        "gimbal_servo_dead_band": float(rng.uniform(2e-3, 8e-3)),
        "gimbal_backlash": float(rng.uniform(5e-3, 15e-3)),
    }


def study(rig: int, folder: Path) -> dict[str, tuple[float, float, float]]:
    """Estimate, deviation and truth by name."""
    values = truth(rig)
    file = folder / f"{rig}.rrd"
    step(
        Step(
            gimbal="emulator", signal="multisine", amplitude_deg=6.0, band_hz=(0.25, 8.0),
            repeats=2, hold_s=0.5, seed=rig, out=file,
            set=tuple(f"{name}={value!r}" for name, value in values.items()),
        )
    )  # fmt: skip
    found = identify_linkage(
        Identify(sources=(file,), linkage=True, set=START, out=folder / f"{rig}.json")
    )
    known = {**values, "friction": FRICTION, "delay": 0.0}
    return {e.name: (e.value, e.std, known[e.name]) for e in found.fit.estimates}


def main() -> int:
    """Print every rig, then how many true values the intervals hold."""
    scores: dict[str, list[float]] = {}
    with tempfile.TemporaryDirectory() as folder:
        for rig in range(int(sys.argv[1]) if len(sys.argv) > 1 else 10):
            began = time.perf_counter()
            for name, (value, std, true) in study(rig, Path(folder)).items():
                z = (value - true) / std
                scores.setdefault(name, []).append(z)
                print(f"{rig:3d} {name:28s} {value:.5f} ± {1.96 * std:.5f}  {true:.5f}  z {z:5.2f}")
            print(f"{rig:3d} took {time.perf_counter() - began:.0f} s", flush=True)
    for name, z in scores.items():
        inside = np.mean(np.abs(z) < 1.96)
        print(f"{name:28s} in {100 * inside:.0f} %, mean z {np.mean(z):.2f}, rms {np.std(z):.2f}")
    every = np.abs(np.concatenate(list(scores.values())))
    print(f"intervals hold {100 * np.mean(every < 1.96):.0f} % of {len(every)} true values")
    return 0


if __name__ == "__main__":
    sys.exit(main())
