"""A recording as CSV, Parquet or a MATLAB file, exact to the last bit.

The layout is in `analysis.recording.exported`, which reads them again.
"""

import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from analysis import schema
from analysis.array import Array
from analysis.recording.exported import LOGS, TIME, column, struct
from analysis.recording.series import Event, Recording

# MATLAB shows the first 116 bytes of a file as its description
_DESCRIPTION = f"MATLAB 5.0 MAT-file, {schema.SCHEMA} of twin export".ljust(116).encode()
_KEY = np.dtype([("time", np.float64), ("repeat", np.int64)])


def write_csv(recording: Recording, path: Path) -> None:
    """Write one table of all signals and texts."""
    from pyarrow import csv

    csv.write_csv(_table(recording), path)


def write_parquet(recording: Recording, path: Path) -> None:
    """Write one table; the run's properties are in the metadata of the file."""
    from pyarrow import parquet

    parquet.write_table(_table(recording), path)


def write_mat(recording: Recording, path: Path) -> None:
    """Write a struct for each signal, readable by MATLAB 7 and later."""
    from scipy.io import savemat

    structs: dict[str, object] = {
        struct(name): {
            "time": s.time[:, None],
            "values": s.values,
            "unit": s.unit,
            "components": np.array(s.components, dtype=object),
        }
        for name, s in recording.series.items()
    }
    for log, lines in _logs(recording).items():
        structs[log] = {
            "time": np.array([[e.time] for e in lines]),
            "level": np.array([[e.level] for e in lines], dtype=object),
            "text": np.array([[e.text] for e in lines], dtype=object),
        }
    savemat(path, structs | _about(recording), long_field_names=True, do_compression=True)
    with path.open("r+b") as file:
        file.write(_DESCRIPTION)


def _about(recording: Recording) -> dict[str, str]:
    return {
        "schema": schema.SCHEMA,
        "properties": json.dumps(recording.properties),
        "estimator": recording.estimator,
        "timing": json.dumps(dict(recording.timing)),
        "flight": json.dumps(dict(recording.flight)),
    }


def _logs(recording: Recording) -> dict[str, Sequence[Event]]:
    return {n: lines for n in LOGS if (lines := getattr(recording, n))}


def _table(recording: Recording) -> pa.Table:
    """One row for each time stamp, more where a signal or log has several values at one."""
    keys = {name: _keys(s.time) for name, s in recording.series.items()}
    logs = _logs(recording)
    keys |= {log: _keys(np.array([e.time for e in lines])) for log, lines in logs.items()}
    rows = np.unique(np.concatenate([np.empty(0, _KEY), *keys.values()]))
    columns, fields = [pa.array(rows["time"])], [_field(TIME, "s")]
    for name, s in recording.series.items():
        places = np.searchsorted(rows, keys[name])
        for k, component in enumerate(s.components):
            values = np.full(len(rows), np.nan)
            values[places] = s.values[:, k]
            columns.append(pa.array(values, mask=np.isnan(values)))
            fields.append(_field(column(schema.SIGNALS[name], component), s.unit))
    for log, lines in logs.items():
        places = np.searchsorted(rows, keys[log])
        for part in ("level", "text"):
            texts = np.full(len(rows), None, dtype=object)
            texts[places] = [getattr(e, part) for e in lines]
            columns.append(pa.array(texts, pa.string()))
            fields.append(pa.field(f"{log}.{part}", pa.string()))
    return pa.Table.from_arrays(columns, schema=pa.schema(fields, metadata=_about(recording)))


def _keys(time: Array) -> NDArray[np.void]:
    """Time stamp and its count among equal ones."""
    first = np.searchsorted(time, time)
    keys = np.empty(len(time), _KEY)
    keys["time"], keys["repeat"] = time, np.arange(len(time)) - first
    return keys


def _field(name: str, unit: str) -> pa.Field:
    return pa.field(name, pa.float64(), metadata={"unit": unit})
