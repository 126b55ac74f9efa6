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
from twin.recorder import lifetime
from twin.recorder.checks import (
    RecorderError,
    checked,
    claimed,
    json_text,
    refuse_taken,
    title,
)
from twin.recorder.feed import Feed, Floats, Stamps
from twin.recorder.layout import blueprint
from twin.recorder.sink import DRAIN_NS, POSE_PERIOD_NS, Sink, one_line, places
from twin.viewer.process import LOOPBACK

# Rows: 21.8 s of a mirror in lockstep, with 1000 ticks and 500 frames a second. Writes shorter than
# the longest of a file would make Rerun's index grow faster.
CAPACITY = 32_768
LIVE_NS = 100_000_000  # between two writes to a live viewer


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
    drain_ns : experiment time between two writes [ns], or 4 % of the time until then, up to 20 s,
        if that is longer; a killed process loses at most that. The scene and what else is for the
        viewer only has 12.5 %, up to 60 s. Each write of an entity takes about 1.5 kB of the file
        besides its values, and 2 to 5 kB of memory until the file is closed.
    serve : port on the loopback interface for a live viewer, besides the file; it gets what is
        recorded every 0.1 s

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
        capacity: int = CAPACITY,
        drain_ns: int = DRAIN_NS,
        serve: int | None = None,
    ) -> None:
        self.path = Path(path)
        self._partial = self.path.with_name(self.path.name + ".partial")
        known = checked(signals)
        text = json_text(properties)
        if serve is not None:
            refuse_taken(serve)
        self.slices = places(known)
        self.row: NDArray[np.float64] = np.full(sum(len(s.components) for s in known), np.nan)

        def feed(every: int, *, live: bool) -> Feed:
            return Feed(
                known, self.slices, model,
                pose_period_ns=pose_period_ns, capacity=capacity, drain_ns=every, live=live,
            )  # fmt: skip

        self._file = feed(drain_ns, live=False)
        self._feeds = [self._file]
        self._mark = claimed(self.path, self._partial, len(known))  # late: killed, it is empty
        self._open = True
        name = title(properties)
        try:
            _begin(self._file, rr.FileSink(self._partial), text, name)
            if serve is not None:
                # A file of writes as short as a viewer's would take 2 GB of memory an hour.
                self._feeds.append(feed(LIVE_NS, live=True))
                sink = rr.GrpcServerSink(LOOPBACK, serve, server_memory_limit="256MiB")
                _begin(self._feeds[-1], sink, text, name)
        except (RuntimeError, OSError, ValueError) as error:
            self._partial.unlink(missing_ok=True)
            self._mark.close()
            raise RecorderError(f"cannot record to {self.path}: {one_line(error)}") from None

    def commit(self, time_ns: int, wall_ns: int) -> None:
        """Take `row` as the state at `time_ns` of the experiment and `wall_ns` since 1970 [ns].

        Allocates nothing, except when rows are written.
        """
        for feed in self._feeds:
            feed.commit(self.row, time_ns, wall_ns)

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
        for feed in self._feeds:
            feed.commit_all(time, wall, rows, frames)

    def commit_pose(self, time_ns: int, data: mujoco.MjData) -> None:
        """Take the body poses of `data` at `time_ns` [ns] if due."""
        for feed in self._feeds:
            feed.commit_pose(time_ns, data)

    def text(self, entity: str, time_ns: int, text: str, level: str) -> None:
        """Add a line to an entity of texts."""
        for feed in self._feeds:
            feed.text(entity, time_ns, text, level)

    def attach(self, name: str, values: Mapping[str, object]) -> None:
        """Add what is known at the end, `schema.TIMING` or `schema.FLIGHT`, to the properties.

        Raises
        ------
        RecorderError : it is not JSON
        """
        for feed in self._feeds:
            feed.stream.send_property(name, rr.AnyValues(json=json_text(values)))

    def flush(self) -> Path:
        """Write everything taken so far; return the file of the incomplete recording.

        Raises
        ------
        RecorderError : it could not be written
        """
        self.drain()
        if self._file.failed:
            raise self._unfinished(self._file.failed)
        return self._partial

    def drain(self) -> None:
        """Write the rows, poses and texts kept; `commit` calls it when due."""
        for feed in self._feeds:
            feed.drain_all()

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
        for feed in self._feeds:
            feed.finish()
        if self._file.failed:
            for feed in self._feeds:
                lifetime.abandon(feed.stream)
            raise self._unfinished(self._file.failed)
        while self._feeds:
            feed = self._feeds.pop()
            feed.stream.disconnect()  # writes the footer; reports no failure
            del feed.stream
        lifetime.release()
        try:
            if not rrd.complete(self._partial):
                raise self._unfinished("its end is missing")
            self._partial.replace(self.path)
        except OSError as error:
            raise self._unfinished(error.strerror or str(error)) from None

    def _unfinished(self, reason: str) -> RecorderError:
        return RecorderError(
            f"cannot finish {self.path} ({reason}; is the disk full?): "
            f"`twin view {self._partial}` saves what was written"
        )

    @property
    def reached_ns(self) -> int | None:
        """Time of the last row [ns], zero before the first; None once closed."""
        return self._file.time_ns if self._open else None


def _begin(feed: Feed, sink: rr.FileSink | rr.GrpcServerSink, text: str, name: str) -> None:
    """Open a stream to this sink, with the run's properties as JSON and its name in the viewer."""
    digest = hashlib.sha256(text.encode()).hexdigest()[:32]
    # Rerun's own properties have the time of day, by which equal runs would differ.
    stream = rr.RecordingStream(
        schema.APPLICATION, recording_id=digest, send_properties=False, default_enabled=True
    )
    content = feed.look.content
    lifetime.begin(stream, [sink], blueprint.build(content, brief=not content.live))
    stream.send_recording_name(name)
    stream.send_property(schema.PROPERTY, rr.AnyValues(schema=schema.SCHEMA, json=text))
    try:
        feed.begin(stream)
    except RuntimeError:
        lifetime.abandon(stream)
        raise
