"""Cost of an own controller over the built-in attitude loop, and of an environment's step."""

import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from tests.benchmarks.timing import Row
from twin.config import Fly
from twin.control import AttitudeController
from twin.experiments.assembly import make_plant
from twin.experiments.flight.fly import fly
from twin.experiments.flight.own_controller import OwnController, load
from twin.experiments.programme import setpoint
from twin.gym import GimbalEnv
from twin.loop.loop import Controller
from twin.loop.seats import Pilot, SimulatedGimbal
from twin.plant.authority import control_config
from twin.plant.compiled import compiled

EXAMPLE = Path(__file__).resolve().parents[2] / "docs" / "examples" / "own_controller.py"
SHORT, LONG = 1.0, 15.0  # s; what a flight costs to set up cancels
TICKS = 1000  # the vehicle is in the air for that long


def table() -> Iterator[Row]:
    """Lines of the table."""
    with compiled():
        plant = make_plant(Fly())
        programme, _ = setpoint(Fly(), plant.model)

        def pilot() -> Pilot:
            loop = AttitudeController(control_config(plant.model))
            return Pilot(plant, loop, programme, 0.004)

        seats = {
            "built-in": pilot(),
            "empty": OwnController(_Empty(), plant.model, pilot(), 0.004),
            "example": OwnController(load(f"{EXAMPLE}:AttitudeLoop"), plant.model, pilot(), 0.004),
        }
        gimbal = SimulatedGimbal(plant)
        spent: dict[str, list[int]] = {name: [] for name in seats}
        steps = round(4_000_000 / plant.dt_ns)
        for _ in range(TICKS):
            plant.advance(steps)
            for name, seat in seats.items():
                spent[name].append(_update(seat, plant.time_ns * 1e-9, gimbal))
    median = {name: float(np.median(values)) * 1e-3 for name, values in spent.items()}
    peer = {"peer": median["built-in"], "note": "the built-in loop"}
    yield Row("own controller that does nothing, an update", median["empty"], "µs", **peer)
    example = median["example"]
    most = median["built-in"] + 40
    yield Row("own controller, attitude loop in plain Python", example, "µs", most=most, **peer)
    yield from _environment()


def _environment() -> Iterator[Row]:
    """Steps of an environment against ticks of `twin.fly`, which also records."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder, "f.rrd")

        def flight(duration: float) -> float:
            out.unlink(missing_ok=True)
            began = time.process_time()
            fly(Fly(gimbal="transfer-function", duration_s=duration, out=out))
            return time.process_time() - began

        def episode() -> float:
            _, info = env.reset()
            began, ended = time.process_time(), False
            while not ended:
                *_, terminated, truncated, info = env.step(info["attitude_loop"])
                ended = terminated or truncated
            return time.process_time() - began

        env = GimbalEnv(duration_s=LONG)
        flight(SHORT), episode()
        ticks = (LONG - SHORT) * 250
        pairs = [(flight(LONG) - flight(SHORT), episode()) for _ in range(7)]
        tick, step = (float(np.median([p[k] for p in pairs])) for k in range(2))
    tick, step = tick / ticks * 1e6, step / (LONG * 250) * 1e6
    claim = "step of twin.gym with observation and reward"
    yield Row(claim, step, "µs", peer=tick, note="recorded tick of twin.fly")


class _Empty:
    def update(self, time: float, gimbal: object, vehicle: object) -> tuple[float, float]:
        return 0.0, 0.0


def _update(seat: Controller, now: float, gimbal: SimulatedGimbal) -> int:
    state = gimbal.poll()
    began = time.perf_counter_ns()
    seat.update(now, state)
    return time.perf_counter_ns() - began
