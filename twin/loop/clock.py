"""Lockstep and wall clock, and the lateness of every tick on the wall clock."""

import gc
import time
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from typing import Protocol, Self

import numpy as np
from numpy.typing import NDArray

from twin.loop import realtime
from twin.loop.realtime import Rights

MEANWHILE_NS = 100_000  # between two calls of `meanwhile`


class Clock(Protocol):
    """Decides when the next tick may begin; a context manager around the loop."""

    def __enter__(self) -> Self:
        """Prepare the process for the loop."""

    def __exit__(self, *_: object) -> None:
        """Restore the process."""

    def wait(self, time_ns: int, meanwhile: Callable[[], bool] | None = None) -> int:
        """Wait until experiment time `time_ns`; return the lateness [ns].

        Parameters
        ----------
        meanwhile : called repeatedly while there is time left and it returns true; must be short
        """


class Lockstep:
    """Simulation time: the next tick begins at once."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        return None

    def wait(self, time_ns: int, meanwhile: Callable[[], bool] | None = None) -> int:  # noqa: ARG002
        """Return at once; never late."""
        return 0


class Wall:
    """Real time by absolute deadlines, so that lateness does not accumulate to drift.

    The first `wait` returns at once and sets the origin of time.

    Overruns: a tick whose deadline has passed begins at once, and so do those after it until the
    loop has caught up. No tick is skipped and the physics step never changes, so the simulated
    motion is unaffected; ticks that began late are counted.

    Parameters
    ----------
    spin_ns : length of the busy wait before a deadline [ns]; 150 µs brings the 99th percentile of
        wake-up from about 90 µs to below 1 µs, at that much processor time a tick
    privileged : request SCHED_FIFO and locked memory; `rights` has the outcome

    Attributes
    ----------
    overruns : ticks whose deadline passed while the loop was busy with the previous tick
    rights : what the system granted; set within the block
    stolen : time withheld by the host of a virtual machine; set after the block [s]
    """

    def __init__(self, spin_ns: int = 0, *, privileged: bool = True) -> None:
        self._spin = spin_ns
        self._privileged = privileged
        self._origin: int | None = None
        self.overruns = 0
        self.rights = Rights()
        self.stolen = 0.0

    def __enter__(self) -> Self:
        # A collection within the loop costs milliseconds; what exists now lives to its end.
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
        while meanwhile is not None and end - now > 2 * MEANWHILE_NS and meanwhile():
            time.sleep(MEANWHILE_NS * 1e-9)
            now = time.monotonic_ns()
        remaining = end - now
        if remaining > 0:
            time.sleep(remaining * 1e-9)
        now = time.monotonic_ns()
        while now < deadline and self._spin:
            now = time.monotonic_ns()
        return max(0, now - deadline)


class Ledger:
    """Lateness of every tick, in a preallocated ring.

    Parameters
    ----------
    capacity : ticks kept

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
        """Add the lateness of one tick [ns]."""
        self._late[self._count % self._late.size] = late_ns
        self._count += 1
        self.latest[0] = late_ns * 1e-9

    def lateness(self) -> NDArray[np.int64]:
        """Copy of the kept lateness, oldest first, (n,) [ns]."""
        if self._count <= self._late.size:
            return self._late[: self._count].copy()
        return np.roll(self._late, -(self._count % self._late.size))
