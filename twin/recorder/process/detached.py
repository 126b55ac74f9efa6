"""A recorder that writes in a separate process, so that it does not delay a real-time loop."""

import json
import os
import subprocess
import sys
import threading
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import IO, Self

import mujoco
import numpy as np
from numpy.typing import NDArray

from twin.recorder.checks import RecorderError, checked, json_text
from twin.recorder.process import ring
from twin.recorder.sink import DRAIN_NS, POSE_PERIOD_NS, Sink, places

CAPACITY = 16_384  # entries: 20 s of a flight with a rig that sends 500 frames a second
WRITER_TIMEOUT_S = 90.0  # a slow disk takes long to write the rest
ROOT = Path(__file__).resolve().parents[3]


@dataclass(frozen=True)
class Settings:
    """Arguments of `Recorder`, and the ring that its rows come through."""

    path: Path
    signals: tuple[str, ...]
    properties: dict[str, object]
    model: mujoco.MjModel | None
    pose_period_ns: int
    drain_ns: int
    serve: int | None
    ring: ring.Shape

    def write(self, pipe: IO[bytes]) -> None:
        """Write them as one line of JSON, followed by the compiled model.

        Raises
        ------
        RecorderError : the properties are not JSON values
        OSError : the reader is gone
        """
        model = b"" if self.model is None else _binary(self.model)
        values = {f.name: getattr(self, f.name) for f in fields(self)}
        values |= {"path": str(self.path), "ring": asdict(self.ring), "model": len(model)}
        pipe.write(json_text(values).encode() + b"\n" + model)

    @classmethod
    def read(cls, pipe: IO[bytes]) -> Self:
        """Read what `write` has written."""
        values = json.loads(pipe.readline())
        model = pipe.read(values["model"])
        name = "model.mjb"
        return cls(
            **{
                **values,
                "path": Path(values["path"]),
                "signals": tuple(values["signals"]),
                "ring": ring.Shape(**values["ring"]),
                "model": mujoco.MjModel.from_binary_path(name, {name: model}) if model else None,
            }
        )


def _binary(model: mujoco.MjModel) -> bytes:
    """A compiled model in MuJoCo's binary format, for the same version of MuJoCo."""
    buffer = np.empty(mujoco.mj_sizeModel(model), np.uint8)
    mujoco.mj_saveModel(model, None, buffer)
    return buffer.tobytes()


class DetachedRecorder(Sink):
    """As `Recorder`, but a commit only copies a row into shared memory.

    Writing one second of a flight takes 20 ms or more, and a thread would hold the interpreter lock
    meanwhile. The process also outlives the run: when the run is killed, it writes all rows it was
    given and closes the file. It has a separate session, so that signals to the process group of
    the run do not reach it.

    Parameters
    ----------
    path, signals, properties, model, pose_period_ns, drain_ns, serve : as for `Recorder`
    capacity : rows and poses that may wait for a slow disk; further ones are lost, and counted by
        the recording and by `close`

    Raises
    ------
    RecorderError : as `Recorder`
    """

    def __init__(
        self,
        path: Path,
        *,
        signals: Sequence[str],
        properties: Mapping[str, object],
        model: mujoco.MjModel | None = None,
        pose_period_ns: int = POSE_PERIOD_NS,
        drain_ns: int = DRAIN_NS,
        serve: int | None = None,
        capacity: int = CAPACITY,
    ) -> None:
        self.path = Path(path)
        known = checked(signals)
        self.slices = places(known)
        width = sum(len(s.components) for s in known)
        self.row: NDArray[np.float64] = np.full(width, np.nan)
        self._poses = model is not None
        self._period, self._due = pose_period_ns, -(2**62)
        self._last_ns = 0
        self._open = True
        self._failed: RecorderError | None = None
        nq = 0 if model is None else int(model.nq)
        try:
            shape = ring.make(capacity, max(width, nq))
        except OSError as error:
            raise RecorderError(f"no shared memory for the recorder: {error}") from None
        try:
            self._ring = ring.Ring(shape)
            self._start(
                Settings(
                    self.path, tuple(signals), dict(properties), model, pose_period_ns, drain_ns,
                    serve, shape,
                )
            )  # fmt: skip
        finally:
            with suppress(OSError):  # both processes have it open; Windows refuses
                Path(shape.path).unlink()

    def _start(self, settings: Settings) -> None:
        paths = [str(ROOT), os.environ.get("PYTHONPATH", "")]
        self._process = subprocess.Popen(
            [sys.executable, "-P", "-m", "twin.recorder.process.writer"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            env={**os.environ, "PYTHONPATH": os.pathsep.join(p for p in paths if p)},
            start_new_session=True,
        )
        assert self._process.stdin is not None
        try:
            with suppress(BrokenPipeError):  # the answer has the reason
                settings.write(self._process.stdin)
                self._process.stdin.flush()
            self._answered()
        except RecorderError:
            self._leave()
            raise

    def _answered(self) -> None:
        if self._failed is not None:  # it has ended, and has given the reason
            raise self._failed
        assert self._process.stdout is not None
        line = self._read(self._process.stdout)
        if not line:
            raise RecorderError(
                f"cannot finish {self.path}: the process that writes it has ended; "
                f"`twin view {self.path}.partial` saves what was written"
            )
        error = json.loads(line)["error"]
        if error:
            self._failed = RecorderError(error)
            raise self._failed

    def _read(self, pipe: IO[bytes]) -> bytes:
        """One line; empty if none comes within the time limit."""
        lines: list[bytes] = []
        reader = threading.Thread(target=lambda: lines.append(pipe.readline()), daemon=True)
        reader.start()
        reader.join(WRITER_TIMEOUT_S)
        if not lines:
            self._process.kill()
            reader.join()
        return lines[0] if lines else b""

    def commit(self, time_ns: int, wall_ns: int) -> None:
        """Take `row` as the state at `time_ns` of the experiment and `wall_ns` since 1970 [ns]."""
        self._ring.put(ring.Kind.ROW, time_ns, wall_ns, self.row)
        self._last_ns = time_ns

    def commit_pose(self, time_ns: int, data: mujoco.MjData) -> None:
        """Take the body poses of `data` at `time_ns` [ns] if due."""
        if time_ns < self._due or not self._poses:
            return
        self._due = time_ns - time_ns % self._period + self._period
        self._ring.put(ring.Kind.POSE, time_ns, 0, data.qpos)

    def text(self, entity: str, time_ns: int, text: str, level: str) -> None:
        """Add a line to an entity of texts."""
        self._send(entity=entity, time_ns=int(time_ns), text=text, level=level)

    def attach(self, name: str, values: Mapping[str, object]) -> None:
        """Add what is known at the end, `schema.TIMING` or `schema.FLIGHT`, to the properties."""
        self._send(attach=name, values=dict(values))

    def flush(self) -> Path:
        """Write everything taken so far; return the file of the incomplete recording.

        Raises
        ------
        RecorderError : it could not be written
        """
        self._send(flush=True)
        self._answered()
        return self.path.with_name(self.path.name + ".partial")

    def _send(self, **message: object) -> None:
        assert self._process.stdin is not None
        with suppress(OSError, ValueError):  # it has ended; `close` reports it
            self._process.stdin.write(json.dumps(message).encode() + b"\n")
            self._process.stdin.flush()

    def close(self) -> None:
        """Have the rest written and the file renamed to `path`; a second call does nothing.

        Raises
        ------
        RecorderError : not everything could be written; the file is then `<path>.partial`
        """
        if not self._open:
            return
        self._open = False
        lost = self._ring.lost
        if lost:
            self.event(self._last_ns, f"{lost} rows lost: the disk was too slow", "ERROR")
        self._send(end=True)
        try:
            self._answered()
        finally:
            self._leave()
        if lost:
            raise RecorderError(f"{self.path} lacks {lost} rows: the disk was too slow")

    def _leave(self) -> None:
        for pipe in (self._process.stdin, self._process.stdout):
            assert pipe is not None
            with suppress(OSError):
                pipe.close()
        try:
            self._process.wait(WRITER_TIMEOUT_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()

    @property
    def reached_ns(self) -> int | None:
        """Time of the last row [ns], zero before the first; None once closed."""
        return self._last_ns if self._open else None
