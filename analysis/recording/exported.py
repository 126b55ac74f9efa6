"""Recordings as `twin export` writes them for other programs, read again.

CSV and Parquet are one table in SI: a row for every time stamp of any signal (more where a signal
has several values at one), a column `SIGNAL.COMPONENT [unit]` for every component, empty where a
signal has no value, and columns for the texts. A MATLAB file has a struct for every signal: `time`,
`values`, `unit`, `components`. Parquet and MATLAB files hold the properties of the run as well.

The files are read by `python -m analysis.recording.unpacking`, a process with limits.
"""

import csv
import json
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType

import numpy as np

from analysis import limited, schema
from analysis.array import Array
from analysis.files import FileError, content, opened
from analysis.recording.series import Event, RecordingError, TimeSeries, checked

SUFFIXES = (".csv", ".parquet", ".mat")
TIME = "time [s]"
LOGS = ("events", "health")  # texts over time: columns or structs with `level` and `text`
ABOUT = ("schema", "properties", "estimator", "timing", "flight")  # of Parquet and MATLAB files

LARGEST_FILE = 200_000_000  # bytes
SECONDS, MEGABYTES = 20.0, 800  # of the process that reads
HEADER = 1 << 16  # bytes that hold the first line of a CSV file
FOOTER = 1 << 24  # bytes of a Parquet file's footer
_COLUMN = re.compile(r"(?P<signal>[^.\[\]]+)\.(?P<component>\w+) \[(?P<unit>[^\[\]]+)\]")


@dataclass(frozen=True, slots=True)
class Exported:
    """Content of a file that was exported, checked.

    Attributes
    ----------
    series : signals by name, in SI
    logs : texts over time by name, each of `LOGS`
    about : texts by name, of `ABOUT`; empty for CSV
    """

    series: Mapping[str, TimeSeries]
    logs: Mapping[str, tuple[Event, ...]]
    about: Mapping[str, str]


def column(signal: schema.Signal, component: str) -> str:
    """Name of a component's column in a table."""
    return f"{signal.name}.{component} [{signal.unit}]"


def struct(name: str) -> str:
    """Name of a signal's struct in a MATLAB file."""
    return name.replace("/", "_")


def is_exported(path: Path) -> bool:
    """Whether a table says that `twin export` wrote it; only its head or footer is read."""
    try:
        with opened(path, LARGEST_FILE) as file:
            match path.suffix.lower():
                case ".csv":
                    return bool(columns_of(file.readline(HEADER)))
                case ".mat":
                    return schema.SCHEMA.encode() in file.read(116)  # its description
                case ".parquet":
                    size = file.seek(0, 2)
                    file.seek(max(0, size - FOOTER))
                    return schema.SCHEMA.encode() in file.read(FOOTER)
    except FileError:
        pass
    return False


def read(path: Path) -> Exported:
    """Read a file that was exported as CSV, Parquet or MATLAB.

    Raises
    ------
    RecordingError : it cannot be read, is not an export of a recording, or holds impossible numbers
    """
    try:
        request = path.suffix.lower().encode() + b"\n" + content(path, LARGEST_FILE)
        answer = limited.run(
            "analysis.recording.unpacking", request, seconds=SECONDS, megabytes=MEGABYTES
        )
    except FileError as error:
        raise RecordingError(f"cannot read {error}") from None
    except limited.LimitError as error:
        raise RecordingError(f"{path}: {error}") from None
    return unpacked(path, answer)


def unpacked(path: Path, answer: bytes) -> Exported:
    """Check what `unpacking.packed` gave for a file; `RecordingError` as for `read`."""
    head, _, values = answer.partition(b"\n")
    held = json.loads(head)
    version = held["about"].get("schema", schema.SCHEMA)
    if version != schema.SCHEMA:
        raise RecordingError(f"{path}: schema '{version}'; this version reads '{schema.SCHEMA}'")
    try:
        series = _series(held["rows"], np.frombuffer(values))
    except RecordingError as error:
        raise RecordingError(f"{path}: {error}") from None
    logs = {name: tuple(Event(*line) for line in held["logs"][name]) for name in LOGS}
    return Exported(MappingProxyType(series), logs, held["about"])


def _series(rows: Mapping[str, int], values: Array) -> dict[str, TimeSeries]:
    found, at = {}, 0
    for name, count in rows.items():
        signal = schema.SIGNALS[name]
        width = len(signal.components)
        time, at = values[at : at + count], at + count
        table, at = values[at : at + count * width], at + count * width
        found[name] = checked(signal, time, table.reshape(count, width))
    return found


def columns_of(line: bytes) -> dict[str, tuple[str, str, str]]:
    """Columns of signals in the first line of a CSV file."""
    try:
        names = next(csv.reader([line.decode("utf-8-sig")]), [])
    except (UnicodeDecodeError, csv.Error):
        return {}
    return signals_of(names) if TIME in names else {}


def signals_of(names: list[str]) -> dict[str, tuple[str, str, str]]:
    """Signal, component and unit of the columns that hold a signal."""
    matches = {name: _COLUMN.fullmatch(name) for name in names}
    return {
        name: (match["signal"], match["component"], match["unit"])
        for name, match in matches.items()
        if match is not None and match["signal"] in schema.SIGNALS
    }
