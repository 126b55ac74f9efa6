"""Arrays in Rerun's column format; the only module with xyzw quaternions."""

from collections.abc import Iterable, Sequence
from typing import Protocol

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from analysis import schema

Floats = NDArray[np.float64]
Stamps = NDArray[np.int64]


class Columns(Protocol):
    """What takes columns: a Rerun stream, or what sends them to one later."""

    def send_columns(
        self,
        entity_path: str,
        indexes: Iterable[rr.TimeColumn],
        columns: Iterable[rr.ComponentColumn],
    ) -> None:
        """Take rows of an entity."""


def times(time: Stamps, wall: Stamps) -> list[rr.TimeColumn]:
    """Both timelines from integer nanoseconds (n,): experiment time and time since 1970.

    Rerun truncates float seconds to nanoseconds; integers stay exact.
    """
    return [
        rr.TimeColumn(schema.TIME, duration=time.astype("timedelta64[ns]")),
        rr.TimeColumn(schema.WALL_TIME, timestamp=wall.astype("datetime64[ns]")),
    ]


def scalars(values: Floats) -> list[rr.ComponentColumn]:
    """Scalar values (n, k), k to a row."""
    return list(rr.Scalars.columns(scalars=np.ascontiguousarray(values)))


def transforms(position: Floats, attitude: Floats) -> list[rr.ComponentColumn]:
    """Poses from positions (n, 3) [m] and wxyz quaternions (n, 4)."""
    xyzw = np.roll(attitude, -1, axis=1)
    return list(rr.Transform3D.columns(translation=position, quaternion=xyzw))


def translations(position: Floats) -> list[rr.ComponentColumn]:
    """Places (n, 3) [m] without rotation."""
    return list(rr.Transform3D.columns(translation=position))


def segments(starts: Floats, ends: Floats) -> list[rr.ComponentColumn]:
    """One straight line per row, from (n, 3) to (n, 3) [m]."""
    return list(rr.LineStrips3D.columns(strips=np.stack([starts, ends], axis=1)))


def arrows(tails: Floats, vectors: Floats) -> list[rr.ComponentColumn]:
    """One arrow per row, from tails (n, 3) along vectors (n, 3) [m]."""
    return list(rr.Arrows3D.columns(origins=tails, vectors=vectors))


def texts(lines: Sequence[str], levels: Sequence[str]) -> list[rr.ComponentColumn]:
    """One line of text per row with its level (INFO, WARN, ERROR)."""
    return list(rr.TextLog.columns(text=list(lines), level=list(levels)))


def states(names: Sequence[str]) -> list[rr.ComponentColumn]:
    """One state per row; an empty name ends the state before it."""
    return list(rr.StateChange.columns(state=list(names)))


def bands(middle: Floats, half: Floats) -> list[rr.ComponentColumn]:
    """Band of half width `half` (n,) about `middle` (n,), which Rerun has as a variance."""
    return list(rr.Measurements.columns(values=middle, variances=half**2))


def points(places: Floats) -> list[rr.ComponentColumn]:
    """One point of a plane per row, from (n, 2)."""
    return list(rr.Points2D.columns(positions=places))


def ends(count: int) -> list[rr.ComponentColumn]:
    """Rows that end the line of an entity, so that a gap stays one."""
    return list(rr.Clear.columns(is_recursive=[False] * count))
