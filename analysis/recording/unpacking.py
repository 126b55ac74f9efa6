"""Reader of exported recordings: `python -m analysis.recording.unpacking`, a process with limits.

Standard input has the ending of the file's name and the file; standard output a line of JSON, then
the stamps and values of each signal as float64. A ValueError is the reason for a refusal.
"""

import csv
import io
import json
import math
import sys
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from analysis import limited, schema
from analysis.array import Array
from analysis.recording.exported import ABOUT, HEADER, LOGS, TIME, column, signals_of, struct

if TYPE_CHECKING:
    import pyarrow as pa

MOST_VALUES = 20_000_000  # places in a table


@dataclass
class _Found:
    """What a file holds: stamps (n,) and values (n, k) by signal, lines by log, texts."""

    signals: dict[str, tuple[Array, Array]]
    logs: dict[str, list[tuple[float, str, str]]]
    about: dict[str, str]


def _of_csv(data: bytes) -> _Found:
    from pyarrow import csv as reader

    line, _, _ = data[:HEADER].partition(b"\n")
    names = next(csv.reader([line.decode("utf-8-sig").rstrip("\r")]), [])
    texts = [f"{log}.{part}" for log in LOGS for part in ("level", "text")]
    types = {TIME: "float64", **dict.fromkeys(signals_of(names), "float64")}
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
    columns = signals_of(names)
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
        raise ValueError(
            "has no signals of a recording, which `twin export` writes; read a table of your own "
            "by analysis.recording.load(FILE, Columns(...))"
        )
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
