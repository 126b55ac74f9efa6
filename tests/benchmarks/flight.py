"""Cost of the loop, the native forces and the recorder over bare `mj_step`."""

import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import mujoco
import numpy as np

from tests.benchmarks.timing import Row, paired, ratio
from twin.control import AttitudeController, Hold
from twin.experiments.provenance import DRAIN_LOCKSTEP_NS
from twin.loop.clock import Lockstep
from twin.loop.loop import Seats, run
from twin.loop.seats import Pilot, SimulatedGimbal
from twin.physics import native
from twin.plant.authority import control_config, launch_of
from twin.plant.model.model import ModelConfig, load
from twin.plant.plant import Plant
from twin.recorder import Recorder
from twin.recorder.rows import Rows

STEPS_PER_TICK = 4  # 250 Hz at 1 ms
SEGMENT_NS = 100_000_000
STATE = mujoco.mjtState.mjSTATE_INTEGRATION


def table() -> Iterator[Row]:
    """Lines of the table."""
    yield from _forces()
    yield from _loop()


class _Assembly:
    """One whole flight, ready to run again and again from its start."""

    def __init__(self) -> None:
        self.plant = Plant(load(ModelConfig()))
        model = self.plant.model
        launch, _ = launch_of(model)
        self.controller = AttitudeController(control_config(model))
        self.pilot = Pilot(self.plant, self.controller, Hold(launch=launch), 0.004)
        self.gimbal = SimulatedGimbal(self.plant)
        self.rows = Rows(self.plant, self.pilot)
        self.states: list[np.ndarray] = []
        self.fly(each_tick=(self._keep,))

    def fly(self, each_tick: tuple[Callable[[int], None], ...] = ()) -> None:
        """Fly until the ground."""
        self.plant.reset()
        self.controller.reset()
        self.pilot.error = self.controller.error[0]
        run(
            Seats(self.plant, self.gimbal, self.pilot, Lockstep()),
            steps_per_tick=STEPS_PER_TICK,
            duration_ns=round(60e9),
            command=self.rows.command,
            each_tick=each_tick,
            stop=lambda: "ground" if self.plant.data.ncon else None,
        )
        self.steps = self.plant.steps

    def _keep(self, time_ns: int) -> None:
        if time_ns % SEGMENT_NS == 0:
            state = np.empty(mujoco.mj_stateSize(self.plant.model, STATE))
            mujoco.mj_getState(self.plant.model, self.plant.data, state, STATE)
            self.states.append(state)

    def bare(self) -> None:
        """As many steps of the same model through the same states, nothing else."""
        model, data = self.plant.model, self.plant.data
        per = SEGMENT_NS // self.plant.dt_ns
        left = self.steps
        for state in self.states:
            mujoco.mj_setState(model, data, state, STATE)
            mujoco.mj_step(model, data, min(per, left))
            left -= per


def _forces() -> Iterator[Row]:
    model = load(ModelConfig()).mj
    data = mujoco.MjData(model)
    steps = 2000

    def stepped() -> None:
        mujoco.mj_resetData(model, data)
        data.qvel[2] = 60.0
        mujoco.mj_step(model, data, steps)

    def with_native() -> None:
        with native.installed():
            stepped()

    def with_python() -> None:
        mujoco.set_mjcb_passive(lambda m, d: None)
        stepped()
        mujoco.set_mjcb_passive(None)

    taken = paired({"bare": stepped, "native": with_native, "python": with_python})
    bare = float(np.median(taken["bare"])) / steps * 1e6
    added = ratio(taken, "native", "bare") - 1
    python = ratio(taken, "python", "bare") - 1
    yield Row("bare mj_step of the flight model", bare, "µs")
    yield Row(
        "native forces add to a step", 100 * added, "%", most=15, peer=100 * python,
        note="an empty Python callback",
    )  # fmt: skip


def _loop() -> Iterator[Row]:
    with tempfile.TemporaryDirectory() as folder, native.installed():
        flight = _Assembly()

        def recorded() -> None:
            with Recorder(
                Path(folder, "bench.rrd"),
                signals=flight.rows.signals,
                properties={},
                model=flight.plant.model,
                drain_ns=DRAIN_LOCKSTEP_NS,
            ) as recorder:
                flight.rows.bind(recorder)
                flight.fly(each_tick=(flight.rows.write,))

        taken = paired({"bare": flight.bare, "loop": flight.fly, "recorded": recorded}, rounds=9)
        loop, record = ratio(taken, "loop", "bare"), ratio(taken, "recorded", "bare")
        peer = {"peer": 1.0, "note": "bare mj_step"}
        yield Row("linkage flight, time over that of the bare steps", loop, "×", most=1.5, **peer)
        yield Row("the same, recorded", record, "×", most=1.8, **peer)
        tick = _tick(flight, Path(folder, "tick.rrd"))
        yield Row("control tick: read, control, write, append, p50", tick, "µs", most=25)


def _tick(flight: _Assembly, path: Path) -> float:
    """Median of one tick without its physics [µs]."""
    plant, pilot, gimbal, rows = flight.plant, flight.pilot, flight.gimbal, flight.rows
    plant.reset()
    from hardware.frames import GimbalCommand

    spent = []
    with Recorder(path, signals=rows.signals, properties={}, model=plant.model) as recorder:
        rows.bind(recorder)
        for _ in range(1000):
            began = time.perf_counter_ns()
            angle = pilot.update(plant.time_ns * 1e-9, gimbal.poll())
            rows.command[0], rows.command[1] = angle
            gimbal.send(GimbalCommand(plant.time_ns, angle))
            rows.write(plant.time_ns)
            spent.append(time.perf_counter_ns() - began)
            plant.advance(STEPS_PER_TICK)
    return float(np.median(spent)) * 1e-3
