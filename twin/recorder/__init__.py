"""Rows of a run into one Rerun recording, with its 3D scene and blueprint."""

from importlib import import_module
from typing import TYPE_CHECKING

from twin.recorder.checks import RecorderError
from twin.recorder.process.detached import DetachedRecorder
from twin.recorder.sink import Sink

if TYPE_CHECKING:
    from twin.recorder.stream import Recorder

__all__ = ["DetachedRecorder", "Recorder", "RecorderError", "Sink"]


def __getattr__(name: str) -> object:
    """Import `Recorder` where it is used: Rerun takes half a second."""
    if name != "Recorder":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return import_module(f"{__name__}.stream").Recorder
