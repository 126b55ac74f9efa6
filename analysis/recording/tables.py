"""Measurements as tables: CSV, MATLAB and Parquet files with named columns, from anybody's rig."""

import csv
import io
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import MappingProxyType

import numpy as np

from analysis import limited
from analysis.array import Array
from analysis.files import foreign, opened
from analysis.recording.stamps import increasing, unwrapped
from analysis.recording.table_lines import SAMPLE, TableLines
from analysis.recording.text_table import STRAY, columns_of
from analysis.schema import AnalysisError, unknown

LARGEST_FILE = 1 << 30  # bytes
LARGEST_MAT = 200_000_000  # bytes, of which 20 million values take 160
MAT_SECONDS, MAT_MEGABYTES = 20.0, 800

BINARY = frozenset({".mat", ".parquet"})
KINDS = frozenset({".csv", ".tsv", ".txt", ".log", ".dat", ".jsonl"}) | BINARY


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
    units : of columns whose numbers stand with a unit, its name
    """

    columns: Mapping[str, Array]
    source: str
    unusable: Mapping[str, str] = field(default_factory=dict)
    note: str = ""
    begins: Mapping[str, float] = field(default_factory=dict)
    units: Mapping[str, str] = field(default_factory=dict)

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

    def dated(self, time: str) -> "Table":
        """The table without few rows that have no stamp or are out of order, and repeated rows.

        With a note of what was left out; as it is if those are many.

        Raises
        ------
        AnalysisError : as `column`
        """
        return self._stamped(time)._once(time)._ordered(time)

    def _stamped(self, time: str) -> "Table":
        stamped = ~np.isnan(self.column(time))
        if (~stamped).sum() > STRAY * len(stamped):
            return self
        return self._rows(stamped, f"without a stamp in '{time}'")

    def _once(self, time: str) -> "Table":
        """Without rows that are wholly those before them."""
        column = self.column(time)
        same = np.flatnonzero(np.diff(column) == 0.0) + 1
        for other in self.columns.values():
            if len(other) == len(column):
                now, before = other[same], other[same - 1]
                same = same[(now == before) | (np.isnan(now) & np.isnan(before))]
        kept = np.ones(len(column), dtype=bool)
        kept[same] = False
        return self._rows(kept, "repeating the one before")

    def _ordered(self, time: str) -> "Table":
        stamps = unwrapped(self.column(time))
        if np.isnan(stamps).any() or (np.diff(stamps) > 0.0).all():
            return self
        kept = increasing(stamps, STRAY * len(stamps))
        return self if kept is None else self._rows(kept, f"whose '{time}' does not increase")

    def _rows(self, kept: Array, why: str) -> "Table":
        """Some rows, with a note of the others; columns of other lengths stay."""
        lost = len(kept) - int(kept.sum())
        if not lost:
            return self
        columns = {n: c[kept] if len(c) == len(kept) else c for n, c in self.columns.items()}
        said = f"{lost} row{'s' * (lost > 1)} {why} left out"
        note = f"{self.note}; {said}" if self.note else said
        return replace(self, columns=MappingProxyType(columns), note=note)

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
    """Read a file of text (.csv, .tsv, .txt, .log, .dat, .jsonl), .mat or .parquet.

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
        head = content.read(SAMPLE)
    if what := foreign(head):
        raise AnalysisError(f"{path}: is {what}")
    try:
        return _read_text(path, _encoding(head))
    except UnicodeDecodeError as error:
        try:
            return _read_text(path, "cp1252")
        except UnicodeDecodeError:
            raise AnalysisError(f"{path}: not UTF-8 text (byte {error.start})") from error


def _encoding(head: bytes) -> str:
    """Encoding of a file by its mark, or by the zero bytes beside the digits of UTF-16."""
    if head.startswith((b"\xff\xfe\0\0", b"\0\0\xfe\xff")):
        return "utf-32"
    if head.startswith((b"\xff\xfe", b"\xfe\xff")):
        return "utf-16"
    if len(head) > 7:
        for low, name in ((0, "utf-16-le"), (1, "utf-16-be")):
            if not any(head[1 - low : -1 : 2]) and all(head[low:-1:2]):
                return name
    return "utf-8-sig"


def _read_text(path: Path, encoding: str) -> Table:
    with (
        opened(path, LARGEST_FILE) as content,
        io.TextIOWrapper(content, encoding=encoding, newline="") as file,
    ):
        sample = file.read(SAMPLE)
        if "\0" in sample.rstrip("\0"):  # a log may lie in more room than it fills
            raise AnalysisError(f"{path}: holds zero bytes; not a text file")
        file.seek(0)
        try:
            return _frozen(path, *columns_of(str(path), TableLines(file, sample)))
        except csv.Error as error:
            raise AnalysisError(f"{path}: not a table: {error}") from error


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
    units: Mapping[str, str] = MappingProxyType({}),
) -> Table:
    for values in columns.values():
        values.setflags(write=False)
    return Table(
        MappingProxyType(columns), path.name, MappingProxyType(unusable), note, begins, units
    )
