"""The recorder: takes preallocated rows and writes columns to one file at intervals."""

import hashlib
from collections.abc import Mapping, Sequence
from pathlib import Path

import mujoco
import numpy as np
import rerun as rr
from numpy.typing import NDArray

from analysis import schema
from analysis.recording import rrd
from twin.recorder import columns, lifetime
from twin.recorder.checks import (
    RecorderError,
    checked,
    claimed,
    json_text,
    refuse_taken,
    title,
)
from twin.recorder.layout import blueprint
from twin.recorder.layout.held import THRUST, in_force, since_1970
from twin.recorder.layout.look import Look
from twin.recorder.scene.poses import Poses
from twin.recorder.sink import DRAIN_NS, POSE_PERIOD_NS, Sink, one_line, places
from twin.viewer.process import LOOPBACK

FLUSH_SECONDS = 60.0  # a slow disk needs a few; without it Rerun waits for ever


Floats = NDArray[np.float64]
Stamps = NDArray[np.int64]


class Recorder(Sink):
    """Writes a run into one Rerun file: `<path>.partial` while it runs, `<path>` once closed.

    Fill `row` through `slices`, then `commit`. The row stays in place, so views of it stay valid;
    values that are not written keep their last content, NaN at first.

    Parameters
    ----------
    path : file to write, ending in `.rrd`
    signals : names of `analysis.schema.SIGNALS` to record
    properties : JSON values that describe the run. Equal properties give equal recording ids, so a
        run on the wall clock should have its date.
    model : model of the 3D scene; None records none
    pose_period_ns : experiment time between two poses of the scene [ns]
    capacity : largest number of rows before they are written
    drain_ns : experiment time between two writes [ns], which a killed process loses at most; each
        write of a signal takes about 1.5 kB besides its values
    serve : port on the loopback interface for a live viewer, besides the file

    Raises
    ------
    RecorderError : a signal is unknown, the properties are not JSON values, the file cannot be
        written, or the port is in use
    """

    def __init__(
        self,
        path: Path,
        *,
        signals: Sequence[str],
        properties: Mapping[str, object],
        model: mujoco.MjModel | None = None,
        pose_period_ns: int = POSE_PERIOD_NS,
        capacity: int = 4096,
        drain_ns: int = DRAIN_NS,
        serve: int | None = None,
    ) -> None:
        self.path = Path(path)
        self._partial = self.path.with_name(self.path.name + ".partial")
        self._signals = checked(signals)
        text = json_text(properties)
        if serve is not None:
            refuse_taken(serve)
        self._layout(capacity, drain_ns)
        self._poses = None if model is None else Poses(model, pose_period_ns)
        names = [s.name for s in self._signals]
        self._look = Look(names, self._poses, model, live=serve is not None)
        self._mark = claimed(self.path, self._partial, len(names))  # late: killed, it is empty
        self._texts: list[tuple[str, int, str, str]] = []
        self._last_wall = 0
        self._reached = 0
        self._open = True
        self._failed = ""
        self._stream = self._start(text, serve, title(properties))

    def _layout(self, capacity: int, drain_ns: int) -> None:
        width = sum(len(s.components) for s in self._signals)
        self.slices = places(self._signals)
        self._scale = np.array([s.scale for s in self._signals for _ in s.components])
        self._block = np.zeros((capacity, width))
        self._time = np.zeros(capacity, dtype=np.int64)
        self._wall = np.zeros(capacity, dtype=np.int64)
        self._n = 0
        self._capacity = capacity
        self._drain_every = drain_ns
        self._due = drain_ns
        self.row: NDArray[np.float64] = np.full(width, np.nan)

    def _start(self, text: str, serve: int | None, name: str) -> rr.RecordingStream:
        digest = hashlib.sha256(text.encode()).hexdigest()[:32]
        # Rerun's own properties have the time of day, by which equal runs would differ.
        stream = rr.RecordingStream(
            schema.APPLICATION, recording_id=digest, send_properties=False, default_enabled=True
        )
        sinks: lifetime.Sinks = []
        try:
            sinks.append(rr.FileSink(self._partial))
            if serve is not None:
                sinks.append(rr.GrpcServerSink(LOOPBACK, serve, server_memory_limit="256MiB"))
            first = blueprint.build(self._look.content, brief=serve is None)
            lifetime.begin(stream, sinks, first)
        except (RuntimeError, OSError, ValueError) as error:
            self._give_up()
            raise RecorderError(f"cannot record to {self.path}: {one_line(error)}") from None
        stream.send_recording_name(name)
        stream.send_property(schema.PROPERTY, rr.AnyValues(schema=schema.SCHEMA, json=text))
        self._look.start(stream)
        if self._poses:
            self._poses.start(stream)
        try:
            # static data comes first, so that a truncated file has it
            stream.flush(timeout_sec=FLUSH_SECONDS)
        except RuntimeError as error:
            lifetime.abandon(stream)
            self._give_up()
            raise RecorderError(f"cannot record to {self.path}: {one_line(error)}") from None
        return stream

    def commit(self, time_ns: int, wall_ns: int) -> None:
        """Take `row` as the state at `time_ns` of the experiment and `wall_ns` since 1970 [ns].

        Allocates nothing, except when rows are written.
        """
        n = self._n
        self._block[n] = self.row
        self._time[n] = time_ns
        self._wall[n] = wall_ns
        self._n = n + 1
        self._drain_if_due(time_ns)

    def _drain_if_due(self, time_ns: int) -> None:
        if self._n == self._capacity or time_ns >= self._due:
            self._due = time_ns - time_ns % self._drain_every + self._drain_every
            self.drain()

    def commit_all(
        self, time: Stamps, wall: Stamps, rows: Floats, frames: Mapping[str, Floats]
    ) -> None:
        """What `commit` and `commit_pose` do with many ticks, one after the other.

        Parameters
        ----------
        time, wall : ascending times (n,) [ns]
        rows : what `row` would hold at them (n, k)
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

    def attach(self, name: str, values: Mapping[str, object]) -> None:
        """Add what is known at the end, `schema.TIMING` or `schema.FLIGHT`, to the properties.

        Raises
        ------
        RecorderError : it is not JSON
        """
        self._stream.send_property(name, rr.AnyValues(json=json_text(values)))

    def flush(self) -> Path:
        """Write everything taken so far; return the file of the incomplete recording.

        Raises
        ------
        RecorderError : it could not be written
        """
        self.drain()
        if self._failed:
            raise self._unfinished(self._failed)
        return self._partial

    def drain(self) -> None:
        """Write the rows, poses and texts kept; `commit` calls it when due."""
        n = self._n
        time, wall = self._time[:n], self._wall[:n]
        self._send_poses(time, wall)
        for entity, at, text, level in self._texts:
            stamps = np.array([at], dtype=np.int64)
            when = columns.times(stamps, since_1970(stamps, time, wall, self._last_wall))
            self._stream.send_columns(entity, when, columns.texts([text], [level]))
            self._look.text(self._stream, when, (entity, at, text, level))
        self._texts.clear()
        if n:
            self._send_rows(self._block[:n] * self._scale, time, wall)
            self._reached, self._last_wall = int(time[-1]), int(wall[-1])
        rows = {name: self._block[:n, place] for name, place in self.slices.items()}
        self._look.drain(self._stream, time, wall, rows)
        self._n = 0
        try:  # else what a fast run writes waits in memory
            self._stream.flush(timeout_sec=FLUSH_SECONDS)
        except RuntimeError as error:  # `close` reports it
            self._failed = self._failed or one_line(error)

    def _send_rows(self, stored: NDArray[np.float64], time: Stamps, wall: Stamps) -> None:
        when = columns.times(time, wall)
        for signal in self._signals:
            values, stamps = stored[:, self.slices[signal.name]], when
            # Rows without any value are left out: NaN does not compare equal to itself, but equal
            # runs must.
            if (missing := np.isnan(values).all(axis=1)).any():
                there = ~missing
                values, stamps = values[there], columns.times(time[there], wall[there])
            if len(values):
                self._stream.send_columns(signal.entity, stamps, columns.scalars(values))

    def _send_poses(self, time: Stamps, wall: Stamps) -> None:
        if not self._poses or not self._poses.times.size:
            return
        at = self._poses.times
        held = in_force(at, time, self._block, self.slices)
        thrust = held[THRUST][:, 0] if THRUST in held else np.zeros(len(at))
        angles = {name: held[name] for name in self._poses.ghost.signals if name in held}
        stamps = since_1970(at, time, wall, self._last_wall)
        self._poses.drain(self._stream, stamps, thrust, angles)

    def close(self) -> None:
        """Write the rest and rename the file to `path`; a second call does nothing.

        Raises
        ------
        RecorderError : not everything could be written; the file is then `<path>.partial`
        """
        if not self._open:
            return
        self._open = False
        try:
            self._finish()
        finally:
            self._mark.close()

    def _finish(self) -> None:
        try:
            self.drain()
            if self._poses:
                self._poses.finish(self._stream)
            self._look.finish(self._stream)
            self._stream.flush(timeout_sec=FLUSH_SECONDS)
        except RuntimeError as error:
            self._failed = self._failed or one_line(error)
        if self._failed:
            lifetime.abandon(self._stream)
            raise self._unfinished(self._failed)
        self._stream.disconnect()  # writes the footer; reports no failure
        del self._stream
        lifetime.release()
        try:
            if not rrd.complete(self._partial):
                raise self._unfinished("its end is missing")
            self._partial.replace(self.path)
        except OSError as error:
            raise self._unfinished(error.strerror or str(error)) from None

    def _give_up(self) -> None:
        self._partial.unlink(missing_ok=True)
        self._mark.close()

    def _unfinished(self, reason: str) -> RecorderError:
        return RecorderError(
            f"cannot finish {self.path} ({reason}; is the disk full?): "
            f"`twin view {self._partial}` saves what was written"
        )

    @property
    def reached_ns(self) -> int | None:
        """Time of the last row [ns], zero before the first; None once closed."""
        if not self._open:
            return None
        return int(self._time[self._n - 1]) if self._n else self._reached
