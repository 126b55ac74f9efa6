"""Errors and cost of integrators and steps in whole flights: python -m tests.benchmarks.defaults [SEAT...]

Errors are those against Runge-Kutta at a fine step: of apogee and range at the last instant that both
flights reach, in percent, and of the direction of the nose and of the roll up to then, in degrees.
"""  # noqa: E501

import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from twin.config import Fly
from twin.control import AttitudeController
from twin.experiments.assembly import make_plant, steps_per_tick
from twin.experiments.programme import setpoint
from twin.loop.clock import Lockstep
from twin.loop.loop import Seats, run
from twin.loop.seats import Pilot, SimulatedGimbal
from twin.plant.authority import control_config
from twin.plant.compiled import compiled
from twin.plant.model.compose import MJCF

Array = np.ndarray
EVERY_NS = 200_000_000
LONGEST_NS = 80_000_000_000
METHODS = (
    ("default", None), ("implicitfast", 0.001), ("implicitfast", 0.0005), ("ab2", 0.001),
    ("rk4", 0.002), ("rk4", 0.001),
)  # fmt: skip
EXAMPLES = MJCF / "examples"
SEATS: dict[str, tuple[Fly, float]] = {
    "transfer-function": (Fly(gimbal="transfer-function"), 0.00025),
    "linkage": (Fly(), 0.00025),
    **{
        Path(name).stem: (Fly(vehicle=EXAMPLES / name), 0.001)
        for name in ("large_rocket.toml", "flights/valetudo.toml", "flights/prometheus.toml")
    },
}


def main() -> None:
    """Print one line a seat and method; all seats without arguments."""
    for seat, (config, finest) in SEATS.items():
        if sys.argv[1:] and seat not in sys.argv[1:]:
            continue
        truth, _ = flown(replace(config, integrator="rk4", dt=finest))
        rates = (250.0, 50.0) if config.vehicle else (250.0,)
        for name, dt in METHODS:
            method = None if name == "default" else name
            for rate in rates if name == "default" else (250.0,):
                changed = replace(config, integrator=method, dt=dt, control_hz=rate)
                step = "" if dt is None else f"{dt * 1e3:g} ms"
                error = figures(*flown(changed), truth)
                print(f"{seat:<18}{name:<13}{step:>6}{rate:>4.0f} Hz {error}", flush=True)


def figures(flight: Array, seconds: float, truth: Array) -> str:
    """Errors of one flight, and its processor time."""
    n = min(len(flight), len(truth))
    one, other = flight[:n], truth[:n]
    top, bottom = (q[:, 2].max() for q in (one, other))
    reach, true_reach = (np.hypot(*(q[-1, :2] - q[0, :2])) for q in (one, other))
    nose, true_nose = _nose(one), _nose(other)
    aside = np.degrees(np.arctan2(np.linalg.norm(np.cross(nose, true_nose), axis=1),
                                  (nose * true_nose).sum(axis=1)))  # fmt: skip
    w, z = _turn(one, other)
    roll = np.degrees(np.abs(2.0 * np.arctan2(z * np.sign(w), np.abs(w))))
    return (
        f"apogee {100 * (top / bottom - 1):+.4f} %, range {100 * (reach / true_reach - 1):+.4f} %,"
        f" nose {aside.max():.4f}°, roll {roll.max():.4f}°, {seconds:.2f} s"
    )


def _nose(rows: Array) -> Array:
    w, x, y, z = rows[:, 3:].T
    return np.stack([2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)], axis=1)


def _turn(one: Array, other: Array) -> tuple[Array, Array]:
    """First and last component of the rotation from one attitude to the other."""
    a, b = one[:, 3:], other[:, 3:]
    w = (a * b).sum(axis=1)
    z = b[:, 0] * a[:, 3] - b[:, 3] * a[:, 0] - b[:, 1] * a[:, 2] + b[:, 2] * a[:, 1]
    return w, z


def flown(config: Fly) -> tuple[Array, float]:
    """Position and attitude every 0.2 s to the ground, (n, 7); processor time [s]."""
    rows: list[list[float]] = []
    with compiled():
        plant = make_plant(config)
        programme, _ = setpoint(config, plant.model)
        controller = AttitudeController(control_config(plant.model))
        pilot = Pilot(plant, controller, programme, 1.0 / config.control_hz)

        def keep(time_ns: int) -> None:
            if time_ns % EVERY_NS == 0:
                rows.append([*plant.position, *plant.attitude])

        began = time.process_time()
        run(
            Seats(plant, SimulatedGimbal(plant), pilot, Lockstep()),
            steps_per_tick=steps_per_tick(config.control_hz, plant),
            duration_ns=LONGEST_NS,
            command=np.zeros(2),
            each_tick=(keep,),
            stop=lambda: "ground" if plant.landed else None,
        )
    return np.array(rows), time.process_time() - began


if __name__ == "__main__":
    main()
