"""Recordings and tables as validated time series; a name's module is imported on its first use."""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from analysis.recording.reader import Event as Event
    from analysis.recording.reader import Recording as Recording
    from analysis.recording.reader import RecordingError as RecordingError
    from analysis.recording.reader import TimeSeries as TimeSeries
    from analysis.recording.reader import read as read
    from analysis.recording.record import Record as Record
    from analysis.recording.record_of_table import to_record as to_record

# pyarrow costs every command 0.1 s that reads no recording
_HOMES = {
    "Event": "reader",
    "Recording": "reader",
    "RecordingError": "reader",
    "TimeSeries": "reader",
    "read": "reader",
    "Record": "record",
    "to_record": "record_of_table",
}


def __getattr__(name: str) -> object:
    """Import a public name from the module that defines it."""
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)
