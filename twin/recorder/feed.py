"""Rows, poses and texts on their way to one Rerun stream, written as columns at intervals."""

from collections.abc import Mapping, Sequence

import mujoco
import numpy as np
import rerun as rr
from numpy.typing import NDArray

from analysis import schema
from twin.recorder import columns
from twin.recorder.later import Later
from twin.recorder.layout.held import THRUST, in_force, since_1970
from twin.recorder.layout.look import Look
from twin.recorder.scene.poses import Poses
from twin.recorder.sink import one_line

FLUSH_SECONDS = 60.0  # a slow disk needs a few; without it Rerun waits for ever
# Rerun keeps 2 to 5 kB for each write of an entity until the file is closed, for the index at its
# end. So writes of a file grow with the run, up to what a killed process may lose.
PART = 25  # of the run: a write of a file is no shorter than that
LONGEST_NS = 20_000_000_000  # nor need it be longer than this
SCENE_PART, SCENE_NS = 8, 60_000_000_000  # likewise of what is for the viewer only

Floats = NDArray[np.float64]
Stamps = NDArray[np.int64]


class Feed:
    """Keeps what is recorded and writes it to a stream when due.

    Parameters
    ----------
    signals : to record
    slices : their places in a row
    model : model of the 3D scene; None has none
    pose_period_ns : experiment time between two poses of the scene [ns]
    capacity : largest number of rows before they are written
    drain_ns : experiment time between two writes [ns]
    live : whether the stream is a viewer's, which keeps its first layout; in a file, a write also
        has at least 4 % of the time until then, or 20 s where that is less

    Attributes
    ----------
    stream : Rerun's stream, from `begin` on
    failed : what kept it from being written; "" if nothing did
    time_ns : time of the last row [ns], zero before the first
    """

    stream: rr.RecordingStream

    def __init__(
        self,
        signals: Sequence[schema.Signal],
        slices: Mapping[str, slice],
        model: mujoco.MjModel | None,
        *,
        pose_period_ns: int,
        capacity: int,
        drain_ns: int,
        live: bool,
    ) -> None:
        self._signals, self._slices = signals, slices
        self._scale = np.array([s.scale for s in signals for _ in s.components])
        self._block = np.zeros((capacity, len(self._scale)))
        self._time = np.zeros(capacity, dtype=np.int64)
        self._wall = np.zeros(capacity, dtype=np.int64)
        self._n = 0
        self._capacity = capacity
        self._drain_every = drain_ns
        self._due = drain_ns
        self._poses = None if model is None else Poses(model, pose_period_ns)
        self.look = Look([s.name for s in signals], self._poses, model, live=live)
        self._live = live
        self._texts: list[tuple[str, int, str, str]] = []
        self._last_wall = 0
        self._reached = 0
        self._sent = 0  # time until which the scene is written
        self.failed = ""

    def begin(self, stream: rr.RecordingStream) -> None:
        """Write to this stream from now on, at first what does not change.

        Raises
        ------
        RuntimeError : it cannot be written
        """
        self.stream = stream
        self._later = Later(stream)
        self.look.start(stream)
        if self._poses:
            self._poses.start(stream)
        # static data comes first, so that a truncated file has it
        stream.flush(timeout_sec=FLUSH_SECONDS)

    def commit(self, row: Floats, time_ns: int, wall_ns: int) -> None:
        """Take a row; allocates nothing, except when rows are written."""
        n = self._n
        self._block[n] = row
        self._time[n] = time_ns
        self._wall[n] = wall_ns
        self._n = n + 1
        self._drain_if_due(time_ns)

    def _drain_if_due(self, time_ns: int) -> None:
        if self._n == self._capacity or time_ns >= self._due:
            every = self._drain_every
            due = time_ns - time_ns % every + every
            share = min(time_ns // PART, LONGEST_NS)
            self._due = due if self._live else max(due, time_ns + share)
            self.drain()

    def commit_all(
        self, time: Stamps, wall: Stamps, rows: Floats, frames: Mapping[str, Floats]
    ) -> None:
        """What `commit` and `commit_pose` do with many ticks, one after the other.

        Parameters
        ----------
        time, wall : ascending times (n,) [ns]
        rows : one at each of them (n, k)
        frames : arrays of `MjData` at them, by name
        """
        begin = 0
        while begin < len(time):
            fit = min(len(time) - begin, self._capacity - self._n)
            if self._poses is not None:
                fit = min(fit, max(1, self._poses.room))
            before = int(np.searchsorted(time[begin : begin + fit], self._due))
            end = begin + min(before + 1, fit)  # the last one may be due
            place = slice(self._n, self._n + end - begin)
            self._block[place] = rows[begin:end]
            self._time[place], self._wall[place] = time[begin:end], wall[begin:end]
            self._n = place.stop
            self._take_poses(time, frames, begin, end - 1)
            self._drain_if_due(int(time[end - 1]))
            self._take_poses(time, frames, end - 1, end)
            begin = end

    def _take_poses(self, time: Stamps, frames: Mapping[str, Floats], begin: int, end: int) -> None:
        if self._poses is None or begin == end:
            return
        if self._poses.full:
            self.drain()
        ticks = slice(begin, end)
        self._poses.add_all(time[ticks], {name: f[ticks] for name, f in frames.items()})

    def commit_pose(self, time_ns: int, data: mujoco.MjData) -> None:
        """Take the body poses of `data` at `time_ns` [ns] if due."""
        if self._poses is None:
            return
        if self._poses.full:
            self.drain()
        self._poses.add(time_ns, data)

    def text(self, entity: str, time_ns: int, text: str, level: str) -> None:
        """Add a line to an entity of texts."""
        self._texts.append((entity, time_ns, text, level))

    def drain(self) -> None:
        """Write the rows and texts kept, and the scene if due; `commit` calls it when due."""
        n = self._n
        time, wall = self._time[:n], self._wall[:n]
        self._send_poses(time, wall)
        for entity, at, text, level in self._texts:
            stamps = np.array([at], dtype=np.int64)
            when = columns.times(stamps, since_1970(stamps, time, wall, self._last_wall))
            self.stream.send_columns(entity, when, columns.texts([text], [level]))
            self.look.text(self.stream, when, (entity, at, text, level))
        self._texts.clear()
        if n:
            self._send_rows(self._block[:n] * self._scale, time, wall)
            self._reached, self._last_wall = int(time[-1]), int(wall[-1])
        rows = {name: self._block[:n, place] for name, place in self._slices.items()}
        self.look.drain(self.stream, self._later, time, wall, rows)
        self._n = 0
        share = min(self._reached // SCENE_PART, SCENE_NS)
        if self._live or self._reached - self._sent >= share:
            self._later.send()
            self._sent = self._reached
        self._flush()

    def _flush(self) -> None:
        try:  # else what a fast run writes waits in memory
            self.stream.flush(timeout_sec=FLUSH_SECONDS)
        except RuntimeError as error:  # `close` reports it
            self.failed = self.failed or one_line(error)

    def _send_rows(self, stored: Floats, time: Stamps, wall: Stamps) -> None:
        when = columns.times(time, wall)
        for signal in self._signals:
            values, stamps = stored[:, self._slices[signal.name]], when
            # Rows without any value are left out: NaN does not compare equal to itself, but equal
            # runs must.
            if (missing := np.isnan(values).all(axis=1)).any():
                there = ~missing
                values, stamps = values[there], columns.times(time[there], wall[there])
            if len(values):
                self.stream.send_columns(signal.entity, stamps, columns.scalars(values))

    def _send_poses(self, time: Stamps, wall: Stamps) -> None:
        if not self._poses or not self._poses.times.size:
            return
        at = self._poses.times
        held = in_force(at, time, self._block, self._slices)
        thrust = held[THRUST][:, 0] if THRUST in held else np.zeros(len(at))
        angles = {name: held[name] for name in self._poses.ghost.signals if name in held}
        stamps = since_1970(at, time, wall, self._last_wall)
        self._poses.drain(self._later, stamps, thrust, angles)

    def drain_all(self) -> None:
        """Write all that is kept."""
        self._sent = -SCENE_NS
        self.drain()

    def finish(self) -> None:
        """Write the rest, and what needs the whole run; `failed` says whether it was written."""
        try:
            self.drain_all()
            if self._poses:
                self._poses.finish(self.stream)
            self.look.finish(self.stream)
            self.stream.flush(timeout_sec=FLUSH_SECONDS)
        except RuntimeError as error:
            self.failed = self.failed or one_line(error)

    @property
    def time_ns(self) -> int:
        """Time of the last row [ns], zero before the first."""
        return int(self._time[self._n - 1]) if self._n else self._reached
