"""Gain of the gimbal under load: `python -m tests.benchmarks.gimbal_load`, tables of docs/hil.md.

Gimbal angle per commanded angle of ±4° held for 0.25 s, without dead band and backlash: a vehicle
in free flight in a vacuum at constant thrust, and a clamped gimbal under a constant acceleration.
"""

import math

import numpy as np

from hardware.frames import AXES
from twin.physics import native
from twin.plant.model.model import ModelConfig, load
from twin.plant.plant import Plant

ANGLE = math.radians(4.0)
IDEAL = {"gimbal_servo_dead_band": 0.0, "gimbal_backlash": 0.0}


def gain(scene: str, overrides: dict[str, float], axis: int) -> float:
    """Mean of angle over command for three reversals."""
    plant = Plant(load(ModelConfig(scene=scene, overrides=IDEAL | overrides)))
    answers = []
    with native.installed():
        for sign in (1, -1, 1, -1):
            end = plant.time_ns + 250_000_000
            while plant.time_ns < end:
                command = [0.0, 0.0]
                command[axis] = sign * ANGLE
                plant.drive((command[0], command[1]))
                plant.advance(4)
            answers.append(sign * float(plant.gimbal_angle[axis]) / ANGLE)
    return float(np.mean(answers[1:]))


def thrust(newton: float) -> dict[str, float]:
    """A motor of constant thrust that burns already, high above the ground, in a vacuum."""
    time = [0.2 * k for k in range(64)]
    force = [newton if 0 < k < 63 else 0.0 for k in range(64)]
    curve = {f"motor_time[{k}]": t for k, t in enumerate(time)}
    curve |= {f"motor_thrust[{k}]": f for k, f in enumerate(force)}
    start = {"ramp_length": 0.0, "ramp_position[2]": 2000.0, "air_enabled": 0.0}
    impulse = float(np.trapezoid(force, time))
    return curve | start | {"motor_impulse": impulse, "motor_ignition": -1.0}


def main() -> None:
    """Print both tables."""
    print("free flight, thrust [N]   " + "  ".join(f"gain {axis}" for axis in AXES))
    for newton in (0.0, 10.0, 20.0, 40.0):
        row = [gain("flight", thrust(newton), axis) for axis in (0, 1)]
        print(f"{newton:23.0f}   " + "   ".join(f"{g:.3f}" for g in row))
    print("clamped, load [g]         " + "  ".join(f"gain {axis}" for axis in AXES))
    for load_g in (-1.0, 0.0, 1.0, 2.0, 4.0):
        row = [gain("bench", {"gravity[2]": 9.80665 * load_g}, axis) for axis in (0, 1)]
        print(f"{load_g:23.0f}   " + "   ".join(f"{g:.3f}" for g in row))


if __name__ == "__main__":
    main()
