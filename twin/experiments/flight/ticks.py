"""The ticks of a flight in compiled code, where nobody in its seats needs Python.

It calls the functions behind the seats in the order of `twin.loop.loop.ticks`, so that the result
is the same to the last bit. What a recording needs of a tick is copied in compiled code too, and
committed in Python once a chunk.
"""

import time
from typing import Final

import mujoco
import numpy as np
from numpy.typing import NDArray

from analysis.compiled import njit
from twin import status
from twin.experiments.flight.flight import ENDS, Flight, Watch, over, watch
from twin.experiments.flight.track import POSITION, Track, Views, keep
from twin.loop.loop import TIME_UP, Outcome
from twin.loop.seats import Pilot, Steering, steer, steering
from twin.physics.native.layout import number
from twin.plant.plant import Plant
from twin.plant.steps.stepping import APART, ON, Native, advance, derive, drive, landed
from twin.recorder.rows import Rows

Array = NDArray[np.float64]
Integers = NDArray[np.int64]
CHUNK = 512  # ticks between two looks at the keyboard
RECORDED = 64  # the same of a recorded flight: those of the last are lost where it is interrupted
POSES: Final = ("xpos", "xquat", "qpos", "site_xpos", "site_xmat")  # of `Sink.commit_pose`


class _Copies:
    """What a recording takes of each tick: values of its row, then poses.

    Attributes
    ----------
    addresses : of all; empty without a recording
    """

    def __init__(self, rows: Rows | None, sources: Integers, data: mujoco.MjData) -> None:
        self._rows, self._arrays = rows, {name: getattr(data, name) for name in POSES}
        self.addresses = sources
        if rows is None:
            return
        arrays = self._arrays.values()
        places = [a.ctypes.data + a.itemsize * np.arange(a.size) for a in arrays]
        self.addresses = np.concatenate([sources, *places])
        self._ends = np.cumsum([len(sources), *(a.size for a in arrays)])[:-1]

    def commit(self, times: range, values: Array) -> None:
        """Give the recording the values (n, k) that were copied in ticks."""
        if self._rows is None or not times:
            return
        row, *poses = np.split(values, self._ends, axis=1)
        frames = {
            name: part.reshape(-1, *array.shape)
            for (name, array), part in zip(self._arrays.items(), poses, strict=True)
        }
        self._rows.take(np.array(times), row, frames)


def compiled_ticks(
    plant: Plant,
    pilot: Pilot,
    flight: Flight,
    track: Track,
    steps: int,
    duration_ns: int,
    rows: Rows | None = None,
) -> Outcome | None:
    """Fly to the end; None where this flight needs the loop in Python.

    Parameters
    ----------
    steps : physics steps between two commands
    rows : of the recording, if any

    Raises
    ------
    DivergenceError : the simulation diverged
    """
    native, pilot_native = plant.native(), pilot.native()
    sources = np.empty(0, np.int64) if rows is None else rows.sources
    if native is None or pilot_native is None or sources is None:
        return None
    if rows is not None:  # others are flown by something with a line of its own
        status.say(lambda: f"running, at {plant.time_ns * 1e-9:.1f} s of the flight")
    copies = _Copies(rows, sources, plant.data)
    chunk = CHUNK if rows is None else RECORDED
    copied, events = np.empty((chunk, copies.addresses.size)), np.zeros(chunk, np.int64)
    ticks, end, tick_ns = 0, 0, steps * plant.dt_ns
    _fly(  # no tick: what compiling takes is no time of the physics
        native, pilot_native, flight.memory, track.views, track.room()[:0], np.empty((0, 3)),
        copies.addresses, copied, events, plant.steps, steps, duration_ns,
    )  # fmt: skip
    while plant.time_ns < duration_ns:
        kept = track.room()[:chunk]
        times = range(plant.time_ns, duration_ns, tick_ns)[: len(kept)]
        planned = pilot.planned(times)
        began = time.thread_time()
        count, plant.steps, code, end = _fly(
            native, pilot_native, flight.memory, track.views, kept[: len(planned)], planned,
            copies.addresses, copied, events, plant.steps, steps, duration_ns,
        )  # fmt: skip
        plant.computing_s += time.thread_time() - began
        track.took(count)
        if rows is not None:
            begin = 0
            for k in np.flatnonzero(events[:count]).tolist():
                copies.commit(times[begin : k + 1], copied[begin : k + 1])
                flight.report(times[k], events[k], kept[k, POSITION])
                begin = k + 1
            copies.commit(times[begin:count], copied[begin:count])
        ticks += count
        plant.judge(code)
        if end:
            break
    if rows is not None:
        status.say("writing the recording")
    return Outcome(ticks, ENDS[end] or TIME_UP)


@njit(nogil=True)
def _fly(
    plant: Native, pilot: Steering, flight: Watch, views: Views, rows: Array, planned: Array,
    addresses: Integers, copied: Array, events: Integers, begun: int, steps: int, duration_ns: int,
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
        if addresses.size:
            steering(pilot.values, pilot.nose[0], pilot.error, pilot.thrust)
            for k in range(addresses.size):
                copied[count, k] = number(addresses[k], 0)
        keep(rows[count], time_ns, views)
        events[count] = watch(time_ns, flight)
        count += 1
        begun, code = advance(plant.steps, plant.fuel, begun, steps)
        if code != ON:
            return count, begun, code, 0
        time_ns = begun * plant.steps.dt_ns
        end = over(time_ns, landed(plant.steps), flight)
        if end:
            return count, begun, ON, end
    return count, begun, ON, 0
