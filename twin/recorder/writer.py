"""The process that writes what a `DetachedRecorder` is given: `python -m twin.recorder.writer`.

Standard input brings the settings, then a line of JSON for every text, a verdict on timing, or a
request to flush; its end, or a line that says so, is the end of the run. Standard output answers in
JSON: when the file is open, when it is flushed, and when it is closed.
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

from twin.recorder.detached import Settings
from twin.recorder.ring import Kind, Ring
from twin.recorder.stream import Recorder, RecorderError

PERIOD_S = 0.02
KILLED = "the run's process ended without a word; was it killed?"


class Writer:
    """Passes rows from the ring and texts from a queue on to a recorder."""

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
        """Take texts in until the run ends."""
        try:
            for line in lines:
                told = json.loads(line)
                if told.get("end"):
                    self.orderly = True
                    break
                self._texts.put(told)
        except ValueError:  # a line torn off: whoever was telling is gone
            pass
        finally:
            self.ended.set()

    def run(self) -> None:
        """Write until the run has ended, and then the rest."""
        while not self.ended.wait(PERIOD_S):
            self._pass_on(settled=True)
        self._pass_on(settled=False)
        if not self.orderly:
            self._recorder.event(self._last_ns, KILLED, "ERROR")

    def _pass_on(self, *, settled: bool) -> None:
        recorder = self._recorder
        flush = False
        while not self._texts.empty() and not flush:
            told = self._texts.get()
            flush = "flush" in told
            if "timing" in told:
                recorder.timing(told["timing"])
            elif not flush:
                recorder.text(**told)
        # a request to flush came through the pipe behind every row that it is about
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
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the run ends us, whatever ends the run
    lines = sys.stdin.buffer
    try:
        settings = Settings.read(lines)
    except ValueError:  # the run ended before it had told anything
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
        os._exit(1)  # the listening thread waits in a read that an orderly end would wait for


def _answer(error: str | None) -> None:
    with suppress(OSError):  # the run's process is gone; the file is what matters
        os.write(1, json.dumps({"error": error}).encode() + b"\n")


if __name__ == "__main__":
    main()
