"""The process that writes for a `DetachedRecorder`: `python -m twin.recorder.process.writer`.

Standard input has the settings, then a line of JSON for every text, a verdict on timing, a request
to flush, or the end of the run, which is also the end of input. Standard output has an answer in
JSON when the file is open, flushed and closed.
"""

import json
import os
import queue
import signal
import sys
import threading
from contextlib import suppress
from typing import IO, Any

import mujoco

from twin.recorder.checks import RecorderError
from twin.recorder.process.detached import Settings
from twin.recorder.process.ring import Kind, Ring
from twin.recorder.stream import Recorder

PERIOD_S = 0.02
KILLED = "the process of the run ended unexpectedly, perhaps killed"


class Writer:
    """Passes rows from the ring and texts from a queue to a recorder."""

    def __init__(self, settings: Settings, recorder: Recorder) -> None:
        self._recorder = recorder
        self._ring = Ring(settings.ring)
        self._data = None if settings.model is None else mujoco.MjData(settings.model)
        self._model = settings.model
        self._last_ns = 0
        self._texts: queue.SimpleQueue[dict[str, Any]] = queue.SimpleQueue()
        self.ended = threading.Event()
        self.orderly = False

    def listen(self, lines: IO[bytes]) -> None:
        """Read messages until the run ends."""
        try:
            for line in lines:
                message = json.loads(line)
                if message.get("end"):
                    self.orderly = True
                    break
                self._texts.put(message)
        except ValueError:  # an incomplete line: the process of the run is gone
            pass
        finally:
            self.ended.set()

    def run(self) -> None:
        """Write until the run has ended, then write the rest."""
        while not self.ended.wait(PERIOD_S):
            self._pass_on(settled=True)
        self._pass_on(settled=False)
        if not self.orderly:
            self._recorder.event(self._last_ns, KILLED, "ERROR")

    def _pass_on(self, *, settled: bool) -> None:
        recorder = self._recorder
        flush = False
        while not self._texts.empty() and not flush:
            message = self._texts.get()
            flush = "flush" in message
            if "attach" in message:
                recorder.attach(message["attach"], message["values"])
            elif not flush:
                recorder.text(**message)
        # every row that a request to flush concerns was in the ring before it
        for kind, time_ns, wall_ns, values in self._ring.take(settled=settled and not flush):
            if kind is Kind.ROW:
                recorder.row[:] = values[: recorder.row.size]
                recorder.commit(time_ns, wall_ns)
                self._last_ns = max(self._last_ns, time_ns)
            elif self._data is not None:
                self._data.qpos[:] = values[: self._data.qpos.size]
                mujoco.mj_kinematics(self._model, self._data)
                recorder.commit_pose(time_ns, self._data)
        if flush:
            recorder.flush()
            _answer(None)


def main() -> None:
    """Serve one recording."""
    # the process of the run handles the signal and ends this one
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    lines = sys.stdin.buffer
    try:
        settings = Settings.read(lines)
    except ValueError:  # the run ended before it sent its settings
        return
    try:
        recorder = Recorder(
            settings.path, signals=settings.signals, properties=settings.properties,
            model=settings.model, pose_period_ns=settings.pose_period_ns,
            drain_ns=settings.drain_ns, serve=settings.serve,
        )  # fmt: skip
    except RecorderError as error:
        _answer(str(error))
        return
    writer = Writer(settings, recorder)
    _answer(None)
    threading.Thread(target=writer.listen, args=(lines,), daemon=True).start()
    failed = None
    try:
        writer.run()
        recorder.close()
    except RecorderError as error:
        failed = str(error)
    _answer(failed)
    if failed is not None:
        os._exit(1)  # an orderly exit would wait for the reading thread


def _answer(error: str | None) -> None:
    with suppress(OSError):  # the process of the run is gone
        os.write(1, json.dumps({"error": error}).encode() + b"\n")


if __name__ == "__main__":
    main()
