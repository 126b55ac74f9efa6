"""The ticks of a flight in compiled code, where nobody in its seats needs Python.

It calls the functions behind the seats in the order of `twin.loop.loop.ticks`, so that the result
is the same to the last bit.
"""

import time

import numpy as np
from numpy.typing import NDArray

from analysis.compiled import njit
from twin.experiments.flight import ENDS, Flight, Watch, over, watch
from twin.experiments.track import Track, Views, keep
from twin.loop.loop import TIME_UP, Outcome
from twin.loop.seats import Pilot, Steering, steer
from twin.plant.plant import Plant
from twin.plant.stepping import APART, ON, Native, advance, derive, drive, landed

Array = NDArray[np.float64]
CHUNK = 512  # ticks between two looks at the keyboard


def compiled_ticks(
    plant: Plant, pilot: Pilot, flight: Flight, track: Track, steps: int, duration_ns: int
) -> Outcome | None:
    """Fly to the end, without a recording; None where this flight needs the loop in Python.

    Parameters
    ----------
    steps : physics steps between two commands

    Raises
    ------
    DivergenceError : the simulation diverged
    """
    native, steering = plant.native(), pilot.native()
    if native is None or steering is None:
        return None
    ticks, tick_ns = 0, steps * plant.dt_ns
    while plant.time_ns < duration_ns:
        rows = track.room()[:CHUNK]
        planned = pilot.planned(range(plant.time_ns, duration_ns, tick_ns)[: len(rows)])
        began = time.thread_time()
        count, plant.steps, code, end = _fly(
            native, steering, flight.memory, track.views, rows[: len(planned)], planned,
            plant.steps, steps, duration_ns,
        )  # fmt: skip
        plant.computing_s += time.thread_time() - began
        track.took(count)
        ticks += count
        plant.judge(code)
        if end:
            return Outcome(ticks, str(ENDS[end]))
    return Outcome(ticks, TIME_UP)


@njit(nogil=True)
def _fly(
    plant: Native, pilot: Steering, flight: Watch, views: Views, rows: Array, planned: Array,
    begun: int, steps: int, duration_ns: int,
) -> tuple[int, int, int, int]:  # fmt: skip
    """Fly ticks into `rows`; gives their number, steps so far, how it diverged and why it ended."""
    count = 0
    time_ns = begun * plant.steps.dt_ns
    while count < len(rows) and time_ns < duration_ns:
        steer(pilot, time_ns * 1e-9, planned[count])
        x, y = pilot.angle[0]
        views.command[0], views.command[1] = x, y
        drive(plant.drive, x, y)
        if not derive(plant, time_ns * 1e-9):
            return count, begun, APART, 0
        keep(rows[count], time_ns, views)
        watch(time_ns, flight)
        count += 1
        begun, code = advance(plant.steps, plant.fuel, begun, steps)
        if code != ON:
            return count, begun, code, 0
        time_ns = begun * plant.steps.dt_ns
        end = over(time_ns, landed(plant.steps), flight)
        if end:
            return count, begun, ON, end
    return count, begun, ON, 0
