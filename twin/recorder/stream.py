"""The recorder: preallocated rows in, columns into one file once a simulated second."""

import ctypes
import hashlib
import json
import os
import socket
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import IO

import mujoco
import numpy as np
import rerun as rr
from numpy.typing import NDArray

from analysis import schema
from analysis.recording import rrd
from analysis.recording.lock import claim
from twin.errors import TwinError
from twin.recorder import blueprint, columns
from twin.recorder.poses import Poses
from twin.recorder.sink import DRAIN_NS, POSE_PERIOD_NS, Sink, one_line, places
from twin.viewer.opening import LOOPBACK

THRUST = "vehicle/thrust"
FLUSH_SECONDS = 60.0  # a slow disk needs a few; Rerun itself waits without end


Stamps = NDArray[np.int64]


class RecorderError(TwinError):
    """A recording that cannot be written, told in one line."""


class Recorder(Sink):
    """Writes a run into one Rerun file: `<path>.partial` while it runs, `<path>` once closed.

    Fill `row` through `slices`, then `commit`. The row stays in place, so views of it may be kept;
    a value left alone keeps its last content, NaN at first.

    Parameters
    ----------
    path : file to write, ending in `.rrd`
    signals : names of `analysis.schema.SIGNALS` to record
    properties : what describes the run; anything `json` can write. Equal properties give equal
        recording ids, so a run on the wall clock should carry its date.
    model : model whose bodies are drawn; None leaves the 3D scene out
    pose_period_ns : experiment time between two drawn poses [ns]
    capacity : rows kept at most before they are written
    drain_ns : experiment time between two writes [ns]; what a killed process loses at most.
        Shorter costs size: every write of a signal takes about 1.5 kB besides its values.
    serve : port on the loopback interface where a viewer may watch, besides the file

    Raises
    ------
    RecorderError
        if a signal is unknown, the properties are not JSON, the file cannot be written, or the
        port is taken; nothing has run then.
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
        text = _json(properties)
        if serve is not None:
            _free(serve)
        self._mark = _claim(self.path, self._partial)
        self._layout(capacity, drain_ns)
        self._poses = None if model is None else Poses(model, pose_period_ns)
        self._texts: list[tuple[str, int, str, str]] = []
        self._last_wall = 0
        self._reached = 0
        self._open = True
        self._stream = self._start(text, serve)

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

    def _start(self, text: str, serve: int | None) -> rr.RecordingStream:
        digest = hashlib.sha256(text.encode()).hexdigest()[:32]
        # Rerun's own properties carry the time of day, which would spoil the comparison of runs.
        stream = rr.RecordingStream(
            schema.APPLICATION, recording_id=digest, send_properties=False, default_enabled=True
        )
        sinks: list[rr.FileSink | rr.GrpcServerSink] = []
        try:
            sinks.append(rr.FileSink(self._partial))
            if serve is not None:
                sinks.append(rr.GrpcServerSink(LOOPBACK, serve, server_memory_limit="256MiB"))
            names = [s.name for s in self._signals]
            look = blueprint.build(names, self._poses, live=serve is not None)
            stream.set_sinks(*sinks, default_blueprint=look)
        except (RuntimeError, OSError, ValueError) as error:
            self._give_up()
            raise RecorderError(f"cannot record to {self.path}: {one_line(error)}") from None
        stream.send_property(schema.PROPERTY, rr.AnyValues(schema=schema.SCHEMA, json=text))
        for name in names:
            stream.log(schema.SIGNALS[name].entity, blueprint.style(name), static=True)
        if self._poses:
            self._poses.start(stream)
        try:
            # what is static comes first, so a file cut off anywhere still has it
            stream.flush(timeout_sec=FLUSH_SECONDS)
        except RuntimeError as error:
            _abandon(stream)
            self._give_up()
            raise RecorderError(f"cannot record to {self.path}: {one_line(error)}") from None
        return stream

    def commit(self, time_ns: int, wall_ns: int) -> None:
        """Take `row` as the state at `time_ns` of the experiment and `wall_ns` since 1970 [ns].

        Allocates nothing but once a simulated second, when the rows are written.
        """
        n = self._n
        self._block[n] = self.row
        self._time[n] = time_ns
        self._wall[n] = wall_ns
        n += 1
        self._n = n
        if n == self._capacity or time_ns >= self._due:
            self._due = time_ns - time_ns % self._drain_every + self._drain_every
            self.drain()

    def commit_pose(self, time_ns: int, data: mujoco.MjData) -> None:
        """Take the body poses of `data` at `time_ns` [ns] if due; returns at once otherwise."""
        if self._poses is None:
            return
        if self._poses.full:
            self.drain()
        self._poses.add(time_ns, data)

    def text(self, entity: str, time_ns: int, text: str, level: str) -> None:
        """Add a line to an entity of texts."""
        self._texts.append((entity, time_ns, text, level))

    def timing(self, verdict: Mapping[str, object]) -> None:
        """Add the verdict on the run's timing to its properties.

        Raises
        ------
        RecorderError : it is not JSON
        """
        self._stream.send_property(schema.TIMING, rr.AnyValues(json=_json(verdict)))

    def flush(self) -> Path:
        """Write all that was taken so far; where it stands until the recording is complete.

        Raises
        ------
        RecorderError : it could not be written
        """
        self.drain()
        try:
            self._stream.flush(timeout_sec=FLUSH_SECONDS)
        except RuntimeError as error:
            raise self._unfinished(one_line(error)) from None
        return self._partial

    def drain(self) -> None:
        """Write what is kept; called by `commit` in time, so seldom of use elsewhere."""
        n = self._n
        time, wall = self._time[:n], self._wall[:n]
        self._send_poses(time, wall)
        for entity, at, text, level in self._texts:
            stamps = np.array([at], dtype=np.int64)
            when = columns.times(stamps, self._wall_at(stamps, time, wall))
            self._stream.send_columns(entity, when, columns.texts([text], [level]))
        self._texts.clear()
        if n:
            self._send_rows(self._block[:n] * self._scale, time, wall)
            self._reached, self._last_wall = int(time[-1]), int(wall[-1])
        self._n = 0

    def _send_rows(self, stored: NDArray[np.float64], time: Stamps, wall: Stamps) -> None:
        when = columns.times(time, wall)
        for signal in self._signals:
            values, stamps = stored[:, self.slices[signal.name]], when
            # Rows without any measurement are left out: NaN never compares equal to itself, and
            # two equal runs must.
            if (missing := np.isnan(values).all(axis=1)).any():
                there = ~missing
                values, stamps = values[there], columns.times(time[there], wall[there])
            if len(values):
                self._stream.send_columns(signal.entity, stamps, columns.scalars(values))

    def _send_poses(self, time: Stamps, wall: Stamps) -> None:
        if not self._poses or not self._poses.times.size:
            return
        at = self._poses.times
        thrust = np.zeros(len(at))
        if THRUST in self.slices and self._n:
            known = self._block[: self._n, self.slices[THRUST].start]
            rows = np.isfinite(known)  # a sensor frame's row knows nothing of the vehicle
            if rows.any():
                thrust = np.interp(at, time[rows], known[rows])
        self._poses.drain(self._stream, self._wall_at(at, time, wall), thrust)

    def _wall_at(self, at: Stamps, time: Stamps, wall: Stamps) -> Stamps:
        """Time since 1970 of the rows nearest after `at` (k,); the last known one without rows."""
        if not len(time):
            return np.full(len(at), self._last_wall)
        return wall[np.minimum(np.searchsorted(time, at), len(time) - 1)]

    def close(self) -> None:
        """Write the rest and give the file its name; a second call does nothing.

        Raises
        ------
        RecorderError
            if not all could be written; the file then keeps its name `<path>.partial`.
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
            self._stream.flush(timeout_sec=FLUSH_SECONDS)
        except RuntimeError as error:
            _abandon(self._stream)
            raise self._unfinished(one_line(error)) from None
        self._stream.disconnect()  # writes the footer, and keeps quiet if that fails
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


def checked(names: Sequence[str]) -> list[schema.Signal]:
    """The signals of these names, each once.

    Raises
    ------
    RecorderError : there is no such signal, or none was given
    """
    try:
        found = [schema.signal(name) for name in dict.fromkeys(names)]
    except schema.AnalysisError as error:
        raise RecorderError(str(error)) from None
    if not found:
        raise RecorderError("a recording needs at least one signal")
    return found


def _json(properties: Mapping[str, object]) -> str:
    try:
        return json.dumps(dict(properties), sort_keys=True, allow_nan=False)
    except (TypeError, ValueError) as error:
        raise RecorderError(f"properties of a run must be JSON: {error}") from None


def _claim(path: Path, partial: Path) -> IO[bytes]:
    """Fail before anything runs if the file cannot be written; mark it as being written."""
    if path.suffix != ".rrd":
        raise RecorderError(f"a recording's name ends in .rrd, not '{path.name}'")
    if path.is_dir():
        raise RecorderError(f"cannot record to {path}: it is a folder")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        mark = claim(partial)
        if os.name != "posix":  # an open file could not be renamed there
            mark.close()
    except BlockingIOError:
        raise RecorderError(
            f"{path} is being written by another run; give this one --out"
        ) from None
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise RecorderError(f"cannot record to {path}: {reason}") from None
    return mark


def _free(port: int) -> None:
    """Fail early if the port is taken: Rerun would only log it, and then lose the file's end."""
    try:
        with socket.socket() as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            probe.bind((LOOPBACK, port))
    except (OSError, OverflowError) as error:
        raise RecorderError(f"cannot serve a viewer on port {port}: {error}") from None


def _abandon(stream: rr.RecordingStream) -> None:
    """Let go of a stream whose file cannot be written, without ever waiting for it again.

    Rerun 0.41 waits without end for its dead writer when such a stream is disconnected, deleted
    or cleaned up at exit, so it is kept from all three.
    """
    for held in (stream, stream.to_native()):
        ctypes.pythonapi.Py_IncRef(ctypes.py_object(held))
    rr.unregister_shutdown()
