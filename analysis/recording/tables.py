"""Measurements as tables: CSV, MATLAB and Parquet files with named columns, from anybody's rig."""

import csv
import io
import json
import math
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from itertools import chain, islice
from pathlib import Path
from types import MappingProxyType

import numpy as np

from analysis import limited
from analysis.array import Array
from analysis.files import opened
from analysis.schema import AnalysisError, unknown

LARGEST_FILE = 1 << 30  # bytes
LARGEST_MAT = 200_000_000  # bytes, of which 20 million values take 160
MAT_SECONDS, MAT_MEGABYTES = 20.0, 800
MOST_COLUMNS = 512
MOST_ROWS = 20_000_000
LONGEST_FIELD = 256  # characters
MISSING = frozenset({"", "na", "n/a", "#n/a", "null", "none"})  # float() reads "nan" itself

BINARY = frozenset({".mat", ".parquet"})
KINDS = frozenset({".csv", ".tsv", ".txt"}) | BINARY
_SEPARATOR = re.compile(r"\ufeff?sep=(.)\s*$")  # first line of tables that Excel is to open


@dataclass(frozen=True, slots=True)
class Table:
    """Columns of one file, by name.

    Attributes
    ----------
    columns : name → values (n,), NaN where a field is empty, dates as seconds
        from the first; lengths may differ (MATLAB files)
    source : the file's name
    unusable : name → what is wrong with a column of text or infinities
    note : what of the file was left out, in one line; "" where nothing was
    begins : of columns of dates, the first [s since 1970]
    """

    columns: Mapping[str, Array]
    source: str
    unusable: Mapping[str, str] = field(default_factory=dict)
    note: str = ""
    begins: Mapping[str, float] = field(default_factory=dict)

    def column(self, name: str) -> Array:
        """One column (n,).

        Raises
        ------
        AnalysisError : there is none of that name (the message lists the valid names), or it holds
            something else than numbers
        """
        if name not in self.columns:
            raise AnalysisError(f"{self.source}: {unknown('column', name, self.columns)}")
        if name in self.unusable:
            raise AnalysisError(self.unusable[name])
        return self.columns[name]

    def stack(self, names: Sequence[str]) -> Array:
        """Several columns of one length (n, len(names)).

        Raises
        ------
        AnalysisError : names that are none, and columns of different lengths
        """
        found = [self.column(name) for name in names]
        lengths = {name: len(c) for name, c in zip(names, found, strict=True)}
        if len(set(lengths.values())) > 1:
            raise AnalysisError(f"{self.source}: columns of different lengths: {lengths}")
        return np.stack(found, axis=1)


def read(path: Path | str) -> Table:
    """Read a .csv (or .tsv, .txt), .mat or .parquet file.

    Raises
    ------
    AnalysisError : a file that is missing, too large, of another kind, or not a table
    """
    path = Path(path)
    kind = path.suffix.lower()
    if kind not in KINDS:
        raise AnalysisError(f"{path}: '{kind}' is no table; {', '.join(sorted(KINDS))} are")
    return _read_mat(path) if kind in BINARY else _read_csv(path)


def _read_csv(path: Path) -> Table:
    """Read text in UTF-8 or, as Excel for Windows writes it, in UTF-16 or Windows-1252."""
    with opened(path, LARGEST_FILE) as content:
        head = content.read(2)
    wide = head in {b"\xff\xfe", b"\xfe\xff"}
    try:
        return _read_text(path, "utf-16" if wide else "utf-8-sig")
    except UnicodeDecodeError as error:
        try:
            return _read_text(path, "cp1252")
        except UnicodeDecodeError:
            raise AnalysisError(f"{path}: not UTF-8 text (byte {error.start})") from error


def _read_text(path: Path, encoding: str) -> Table:
    with (
        opened(path, LARGEST_FILE) as content,
        io.TextIOWrapper(content, encoding=encoding, newline="") as file,
    ):
        sample = file.read(8192)
        if "\0" in sample:
            raise AnalysisError(f"{path}: holds zero bytes; not a text file")
        file.seek(0)
        try:
            return _table_of(path, file, _delimiter(sample))
        except csv.Error as error:
            raise AnalysisError(f"{path}: not a table: {error}") from error


class _Lines:
    """Lines of a file with comments (`# …`) left empty, so that they keep their numbers."""

    def __init__(self, file: Iterable[str], delimiter: str) -> None:
        self._file, self._blanks = iter(file), delimiter == " "
        self.comment = ""  # the last one
        self.ended = True  # the last line that was given has its end

    def __iter__(self) -> Iterator[str]:
        return self

    def __next__(self) -> str:
        line = next(self._file)
        self.ended = line.endswith(("\n", "\r"))
        text = " ".join(line.split()) if self._blanks else line  # columns aligned by blanks
        if _SEPARATOR.match(line):
            return "\n"
        if not line.startswith("#"):
            return text
        self.comment = text.lstrip("# ").rstrip()
        return "\n"


def _delimiter(sample: str) -> str:
    """The separator of the first line; between semicolons or tabs, numbers may have a comma."""
    lines = (line for line in sample.splitlines() if line.strip())
    first = next((line for line in lines if not line.startswith("#")), "")
    if stated := _SEPARATOR.match(first):
        return stated[1]
    for candidate in (";", "\t", ",", " "):
        if candidate in first.strip(" \r\n"):
            return candidate
    return ","


def _table_of(path: Path, file: Iterable[str], delimiter: str) -> Table:
    lines = _Lines(file, delimiter)
    reader = csv.reader(lines, delimiter=delimiter, strict=True)
    header = next((row for row in reader if any(f.strip() for f in row)), None)
    if header is None:
        raise AnalysisError(f"{path}: empty")
    rows: Iterator[list[str]] = reader
    above = lines.comment.split(delimiter)
    if all(_is_number(f) for f in header) and len(above) == len(header) > 1:
        header, rows = above, chain([header], reader)  # as NumPy's savetxt writes names
    names = [f.strip() for f in header]
    if len(names) > 1 and not names[-1]:
        names.pop()  # every line ends with a separator
    _check_names(path, names)
    values: list[list[float]] = []
    unusable: dict[str, str] = {}
    dates: Counter[str] = Counter()
    begun: dict[str, datetime] = {}
    note = ""
    for row in islice(rows, MOST_ROWS + 1):
        if not any(f.strip() for f in row):
            continue
        if len(row) == len(names) + 1 and not row[-1].strip():
            row.pop()
        if len(row) < len(names) and values and not lines.ended:
            note = f"row {reader.line_num}, the last, is cut off and was left out"
            break
        if len(row) != len(names):
            raise AnalysisError(
                f"{path}: row {reader.line_num} has {len(row)} fields, the header {len(names)}"
            )
        numbers = [_number(f, decimal_comma=delimiter in ";\t") for f in row]
        if math.inf in numbers:
            for k, name in enumerate(names):
                if numbers[k] == math.inf and (moment := _instant(row[k])) is not None:
                    # differences are exact to the microsecond, seconds since 1970 are not
                    numbers[k] = (moment - begun.setdefault(name, moment)).total_seconds()
                    dates[name] += 1
            if not values and not note and len(names) > 1 and not any(map(math.isfinite, numbers)):
                note = f"row {reader.line_num} ({', '.join(row)}) has no number and was left out"
                continue
        values.append(numbers)
        if math.inf in numbers:
            for name, text, value in zip(names, row, numbers, strict=True):
                if value == math.inf and name not in unusable:
                    place = f"{path}: row {reader.line_num}, column '{name}'"
                    infinite = text.strip().lstrip("+-").lower() in {"inf", "infinity"}
                    fault = "infinite" if infinite else f"'{text.strip()[:40]}' is not a number"
                    unusable[name] = f"{place}: {fault}"
    if len(values) > MOST_ROWS:
        raise AnalysisError(f"{path}: more than {MOST_ROWS} rows")
    if not values:
        raise AnalysisError(f"{path}: a header but no rows")
    table = np.array(values)
    for name in (n for n in dates if n not in unusable):
        if dates[name] < np.isfinite(table[:, names.index(name)]).sum():
            unusable[name] = f"{path}: column '{name}' holds dates and numbers"
    begins = {name: moment.timestamp() for name, moment in begun.items()}
    columns = {name: table[:, i] for i, name in enumerate(names)}
    return _frozen(path, columns, unusable, note, begins)


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


def _number(text: str, *, decimal_comma: bool) -> float:
    """A field's value: NaN where it is empty, infinite where it is no number."""
    text = text.strip()
    if text.lower() in MISSING:
        return math.nan
    if len(text) > LONGEST_FIELD or "_" in text:
        return math.inf
    try:
        value = float(text.replace(",", ".") if decimal_comma else text)
    except ValueError:
        return math.inf
    return math.inf if math.isinf(value) else value


def _instant(text: str) -> datetime | None:
    """Instant of an ISO 8601 date and time, or of a time of day; None where it is neither."""
    text = text.strip()
    try:
        moment = datetime.fromisoformat(text if "-" in text else f"1970-01-01T{text}")
    except ValueError:
        return None
    return moment.replace(tzinfo=moment.tzinfo or UTC)


def _read_mat(path: Path) -> Table:
    with opened(path, LARGEST_MAT) as file:
        content = file.read()
    try:
        answer = limited.run(
            "analysis.recording.mat", content, seconds=MAT_SECONDS, megabytes=MAT_MEGABYTES
        )
    except limited.LimitError as error:
        raise AnalysisError(f"{path}: {error}") from None
    head, _, values = answer.partition(b"\n")
    lengths = json.loads(head)
    ends = np.cumsum(list(lengths.values()))
    columns = dict(zip(lengths, np.split(np.frombuffer(values), ends[:-1]), strict=True))
    unusable = {
        name: f"{path}: column '{name}' holds infinite values"
        for name, column in columns.items()
        if np.isinf(column).any()
    }
    return _frozen(path, columns, unusable)


def _frozen(
    path: Path,
    columns: dict[str, Array],
    unusable: dict[str, str],
    note: str = "",
    begins: Mapping[str, float] = MappingProxyType({}),
) -> Table:
    for values in columns.values():
        values.setflags(write=False)
    return Table(MappingProxyType(columns), path.name, MappingProxyType(unusable), note, begins)
