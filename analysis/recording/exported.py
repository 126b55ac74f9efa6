"""Recordings as `twin export` writes them for other programs, read again.

CSV and Parquet are one table in SI: a row for every time stamp of any signal (more where a signal
has several values at one), a column `SIGNAL.COMPONENT [unit]` for every component, empty where a
signal has no value, and columns for the texts. A MATLAB file has a struct for every signal: `time`,
`values`, `unit`, `components`. Parquet and MATLAB files hold the properties of the run as well.

The files are read by `python -m analysis.recording.exported`, a process with limits: standard
output has a line of JSON, then the stamps and values of each signal as float64.
"""

import csv
import io
import json
import math
import re
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from analysis import limited, schema
from analysis.array import Array
from analysis.files import FileError, content, opened
from analysis.recording.series import Event, RecordingError, TimeSeries, checked

if TYPE_CHECKING:
    import pyarrow as pa

SUFFIXES = (".csv", ".parquet", ".mat")
TIME = "time [s]"
LOGS = ("events", "health")  # texts over time: columns or structs with `level` and `text`
ABOUT = ("schema", "properties", "estimator", "timing")  # of Parquet and MATLAB files

LARGEST_FILE, MOST_VALUES = 200_000_000, 20_000_000  # bytes, and places in a table
SECONDS, MEGABYTES = 20.0, 800  # of the process that reads
HEADER = 1 << 16  # bytes that hold the first line of a CSV file
FOOTER = 1 << 24  # bytes of a Parquet file's footer
_COLUMN = re.compile(r"(?P<signal>.+)\.(?P<component>\w+) \[(?P<unit>.+)\]")


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
                    return bool(_columns_of(file.readline(HEADER)))
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
            "analysis.recording.exported", request, seconds=SECONDS, megabytes=MEGABYTES
        )
    except FileError as error:
        raise RecordingError(f"cannot read {error}") from None
    except limited.LimitError as error:
        raise RecordingError(f"{path}: {error}") from None
    return unpacked(path, answer)


def unpacked(path: Path, answer: bytes) -> Exported:
    """Check what `packed` gave for a file; `RecordingError` as for `read`."""
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


# In the process with limits; a ValueError is the reason for the reader.


@dataclass
class _Found:
    """What a file holds: stamps (n,) and values (n, k) by signal, lines by log, texts."""

    signals: dict[str, tuple[Array, Array]]
    logs: dict[str, list[tuple[float, str, str]]]
    about: dict[str, str]


def _columns_of(line: bytes) -> dict[str, tuple[str, str, str]]:
    """Columns of signals in the first line of a CSV file."""
    try:
        names = next(csv.reader([line.decode("utf-8-sig")]), [])
    except (UnicodeDecodeError, csv.Error):
        return {}
    return _signals(names) if TIME in names else {}


def _signals(names: list[str]) -> dict[str, tuple[str, str, str]]:
    """Signal, component and unit of the columns that hold a signal."""
    matches = {name: _COLUMN.fullmatch(name) for name in names}
    return {
        name: (match["signal"], match["component"], match["unit"])
        for name, match in matches.items()
        if match is not None and match["signal"] in schema.SIGNALS
    }


def _of_csv(data: bytes) -> _Found:
    from pyarrow import csv as reader

    line, _, _ = data[:HEADER].partition(b"\n")
    names = next(csv.reader([line.decode("utf-8-sig").rstrip("\r")]), [])
    texts = [f"{log}.{part}" for log in LOGS for part in ("level", "text")]
    types = {TIME: "float64", **dict.fromkeys(_signals(names), "float64")}
    types |= dict.fromkeys(texts, "string")
    wanted = [name for name in names if name in types]
    if TIME not in wanted:
        return _Found({}, {}, {})
    table = reader.read_csv(
        io.BytesIO(data),
        reader.ReadOptions(use_threads=False),
        reader.ParseOptions(newlines_in_values=True),
        reader.ConvertOptions(
            column_types=types, include_columns=wanted, strings_can_be_null=True,
            quoted_strings_can_be_null=False,
        ),
    )  # fmt: skip
    return _of_table(table)


def _of_parquet(data: bytes) -> _Found:
    from pyarrow import parquet

    file = parquet.ParquetFile(io.BytesIO(data))
    about = file.metadata
    if about.num_columns * about.num_rows > MOST_VALUES:
        raise ValueError(f"holds {about.num_columns} columns with {about.num_rows} rows; too many")
    table = file.read(use_threads=False)
    found = _of_table(table)
    held = table.schema.metadata or {}
    found.about = {k: held[k.encode()].decode() for k in ABOUT if k.encode() in held}
    return found


def _of_table(table: "pa.Table") -> _Found:
    names = table.column_names
    if TIME not in names or len(set(names)) < len(names):
        return _Found({}, {}, {})
    time = table[TIME].to_numpy()
    signals: dict[str, tuple[Array, Array]] = {}
    columns = _signals(names)
    for name, component, unit in columns.values():
        signal = schema.SIGNALS[name]
        if component not in signal.components or unit != signal.unit:
            valid = ", ".join(column(signal, c) for c in signal.components)
            raise ValueError(f"has a column '{name}.{component} [{unit}]'; must be {valid}")
    for name in dict.fromkeys(signal for signal, _, _ in columns.values()):
        signal = schema.SIGNALS[name]
        for part in (column(signal, c) for c in signal.components):
            if part not in columns:
                raise ValueError(f"has columns of {name}, but not '{part}'")
        values = np.stack([table[column(signal, c)].to_numpy() for c in signal.components], axis=1)
        there = ~np.isnan(values).all(axis=1)
        signals[name] = time[there], values[there]
    logs = {}
    for log in LOGS:
        if {f"{log}.level", f"{log}.text"} <= set(names):
            parts = (table[f"{log}.{part}"].to_pylist() for part in ("level", "text"))
            lines = zip(time.tolist(), *parts, strict=True)
            logs[log] = [(at, level, text or "") for at, level, text in lines if level]
    return _Found(signals, logs, {})


def _of_mat(data: bytes) -> _Found:
    from scipy.io import loadmat

    held = loadmat(io.BytesIO(data))  # type: ignore[arg-type]
    found = _Found({}, {}, {})
    for name, signal in schema.SIGNALS.items():
        if struct(name) in held:
            fields = held[struct(name)]
            unit = _text(fields["unit"][0, 0])
            if unit != signal.unit:
                raise ValueError(f"has '{struct(name)}' in {unit}; must be in {signal.unit}")
            time, values = (
                np.asarray(fields[part][0, 0], np.float64) for part in ("time", "values")
            )
            if values.shape != (time.size, len(signal.components)):
                raise ValueError(f"has '{struct(name)}' of {time.size} stamps with {values.shape}")
            found.signals[name] = time.ravel(), values
    for log in LOGS:
        if log in held:
            parts = (held[log][part][0, 0].ravel().tolist() for part in ("time", "level", "text"))
            found.logs[log] = [(at, _text(a), _text(b)) for at, a, b in zip(*parts, strict=True)]
    found.about = {name: _text(held[name]) for name in ABOUT if name in held}
    return found


def _text(value: NDArray[np.str_]) -> str:
    return "".join(np.ravel(value).tolist())


_READERS = {".csv": _of_csv, ".parquet": _of_parquet, ".mat": _of_mat}


def packed(kind: str, data: bytes) -> bytes:
    """A line of JSON, then stamps and values of the signals of a file.

    Parameters
    ----------
    kind : one of `SUFFIXES`
    data : content of the file

    Raises
    ------
    ValueError : it is not an export; a message with "has " or "holds " is the reason
    Exception : any of the readers', for damaged and hostile files
    """
    found = _READERS[kind](data)
    if not found.signals:
        raise ValueError("has no signals of a recording; `twin export` writes them")
    logs = {log: found.logs.get(log, []) for log in LOGS}
    if not all(math.isfinite(at) for lines in logs.values() for at, _, _ in lines):
        raise ValueError("has a text at a time that is not finite")
    rows = {name: len(time) for name, (time, _) in found.signals.items()}
    parts = [np.ravel(part) for both in found.signals.values() for part in both]
    head = json.dumps({"rows": rows, "logs": logs, "about": found.about}).encode()
    return head + b"\n" + np.concatenate(parts).astype(np.float64).tobytes()


def main() -> None:
    """Read the ending of a file's name and the file on standard input."""
    limited.confine()
    kind, _, data = sys.stdin.buffer.read().partition(b"\n")
    try:
        sys.stdout.buffer.write(packed(kind.decode(), data))
    except MemoryError:
        raise
    except Exception as error:  # hostile bytes fail anywhere in the readers
        refuse(kind.decode(), error)


def refuse(kind: str, error: Exception) -> None:
    """End the process with what was wrong."""
    if type(error) is ValueError and str(error).startswith(("has ", "holds ")):
        limited.refuse(str(error))
    what = f"not a readable {kind[1:]} file, or not an export of a recording"
    limited.refuse(f"{what} ({type(error).__name__})")


if __name__ == "__main__":
    main()
