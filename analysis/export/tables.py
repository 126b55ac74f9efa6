"""All signals of a recording as CSV, Parquet or a MATLAB file, exact to the last bit, and back.

CSV and Parquet have one table: a row for every time stamp of any signal, a column for every
component, `SIGNAL.COMPONENT [unit]` in SI; a field is empty where a signal has no value. A MATLAB
file has a struct for every signal: `time`, `values`, `unit`, `components`.
"""

import json
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from analysis import schema
from analysis.array import Array
from analysis.recording import tables
from analysis.recording.series import Recording, RecordingError, TimeSeries

TIME = "time [s]"


def write_csv(recording: Recording, path: Path) -> None:
    """Write one table of all signals."""
    from pyarrow import csv

    csv.write_csv(_table(recording), path, csv.WriteOptions(quoting_style="none"))


def write_parquet(recording: Recording, path: Path) -> None:
    """Write one table of all signals; the run's properties are in the metadata of the file."""
    from pyarrow import parquet

    parquet.write_table(_table(recording), path)


def write_mat(recording: Recording, path: Path) -> None:
    """Write a struct for each signal, readable by MATLAB 7 and later."""
    from scipy.io import savemat

    structs: dict[str, object] = {
        _struct(name): {
            "time": s.time[:, None],
            "values": s.values,
            "unit": s.unit,
            "components": np.array(s.components, dtype=object),
        }
        for name, s in recording.series.items()
    }
    structs["properties"] = json.dumps(recording.properties)
    savemat(path, structs, long_field_names=True, do_compression=True)


def read(path: Path) -> Mapping[str, TimeSeries]:
    """Signals by name of a file that was exported.

    Raises
    ------
    AnalysisError : it is not a table, or has no signals of a recording
    """
    table = tables.read(path)
    found = _from_structs(table) if Path(path).suffix == ".mat" else _from_table(table)
    if not found:
        raise RecordingError(f"{path}: no signals of a recording; `twin export` writes them")
    return found


def _table(recording: Recording) -> pa.Table:
    """One row for each time stamp, more where a signal has several values at one."""
    keys = {name: _keys(s.time) for name, s in recording.series.items()}
    rows = np.unique(np.concatenate([np.empty(0, _KEY), *keys.values()]))
    columns, fields = [pa.array(rows["time"])], [_field(TIME, "s")]
    for name, s in recording.series.items():
        places = np.searchsorted(rows, keys[name])
        for k, component in enumerate(s.components):
            values = np.full(len(rows), np.nan)
            values[places] = s.values[:, k]
            columns.append(pa.array(values, mask=np.isnan(values)))
            fields.append(_field(f"{name}.{component} [{s.unit}]", s.unit))
    about = {"schema": schema.SCHEMA, "properties": json.dumps(recording.properties)}
    return pa.Table.from_arrays(columns, schema=pa.schema(fields, metadata=about))


_KEY = np.dtype([("time", np.float64), ("repeat", np.int64)])


def _keys(time: Array) -> NDArray[np.void]:
    """Time stamp and its count among equal ones."""
    first = np.searchsorted(time, time)
    keys = np.empty(len(time), _KEY)
    keys["time"], keys["repeat"] = time, np.arange(len(time)) - first
    return keys


def _field(name: str, unit: str) -> pa.Field:
    return pa.field(name, pa.float64(), metadata={"unit": unit})


def _from_table(table: tables.Table) -> dict[str, TimeSeries]:
    if TIME not in table.columns:
        return {}
    time, found = table.column(TIME), {}
    for name, signal in schema.SIGNALS.items():
        columns = [f"{name}.{c} [{signal.unit}]" for c in signal.components]
        if all(c in table.columns for c in columns):
            values = table.stack(columns)
            there = np.isfinite(values).any(axis=1)
            found[name] = TimeSeries(
                name, time[there], values[there], signal.unit, signal.components
            )
    return found


def _from_structs(table: tables.Table) -> dict[str, TimeSeries]:
    found = {}
    for name, signal in schema.SIGNALS.items():
        struct, count = _struct(name), len(signal.components)
        columns = [f"{struct}.values({k + 1})" for k in range(count)]
        if count == 1:  # a vector has no number
            columns = [f"{struct}.values"]
        if all(c in table.columns for c in columns):
            found[name] = TimeSeries(
                name, table.column(f"{struct}.time"), table.stack(columns), signal.unit,
                signal.components,
            )  # fmt: skip
    return found


def _struct(name: str) -> str:
    return name.replace("/", "_")
