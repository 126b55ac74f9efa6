"""Lockstep and wall clock, and the ledger of how late the wall clock's ticks were."""

import gc
import time
from types import TracebackType
from typing import Protocol, Self

import numpy as np
from numpy.typing import NDArray


class Clock(Protocol):
    """Decides when the next tick may begin; a context manager around the loop."""

    def __enter__(self) -> Self:
        """Take this instant as experiment time zero."""

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Give back what the clock took from the process."""

    def wait(self, time_ns: int) -> int:
        """Return when experiment time `time_ns` has come; the lateness [ns]."""


class Lockstep:
    """Simulation time: the next tick may always begin."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        return None

    def wait(self, time_ns: int) -> int:  # noqa: ARG002  the seat's signature
        """Never late."""
        return 0


class Wall:
    """Real time by absolute deadlines, so that lateness never adds up to drift.

    Parameters
    ----------
    spin_ns : length of the busy tail before a deadline [ns]; 150 µs brings the 99th percentile
        of wake-up from about 90 µs to below 1 µs, for that much processor time a tick
    """

    def __init__(self, spin_ns: int = 0) -> None:
        self._spin = spin_ns
        self._origin = 0

    def __enter__(self) -> Self:
        # A collection in mid-loop costs milliseconds; what exists now will live to the end anyway.
        gc.collect()
        gc.freeze()
        gc.disable()
        self._origin = time.monotonic_ns()
        return self

    def __exit__(self, *_: object) -> None:
        gc.enable()
        gc.unfreeze()

    def wait(self, time_ns: int) -> int:
        """Sleep, then spin, until the deadline; return at once when it has passed."""
        deadline = self._origin + time_ns
        remaining = deadline - self._spin - time.monotonic_ns()
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
    """

    def __init__(self, capacity: int = 1 << 18) -> None:
        self._late: NDArray[np.int64] = np.zeros(capacity, np.int64)
        self._count = 0

    def enter(self, late_ns: int) -> None:
        """Note one tick's lateness [ns]."""
        self._late[self._count % self._late.size] = late_ns
        self._count += 1

    def lateness(self) -> NDArray[np.int64]:
        """Copy of the remembered lateness, oldest first, (n,) [ns]."""
        if self._count <= self._late.size:
            return self._late[: self._count].copy()
        return np.roll(self._late, -(self._count % self._late.size))
