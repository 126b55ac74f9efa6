"""Rows of a run into one Rerun recording, with its 3D scene and blueprint."""

from twin.recorder.stream import Recorder, RecorderError

__all__ = ["Recorder", "RecorderError"]
