"""Long life: memory and threads over a long run, over many runs, and at the end of an hour's file.

python -m tests.benchmarks.long_run FILE.rrd 10     own memory [MB] at every minute of one run
python -m tests.benchmarks.long_run runs 200        threads and memory over runs in one process
python -m tests.benchmarks.long_run hour 60         peak memory while minutes of rows are recorded
"""

import os
import sys
import tempfile
import threading
import time
from pathlib import Path

import mujoco
import numpy as np
import psutil

import twin
from analysis import schema
from tests.abuse.endurance import resident
from twin.experiments.provenance import DRAIN_LOCKSTEP_NS
from twin.loop.clock import Lockstep
from twin.loop.loop import Seats, run
from twin.loop.seats import Sequence, SimulatedGimbal
from twin.physics import native
from twin.plant.model.model import ModelConfig, load
from twin.plant.plant import Plant
from twin.recorder import Recorder
from twin.recorder.rows import Rows

MINUTE_NS = 60_000_000_000
ROW_NS = 2_000_000  # 500 rows a second, as a rig sends them
WARM = 20  # runs after which every cache is filled
MB = 1e6


def bench(path: Path, minutes: int) -> None:
    """Step the gimbal back and forth, recorded at 250 Hz."""
    times: np.ndarray = np.arange(0.0, 60.0 * minutes, 0.5)
    angles = np.where(np.arange(times.size)[:, None] % 2, 0.08, -0.08) * np.ones((1, 2))
    process = os.getpid()
    with native.installed():
        plant = Plant(load(ModelConfig(scene="bench")))
        rows = Rows(plant)

        def tell(time_ns: int) -> None:
            if time_ns % MINUTE_NS == 0:
                print(f"{resident(process)[0][0]:.3f}", flush=True)

        with Recorder(
            path, signals=rows.signals, properties={}, model=plant.model, drain_ns=DRAIN_LOCKSTEP_NS
        ) as recorder:
            rows.bind(recorder)
            run(
                Seats(plant, SimulatedGimbal(plant), Sequence(times, angles), Lockstep()),
                steps_per_tick=4,
                duration_ns=minutes * MINUTE_NS + 1,
                command=rows.command,
                each_tick=(rows.write, tell),
            )


def runs(count: int) -> list[tuple[int, float]]:
    """Threads and memory [MB] after each of many short flights and step tests, all recorded."""
    process, measured = psutil.Process(), []
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        for k in range(count):
            if k % 2:
                twin.step(repeats=1, hold_s=0.2)
            else:
                twin.fly(duration_s=0.5)
            measured.append((process.num_threads(), process.memory_info().rss / MB))
    return measured


def hour(path: Path, minutes: float) -> tuple[float, float]:
    """Largest memory [MB] while rows of every signal and poses are recorded, and at the close."""
    model = load(ModelConfig(scene="bench")).mj
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    with _Peak() as writing:
        recorder = Recorder(
            path, signals=list(schema.SIGNALS), properties={}, model=model,
            drain_ns=DRAIN_LOCKSTEP_NS,
        )  # fmt: skip
        values = np.random.default_rng(0).normal(size=(997, recorder.row.size))
        for k in range(round(minutes * MINUTE_NS / ROW_NS)):
            recorder.row[:] = values[k % len(values)]
            recorder.commit(k * ROW_NS, k * ROW_NS)
            recorder.commit_pose(k * ROW_NS, data)
    with _Peak() as closing:
        recorder.close()
    return writing.most, closing.most


class _Peak:
    """Largest resident memory [MB] within a block."""

    def __enter__(self) -> "_Peak":
        self.most = 0.0
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._watch)
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ended.set()
        self._thread.join()

    def _watch(self) -> None:
        process = psutil.Process()
        while not self._ended.wait(0.01):
            self.most = max(self.most, process.memory_info().rss / MB)


def main() -> None:
    """Print one study."""
    what, count = sys.argv[1], float(sys.argv[2])
    if what == "runs":
        measured = runs(int(count))
        for k in range(0, len(measured), 10):
            print(f"run {k + 1:4d}: {measured[k][0]} threads, {measured[k][1]:.0f} MB")
        threads, memory = zip(*measured[WARM:], strict=True)
        grown = np.mean(memory[-10:]) - np.mean(memory[:10])
        print(f"threads {min(threads)} to {max(threads)}, memory {grown:+.1f} MB in ten runs' mean")
    elif what == "hour":
        with tempfile.TemporaryDirectory() as folder:
            began = time.perf_counter()
            path = Path(folder, "hour.rrd")
            writing, closing = hour(path, count)
            print(f"{count:g} minutes of {len(schema.SIGNALS)} signals at 500 Hz:"
                  f" {path.stat().st_size / MB:.0f} MB in {time.perf_counter() - began:.0f} s;"
                  f" at most {writing:.0f} MB of memory while writing,"
                  f" {closing:.0f} MB at the close")  # fmt: skip
    else:
        bench(Path(what), int(count))


if __name__ == "__main__":
    main()
