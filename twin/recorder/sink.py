"""What a run needs of a recorder, in whichever process it writes."""

from collections.abc import Sequence
from pathlib import Path
from types import TracebackType
from typing import Protocol, Self

import mujoco
import numpy as np
from numpy.typing import NDArray

from analysis import schema


class Sink(Protocol):
    """Takes rows: fill `row` through `slices`, then `commit`; views of `row` stay valid.

    A context manager: its end completes the recording.
    """

    path: Path
    row: NDArray[np.float64]
    slices: dict[str, slice]

    def commit(self, time_ns: int, wall_ns: int) -> None:
        """Take `row` as the state at `time_ns` of the experiment and `wall_ns` since 1970 [ns]."""

    def commit_pose(self, time_ns: int, data: mujoco.MjData) -> None:
        """Take the body poses of `data` at `time_ns` [ns] if due; returns at once otherwise."""

    def event(self, time_ns: int, text: str, level: str = "INFO") -> None:
        """Add a line to the events of the run; level INFO, WARN or ERROR."""

    def health(self, time_ns: int, text: str) -> None:
        """Add the state of the gimbal's sensors, in words, from `time_ns` [ns] on."""

    def estimator(self, time_ns: int, memory: str) -> None:
        """Add what the rig's estimator remembers at `time_ns` [ns], as JSON, for a replay."""

    def __enter__(self) -> Self:
        """Open since it was made."""

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Write the rest, and say why the run ended where an error ended it."""


def places(signals: Sequence[schema.Signal]) -> dict[str, slice]:
    """Where each signal's components stand in a row, side by side in the order given."""
    ends = np.cumsum([len(s.components) for s in signals]).tolist()
    return {
        s.name: slice(end - len(s.components), end) for s, end in zip(signals, ends, strict=True)
    }
