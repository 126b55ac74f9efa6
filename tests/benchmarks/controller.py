"""Cost of an own controller over the built-in attitude loop, and of an environment's step."""

import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from tests.benchmarks.timing import row
from twin.config import Fly
from twin.control import AttitudeController, control_config
from twin.experiments.assembly import make_plant
from twin.experiments.own_controller import OwnController, load
from twin.experiments.programme import setpoint
from twin.loop.loop import Controller
from twin.loop.seats import Pilot, SimulatedGimbal
from twin.plant.compiled import compiled

EXAMPLE = Path(__file__).resolve().parents[2] / "docs" / "examples" / "own_controller.py"
TICKS = 1000  # the vehicle is in the air for that long


def table() -> Iterator[str]:
    """Lines of the table."""
    with compiled():
        plant = make_plant(Fly())
        programme, _ = setpoint(Fly(), plant.model)

        def pilot() -> Pilot:
            loop = AttitudeController(control_config(plant.model))
            return Pilot(plant, loop, programme, 0.004)

        seats = {
            "built-in": pilot(),
            "empty": OwnController(_Empty(), plant, pilot(), 0.004),
            "example": OwnController(load(f"{EXAMPLE}:AttitudeLoop"), plant, pilot(), 0.004),
        }
        gimbal = SimulatedGimbal(plant)
        spent: dict[str, list[int]] = {name: [] for name in seats}
        for _ in range(TICKS):
            plant.advance(4)
            for name, seat in seats.items():
                spent[name].append(_update(seat, plant.time_ns * 1e-9, gimbal))
    median = {name: float(np.median(values)) * 1e-3 for name, values in spent.items()}
    empty, example = (median[name] - median["built-in"] for name in ("empty", "example"))
    yield row("own controller, the seat alone, over the built-in", f"{empty:.1f} µs", "", True)
    claim = "own controller, attitude loop in plain Python, over the built-in"
    yield row(claim, f"{example:.1f} µs", "≤ 40", example <= 40)


class _Empty:
    def update(self, time: float, gimbal: object, vehicle: object) -> tuple[float, float]:
        return 0.0, 0.0


def _update(seat: Controller, now: float, gimbal: SimulatedGimbal) -> int:
    state = gimbal.poll()
    began = time.perf_counter_ns()
    seat.update(now, state)
    return time.perf_counter_ns() - began
