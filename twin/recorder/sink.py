"""Interface of a recorder, whether it writes in this process or in another."""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import Self

import mujoco
import numpy as np
from numpy.typing import NDArray

from analysis import schema

POSE_PERIOD_NS = 20_000_000  # between two poses of the 3D scene: 50 frames a second
DRAIN_NS = 1_000_000_000  # between two writes


class Sink(ABC):
    """Takes rows: fill `row` through `slices`, then `commit`; views of `row` stay valid.

    A context manager whose end completes the recording.

    Attributes
    ----------
    path : of the complete recording
    """

    path: Path
    row: NDArray[np.float64]
    slices: dict[str, slice]

    @abstractmethod
    def commit(self, time_ns: int, wall_ns: int) -> None:
        """Take `row` as the state at `time_ns` of the experiment and `wall_ns` since 1970 [ns]."""

    @abstractmethod
    def commit_pose(self, time_ns: int, data: mujoco.MjData) -> None:
        """Take the body poses of `data` at `time_ns` [ns] if due."""

    @abstractmethod
    def text(self, entity: str, time_ns: int, text: str, level: str) -> None:
        """Add a line to an entity of texts."""

    @abstractmethod
    def attach(self, name: str, values: Mapping[str, object]) -> None:
        """Add what is known at the end, `schema.TIMING` or `schema.FLIGHT`, to the properties."""

    @abstractmethod
    def flush(self) -> Path:
        """Write everything taken so far; return the file of the incomplete recording.

        Raises
        ------
        TwinError : it could not be written
        """

    @abstractmethod
    def close(self) -> None:
        """Write the rest and rename the file to `path`; a second call does nothing.

        Raises
        ------
        TwinError : not everything could be written; the file then keeps the name `<path>.partial`
        """

    @property
    @abstractmethod
    def reached_ns(self) -> int | None:
        """Time of the last row [ns], zero before the first; None once closed."""

    def event(self, time_ns: int, text: str, level: str = "INFO") -> None:
        """Add a line to the events of the run; level INFO, WARN or ERROR."""
        self.text(schema.EVENTS, time_ns, text, level)

    def health(self, time_ns: int, text: str) -> None:
        """Add the health of connection and sensors from `time_ns` [ns] on."""
        self.text(schema.HEALTH, time_ns, text, "INFO")

    def estimator(self, time_ns: int, memory: str) -> None:
        """Add the state of the rig's estimator at `time_ns` [ns], as JSON, for a replay."""
        self.text(schema.ESTIMATOR, time_ns, memory, "INFO")

    def __enter__(self) -> Self:
        """Return itself; it is open from its construction."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Write the rest; record the error that ended the run, if any."""
        interrupted = isinstance(error, KeyboardInterrupt)
        reached = self.reached_ns
        if reached is not None and error is not None:
            level = "WARN" if interrupted else "ERROR"
            self.event(reached, f"run ended early: {one_line(error)}", level)
        self.close()
        if interrupted:
            assert error is not None
            error.add_note(f"{self.path} holds the run up to there")


def one_line(error: BaseException) -> str:
    """Text of an error without line breaks."""
    return " ".join(str(error).split()) or type(error).__name__


def places(signals: Sequence[schema.Signal]) -> dict[str, slice]:
    """Slices of the signals in a row, in the order given."""
    ends = np.cumsum([len(s.components) for s in signals]).tolist()
    return {
        s.name: slice(end - len(s.components), end) for s, end in zip(signals, ends, strict=True)
    }
