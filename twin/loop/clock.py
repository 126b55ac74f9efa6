"""Lockstep and wall clock, and the ledger of how late the wall clock's ticks were."""

import gc
import time
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from types import TracebackType
from typing import Protocol, Self

import numpy as np
from numpy.typing import NDArray

from twin.loop import realtime
from twin.loop.realtime import Rights

LOOK_NS = 100_000  # between two calls of `meanwhile`


class Clock(Protocol):
    """Decides when the next tick may begin; a context manager around the loop."""

    def __enter__(self) -> Self:
        """Take from the process what the loop needs."""

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Give back what the clock took from the process."""

    def wait(self, time_ns: int, meanwhile: Callable[[], bool] | None = None) -> int:
        """Return when experiment time `time_ns` has come; the lateness [ns].

        Parameters
        ----------
        meanwhile : short; called again and again while there is time and it says true
        """


class Lockstep:
    """Simulation time: the next tick may always begin."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        return None

    def wait(self, time_ns: int, meanwhile: Callable[[], bool] | None = None) -> int:  # noqa: ARG002
        """Never late."""
        return 0


class Wall:
    """Real time by absolute deadlines, so that lateness never adds up to drift.

    The first `wait` is for the first tick, and returns at once: time counts from there.

    Overruns: a tick whose deadline has passed begins at once, and so do those after it until the
    loop has caught up. No tick is skipped and the physics step never changes, so the flight stays
    the one that was asked for; what was lost is its hold on the clock, which is counted.

    Parameters
    ----------
    spin_ns : length of the busy tail before a deadline [ns]; 150 µs brings the 99th percentile
        of wake-up from about 90 µs to below 1 µs, for that much processor time a tick
    privileged : ask for SCHED_FIFO and locked memory; `rights` tells what came of it

    Attributes
    ----------
    overruns : ticks whose deadline passed while the loop was still busy with the one before
    rights : what the system granted, known within the block
    stolen : time that a virtual machine's host withheld meanwhile, known after the block [s]
    """

    def __init__(self, spin_ns: int = 0, *, privileged: bool = True) -> None:
        self._spin = spin_ns
        self._privileged = privileged
        self._origin: int | None = None
        self.overruns = 0
        self.rights = Rights()
        self.stolen = 0.0

    def __enter__(self) -> Self:
        # A collection in mid-loop costs milliseconds; what exists now will live to the end anyway.
        gc.collect()
        gc.freeze()
        gc.disable()
        self._stack = ExitStack()
        if self._privileged:
            self.rights = self._stack.enter_context(realtime.requested())
        self.overruns = 0
        self._origin = None
        self._stolen_before = realtime.stolen()
        return self

    def __exit__(self, *_: object) -> None:
        self.stolen = realtime.stolen() - self._stolen_before
        self._stack.close()
        gc.enable()
        gc.unfreeze()

    def wait(self, time_ns: int, meanwhile: Callable[[], bool] | None = None) -> int:
        """Sleep, then spin, until the deadline; return at once when it has passed."""
        now = time.monotonic_ns()
        if self._origin is None:
            self._origin = now - time_ns
            return 0
        deadline = self._origin + time_ns
        if now > deadline:
            self.overruns += 1
            return now - deadline
        end = deadline - self._spin
        while meanwhile is not None and end - now > 2 * LOOK_NS and meanwhile():
            time.sleep(LOOK_NS * 1e-9)
            now = time.monotonic_ns()
        remaining = end - now
        if remaining > 0:
            time.sleep(remaining * 1e-9)
        now = time.monotonic_ns()
        while now < deadline and self._spin:
            now = time.monotonic_ns()
        return max(0, now - deadline)


class Ledger:
    """Every tick's lateness, in a preallocated array that wraps around.

    Parameters
    ----------
    capacity : ticks remembered

    Attributes
    ----------
    latest : (1,) lateness of the last tick [s]
    signals : the same, by its name in `analysis.schema`
    """

    def __init__(self, capacity: int = 1 << 18) -> None:
        self._late: NDArray[np.int64] = np.zeros(capacity, np.int64)
        self._count = 0
        self.latest: NDArray[np.float64] = np.zeros(1)
        self.signals: Mapping[str, NDArray[np.float64]] = {"timing/lateness": self.latest}

    def enter(self, late_ns: int) -> None:
        """Note one tick's lateness [ns]."""
        self._late[self._count % self._late.size] = late_ns
        self._count += 1
        self.latest[0] = late_ns * 1e-9

    def lateness(self) -> NDArray[np.int64]:
        """Copy of the remembered lateness, oldest first, (n,) [ns]."""
        if self._count <= self._late.size:
            return self._late[: self._count].copy()
        return np.roll(self._late, -(self._count % self._late.size))
