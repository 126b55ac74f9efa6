"""Rows of a run into one Rerun recording, with its 3D scene and blueprint."""

from twin.recorder.checks import RecorderError
from twin.recorder.detached import DetachedRecorder
from twin.recorder.sink import Sink
from twin.recorder.stream import Recorder

__all__ = ["DetachedRecorder", "Recorder", "RecorderError", "Sink"]
