"""Ten simulated minutes of the bench in a process of its own: its memory at every minute.

Prints one number a minute [bytes], on standard output.
"""

import sys
from pathlib import Path

import numpy as np
import psutil

from twin.experiments.provenance import DRAIN_LOCKSTEP_NS
from twin.loop.clock import Lockstep
from twin.loop.loop import Seats, run
from twin.loop.seats import Sequence, SimulatedGimbal
from twin.physics import native
from twin.plant.model import ModelConfig, load
from twin.plant.plant import Plant
from twin.recorder import Recorder
from twin.recorder.rows import Rows

MINUTE_NS = 60_000_000_000


def main(path: Path, minutes: int) -> None:
    """Step the gimbal back and forth, recorded at 250 Hz."""
    times: np.ndarray = np.arange(0.0, 60.0 * minutes, 0.5)
    angles = np.where(np.arange(times.size)[:, None] % 2, 0.08, -0.08) * np.ones((1, 2))
    process = psutil.Process()
    with native.installed():
        plant = Plant(load(ModelConfig(scene="bench")))
        rows = Rows(plant)

        def tell(time_ns: int) -> None:
            if time_ns % MINUTE_NS == 0:
                print(process.memory_info().rss, flush=True)

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


if __name__ == "__main__":
    main(Path(sys.argv[1]), int(sys.argv[2]))
