"""Measurements as tables: CSV and MATLAB files with named columns, from anybody's rig."""

import csv
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from analysis.identify.records import Initial, Record, record
from analysis.schema import AnalysisError, unknown

Array = NDArray[np.float64]

LARGEST_FILE = 1 << 30  # bytes
MOST_COLUMNS = 512
MOST_ROWS = 20_000_000
LONGEST_FIELD = 256  # characters

UNITS: Mapping[str, float] = MappingProxyType(
    {"rad": 1.0, "mrad": 1e-3, "deg": math.pi / 180.0, "turn": 2.0 * math.pi, "1": 1.0}
)


@dataclass(frozen=True, slots=True)
class Table:
    """Columns of one file, by name.

    Attributes
    ----------
    columns : name → values (n,), NaN where a field is empty; lengths may differ (MATLAB files)
    source : the file's name
    """

    columns: Mapping[str, Array]
    source: str

    def column(self, name: str) -> Array:
        """One column (n,).

        Raises
        ------
        AnalysisError
            if there is none of that name; the message lists the valid names.
        """
        if name not in self.columns:
            raise AnalysisError(f"{self.source}: {unknown('column', name, self.columns)}")
        return self.columns[name]

    def stack(self, names: Sequence[str]) -> Array:
        """Several columns of one length (n, len(names)).

        Raises
        ------
        AnalysisError
            for names that are none, and columns of different lengths.
        """
        found = [self.column(name) for name in names]
        lengths = {name: len(c) for name, c in zip(names, found, strict=True)}
        if len(set(lengths.values())) > 1:
            raise AnalysisError(f"{self.source}: columns of different lengths: {lengths}")
        return np.stack(found, axis=1)


def read(path: Path | str) -> Table:
    """Read a .csv (or .tsv, .txt) or .mat file.

    Raises
    ------
    AnalysisError
        for a file that is missing, too large, of another kind, or not a table of numbers.
    """
    path = Path(path)
    try:
        size = path.stat().st_size
    except OSError as error:
        raise AnalysisError(f"{path}: {error.strerror or 'cannot be read'}") from error
    if not path.is_file():
        raise AnalysisError(f"{path}: not a file")
    if size > LARGEST_FILE:
        raise AnalysisError(f"{path}: {size} bytes; {LARGEST_FILE} at most")
    kind = path.suffix.lower()
    if kind in {".csv", ".tsv", ".txt"}:
        return _read_csv(path)
    if kind == ".mat":
        return _read_mat(path)
    raise AnalysisError(f"{path}: '{kind}' is no table; .csv, .tsv, .txt and .mat are")


def to_record(
    table: Table,
    *,
    time: str,
    inputs: Sequence[str],
    rate: Sequence[str] = (),
    angle: Sequence[str] = (),
    unit: str = "rad",
    input_unit: str | None = None,
    time_scale: float = 1.0,
    gyro_delay: float = 0.0,
    commands: Table | None = None,
    initial: Initial = "rest",
    before: Sequence[float] | None = None,
) -> Record:
    """Pick the columns of a record by name; empty fields are readings that are missing.

    Parameters
    ----------
    time : column of stamps
    inputs, rate, angle : columns of commands, gyro (per second) and potentiometer
    unit : of angle, rate and command: one of `UNITS`
    input_unit : of the command, where it is another
    time_scale : seconds per unit of the time column (1e-3 for milliseconds)
    gyro_delay : delay of the gyro's own filter [s]
    commands : a table of the commands with a time column of the same name; without it they change
        at the sample that first shows them
    before : the command that held before the first stamp, in its unit

    Raises
    ------
    AnalysisError
        for columns and units that are none; `IdentificationError` for what no record may hold.
    """
    scale, own = _scale(unit), _scale(input_unit or unit)
    stamps = table.column(time) * time_scale
    source = table if commands is None else commands
    filled = _held(source.stack(inputs))
    return record(
        stamps,
        filled,
        angle=table.stack(angle) if angle else None,
        rate=table.stack(rate) if rate else None,
        command_time=None if commands is None else commands.column(time) * time_scale,
        before=before,
        scale=scale,
        input_scale=own,
        gyro_delay=gyro_delay,
        initial=initial,
        name=table.source,
        inputs=tuple(inputs) if len(inputs) > 2 else (),
    )


def _scale(unit: str) -> float:
    if unit not in UNITS:
        raise AnalysisError(unknown("unit", unit, UNITS))
    return UNITS[unit]


def _held(values: Array) -> Array:
    """Commands with empty fields taken as no change."""
    rows = np.arange(len(values))[:, None]
    last = np.maximum.accumulate(np.where(np.isfinite(values), rows, 0), axis=0)
    return np.asarray(np.take_along_axis(values, last, axis=0))


def _read_csv(path: Path) -> Table:
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            sample = file.read(8192)
            if "\0" in sample:
                raise AnalysisError(f"{path}: holds zero bytes; not a text file")
            delimiter = _delimiter(sample)
            file.seek(0)
            rows = csv.reader(file, delimiter=delimiter, strict=True)
            return _table_of(path, rows, decimal_comma=delimiter == ";")
    except UnicodeDecodeError as error:
        raise AnalysisError(f"{path}: not UTF-8 text (byte {error.start})") from error
    except csv.Error as error:
        raise AnalysisError(f"{path}: not a table: {error}") from error
    except OSError as error:
        raise AnalysisError(f"{path}: {error.strerror or 'cannot be read'}") from error


def _delimiter(sample: str) -> str:
    """The separator of the first line; numbers may hold a decimal comma between semicolons."""
    first = sample.lstrip("\r\n").splitlines()[0] if sample.strip() else ""
    for candidate in (";", "\t", ","):
        if candidate in first:
            return candidate
    return ","


def _table_of(path: Path, rows: Iterator[list[str]], *, decimal_comma: bool) -> Table:
    header = next((row for row in rows if any(f.strip() for f in row)), None)
    if header is None:
        raise AnalysisError(f"{path}: empty")
    names = [f.strip() for f in header]
    _check_names(path, names)
    values: list[list[float]] = []
    for number, row in enumerate(islice(rows, MOST_ROWS + 1), start=2):
        if not any(f.strip() for f in row):
            continue
        if len(row) != len(names):
            raise AnalysisError(
                f"{path}: row {number} has {len(row)} fields, the header {len(names)}"
            )
        values.append(
            [_number(path, number, n, f, decimal_comma) for n, f in zip(names, row, strict=True)]
        )
    if len(values) > MOST_ROWS:
        raise AnalysisError(f"{path}: more than {MOST_ROWS} rows")
    if not values:
        raise AnalysisError(f"{path}: a header but no rows")
    table = np.array(values)
    return _frozen(path, {name: table[:, i] for i, name in enumerate(names)})


def _check_names(path: Path, names: Sequence[str]) -> None:
    if len(names) > MOST_COLUMNS:
        raise AnalysisError(f"{path}: {len(names)} columns; {MOST_COLUMNS} at most")
    if all(_is_number(n) for n in names):
        raise AnalysisError(f"{path}: the first row holds numbers; it must name the columns")
    for name in names:
        if names.count(name) > 1:
            raise AnalysisError(f"{path}: two columns are called '{name}'")


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _number(path: Path, row: int, name: str, text: str, decimal_comma: bool) -> float:
    text = text.strip()
    if not text:
        return math.nan
    try:
        if len(text) > LONGEST_FIELD or "_" in text:
            raise ValueError
        value = float(text.replace(",", ".") if decimal_comma else text)
    except ValueError:
        raise AnalysisError(
            f"{path}: row {row}, column '{name}': '{text[:40]}' is not a number"
        ) from None
    if math.isinf(value):
        raise AnalysisError(f"{path}: row {row}, column '{name}' is infinite")
    return value


def _read_mat(path: Path) -> Table:
    from scipy.io import loadmat, whosmat
    from scipy.io.matlab import MatReadError

    try:
        listing = whosmat(str(path))
        total = sum(math.prod(shape) for _, shape, _ in listing)
        if len(listing) > MOST_COLUMNS or total > MOST_ROWS:
            raise AnalysisError(f"{path}: {len(listing)} variables with {total} values; too many")
        content = loadmat(str(path), squeeze_me=True, struct_as_record=True, chars_as_strings=True)
    except NotImplementedError:
        raise AnalysisError(f"{path}: a MATLAB 7.3 file; save it with -v7 instead") from None
    except AnalysisError:
        raise
    except (MatReadError, ValueError, TypeError, KeyError, OSError, EOFError, MemoryError,
            IndexError, OverflowError, AttributeError) as error:  # fmt: skip
        # hostile bytes fail anywhere in the reader
        raise AnalysisError(
            f"{path}: not a readable MATLAB file ({type(error).__name__})"
        ) from error
    columns: dict[str, Array] = {}
    for name, value in content.items():
        if not name.startswith("__"):
            _collect(columns, name, value, depth=0)
    if not columns:
        raise AnalysisError(f"{path}: holds no numeric columns")
    return _frozen(path, columns)


def _collect(columns: dict[str, Array], name: str, value: object, depth: int) -> None:
    """Vectors as columns, matrices as name(1), name(2) …, fields of structs as name.field."""
    if len(columns) >= MOST_COLUMNS or not isinstance(value, np.ndarray | np.void):
        return
    if value.dtype.names is not None:
        if depth < 3 and value.ndim == 0:
            for key in value.dtype.names:
                part = value[key]
                inner = part.item() if part.dtype == object and part.ndim == 0 else part
                _collect(columns, f"{name}.{key}", inner, depth + 1)
        return
    if value.dtype.kind not in "fiub" or value.ndim not in (1, 2):
        return
    table = np.asarray(value, dtype=np.float64)
    if table.ndim == 1:
        columns[name] = table
    elif table.shape[1] <= MOST_COLUMNS:
        for i in range(table.shape[1]):
            columns[f"{name}({i + 1})"] = table[:, i].copy()


def _frozen(path: Path, columns: dict[str, Array]) -> Table:
    for name, values in columns.items():
        if np.isinf(values).any():
            raise AnalysisError(f"{path}: column '{name}' holds infinite values")
        values.setflags(write=False)
    return Table(MappingProxyType(columns), path.name)
