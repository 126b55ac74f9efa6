"""Reader of MATLAB and Parquet files: `python -m analysis.recording.mat`, a process with limits.

SciPy's reader crashes on some files with a few changed bytes. Standard input has the file;
standard output a line of JSON, the names and lengths of the columns, then their values as float64.
"""

import io
import json
import math
import sys

import numpy as np
from scipy.io import loadmat, whosmat
from scipy.io.matlab import MatReadError

from analysis import limited
from analysis.array import Array

MOST_COLUMNS = 512
MOST_VALUES = 20_000_000
PARQUET = b"PAR1"
NUMERIC = frozenset(["double", "float", "int8", "int16", "int32", "int64", "uint8", "uint16"])
DEEPEST = 3  # levels of structs


def columns(content: bytes) -> dict[str, Array]:
    """Numeric columns (n,) of a file by name.

    Raises
    ------
    ValueError : too many variables or values, or no columns
    """
    if content.startswith(PARQUET):
        return _of_parquet(content)
    listing = whosmat(io.BytesIO(content))  # type: ignore[arg-type]
    total = sum(math.prod(shape) for _, shape, _ in listing)
    if len(listing) > MOST_COLUMNS or total > MOST_VALUES:
        raise ValueError(f"holds {len(listing)} variables with {total} values; too many")
    found: dict[str, Array] = {}
    held = loadmat(
        io.BytesIO(content),  # type: ignore[arg-type]
        squeeze_me=True,
        struct_as_record=True,
        chars_as_strings=True,
    )
    for name, value in held.items():
        if not name.startswith("__"):
            _collect(found, name, value, depth=0)
    if not found:
        raise ValueError("holds no numeric columns")
    return found


def _of_parquet(content: bytes) -> dict[str, Array]:
    from pyarrow import parquet

    file = parquet.ParquetFile(io.BytesIO(content))
    about = file.metadata
    if about.num_columns > MOST_COLUMNS or about.num_columns * about.num_rows > MOST_VALUES:
        raise ValueError(f"holds {about.num_columns} columns with {about.num_rows} rows; too many")
    table = file.read(use_threads=False)
    numeric = [n for n in table.column_names if str(table.schema.field(n).type) in NUMERIC]
    if not numeric:
        raise ValueError("holds no numeric columns")
    return {
        name: np.array(table[name].cast("float64").to_numpy(zero_copy_only=False), np.float64)
        for name in numeric
    }


def _collect(found: dict[str, Array], name: str, value: object, depth: int) -> None:
    """Vectors as columns, matrices as name(1), name(2) …, fields of structs as name.field."""
    if len(found) >= MOST_COLUMNS or not isinstance(value, np.ndarray | np.void):
        return
    if value.dtype.names is not None:
        if depth < DEEPEST and value.ndim == 0:
            for key in value.dtype.names:
                part = value[key]
                inner = part.item() if part.dtype == object and part.ndim == 0 else part
                _collect(found, f"{name}.{key}", inner, depth + 1)
        return
    if value.dtype.kind not in "fiub" or value.ndim not in (1, 2):
        return
    table = np.asarray(value, dtype=np.float64)
    if table.ndim == 1:
        found[name] = table
    elif table.shape[1] <= MOST_COLUMNS:
        for i in range(table.shape[1]):
            found[f"{name}({i + 1})"] = table[:, i].copy()


def main() -> None:
    """Read the file on standard input."""
    limited.confine()
    content = sys.stdin.buffer.read()
    try:
        found = columns(content)
    except NotImplementedError:
        limited.refuse("is a MATLAB 7.3 file; save it with -v7 instead")
    except MemoryError:
        raise
    except (MatReadError, Exception) as error:  # hostile bytes fail anywhere in the reader
        plain = type(error) is ValueError and str(error).startswith("holds ")
        kind = type(error).__name__
        what = "Parquet" if content.startswith(PARQUET) else "MATLAB"
        limited.refuse(str(error) if plain else f"is not a readable {what} file ({kind})")
    else:
        sys.stdout.buffer.write(json.dumps({k: len(v) for k, v in found.items()}).encode() + b"\n")
        for values in found.values():
            sys.stdout.buffer.write(np.ascontiguousarray(values).tobytes())


if __name__ == "__main__":
    main()
