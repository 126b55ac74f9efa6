"""One row a tick: all signals that the parts of a run offer."""

import time
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Protocol, cast, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from analysis.compiled import njit
from hardware.events import Event
from twin.loop.readings import Readings
from twin.physics.native.layout import number
from twin.plant.plant import Plant
from twin.recorder.rig_rows import RigRows
from twin.recorder.sink import Sink

if TYPE_CHECKING:
    from twin.recorder.stream import Recorder

Array = NDArray[np.float64]
Integers = NDArray[np.int64]


@runtime_checkable
class Source(Protocol):
    """A part of a run that offers signals."""

    @property
    def signals(self) -> Mapping[str, Array]:
        """Values by name of `analysis.schema`: arrays that stay in place for the whole run."""


@runtime_checkable
class Derived(Protocol):
    """A source that computes some of its signals on request."""

    def derive(self, time_ns: int) -> None:
        """Compute them from the present state, at `time_ns` of the experiment [ns]."""


@runtime_checkable
class Eventful(Protocol):
    """A part of a run that reports events."""

    @property
    def events(self) -> Sequence[Event]:
        """Those since the last tick."""


class Rows:
    """Gathers the signals of a run; `write` is called once a tick.

    Parameters
    ----------
    plant : the first source; its body poses are recorded too
    sources : further parts with signals, events or both; derived in this order, None is skipped
    readings : of a rig, recorded at the time stamps of its frames

    Attributes
    ----------
    signals : names of all that is gathered, for the recorder
    command : (2,) latest commanded gimbal angle, written by the loop [rad]
    """

    def __init__(
        self, plant: Plant, *sources: Source | Eventful | None, readings: Readings | None = None
    ) -> None:
        self._plant = plant
        self._rig = None if readings is None else RigRows(readings)
        self.command: Array = np.zeros(2)
        given: list[object] = [plant, *sources]
        self._derive = [source.derive for source in given if isinstance(source, Derived)]
        self._eventful = [source for source in given if isinstance(source, Eventful)]
        self._views: dict[str, Array] = {"gimbal/command": self.command}
        for source in given:
            if isinstance(source, Source):
                self._views |= source.signals
        self.signals = tuple(self._views) + (self._rig.signals if self._rig else ())
        self._wall_ns = 0
        self._recorder: Sink | None = None
        self._places: Integers = np.empty(0, np.int64)
        self._addresses: Integers = np.empty(0, np.int64)

    def bind(self, recorder: Sink) -> None:
        """Pair the address of every value with its place in the row, so that a tick only copies.

        Sources and row stay in place for the whole run: MuJoCo's arrays and the recorder's row by
        design, the others by the contract of `Source`.
        """
        self._recorder = recorder
        pairs = [
            (place, view.ctypes.data + k * view.itemsize)
            for name, view in self._views.items()
            for k, place in enumerate(range(*recorder.slices[name].indices(recorder.row.size)))
        ]
        self._places, self._addresses = np.array(pairs, np.int64).T.copy()
        _copy(recorder.row.copy(), self._places, self._addresses)  # compile before the first tick
        self._wall_ns = time.time_ns()
        if self._rig is not None:
            self._rig.bind(recorder)

    @property
    def sources(self) -> Integers | None:
        """Addresses of the values of a row, for compiled code; None where a row is more than them.

        `take` commits what was copied from them.
        """
        return None if self._rig or self._eventful else self._addresses

    def take(self, time: Integers, values: Array, frames: Mapping[str, Array]) -> None:
        """Commit rows of values (n, k) copied from `sources`, and the poses of their times [ns].

        In lockstep only.
        """
        recorder = cast("Recorder", self._recorder)
        rows = np.tile(recorder.row, (len(time), 1))
        rows[:, self._places] = values
        recorder.commit_all(time, self._wall_ns + time, rows, frames)

    def derive(self, time_ns: int) -> None:
        """Compute the signals that are derived rather than read."""
        for derive in self._derive:
            derive(time_ns)

    def write(self, time_ns: int) -> None:
        """Fill and commit one row; allocates nothing."""
        for derive in self._derive:
            derive(time_ns)
        recorder = self._recorder
        if recorder is None:
            return
        if self._rig is not None:
            self._rig.write(time_ns, self._wall_ns)
        for source in self._eventful:
            for event in source.events:
                recorder.event(time_ns, event.text, event.level)
        _copy(recorder.row, self._places, self._addresses)
        recorder.commit(time_ns, self._wall_ns + time_ns)
        recorder.commit_pose(time_ns, self._plant.data)


@njit()
def _copy(row: Array, places: Integers, addresses: Integers) -> None:
    for k in range(places.size):
        row[places[k]] = number(addresses[k], 0)
