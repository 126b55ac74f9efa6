"""Recordings and tables as validated time series; a name's module is imported on its first use."""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from analysis.recording.arrays import measurement as measurement
    from analysis.recording.columns import Columns as Columns
    from analysis.recording.loader import load as load
    from analysis.recording.loader import measurement_of as measurement_of
    from analysis.recording.measurements import Measurement as Measurement
    from analysis.recording.measurements import aligned as aligned
    from analysis.recording.reader import properties as properties
    from analysis.recording.reader import read as read
    from analysis.recording.series import Event as Event
    from analysis.recording.series import Recording as Recording
    from analysis.recording.series import RecordingError as RecordingError
    from analysis.recording.series import TimeSeries as TimeSeries

# pyarrow costs every command 0.1 s that reads no recording
_HOMES = {
    "Columns": "columns",
    "Event": "series",
    "Measurement": "measurements",
    "Recording": "series",
    "RecordingError": "series",
    "TimeSeries": "series",
    "aligned": "measurements",
    "load": "loader",
    "measurement": "arrays",
    "measurement_of": "loader",
    "properties": "reader",
    "read": "reader",
}


def __getattr__(name: str) -> object:
    """Import a public name from the module that defines it."""
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)
