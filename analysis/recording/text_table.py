"""Columns of numbers from a text file, and what of it was left out."""

import csv
import math
import re
from collections import Counter
from collections.abc import Iterator, Sequence
from datetime import datetime, timedelta
from itertools import chain, islice
from typing import NamedTuple

import numpy as np

from analysis.array import Array
from analysis.recording.fields import Numbers, instant, number, with_unit
from analysis.recording.table_lines import STAMP, TableLines, is_unit
from analysis.schema import AnalysisError
from analysis.units import is_number

MOST_COLUMNS = 512
MOST_ROWS = 20_000_000
# Of the rows: that may have lost bytes on a serial line. More of them are a file of another kind.
STRAY = 0.01
_REMARKS = frozenset({"comment", "comments", "kommentar"})  # last names without values below
_HALF_A_DAY = timedelta(hours=12)


class TextColumns(NamedTuple):
    """Columns by name (n,), what is wrong with some, what was left out, first instants, units."""

    columns: dict[str, Array]
    unusable: dict[str, str]
    note: str
    begins: dict[str, float]
    units: dict[str, str]


def columns_of(source: str, lines: TableLines) -> TextColumns:
    """The columns of a table.

    Raises
    ------
    AnalysisError : no header, no rows, too many of them, or rows of other lengths than the header
    csv.Error : quotes that do not end
    """
    reader = csv.reader(lines, delimiter=lines.delimiter, strict=True, skipinitialspace=True)
    names, rows = _header(source, lines, reader)
    _check_names(source, names[lines.stamped :])
    found = _Rows(source, names, lines.form)
    for row in islice(rows, MOST_ROWS + 1):
        if not any(f.strip() for f in row):
            continue
        if len(row) == len(names) + 1 and not row[-1].strip():
            row.pop()
        if len(row) == len(names) - 1 and names[-1].lower() in _REMARKS and not found.values:
            names.pop()  # as LabVIEW's, which most rows lack
        if len(row) < len(names) and found.values and not lines.ended:
            found.notes.append(f"row {lines.number}, the last, is cut off and was left out")
            break
        found.add(row, lines.number)
    return found.ended(lines.text)


def _header(
    source: str, lines: TableLines, reader: Iterator[list[str]]
) -> tuple[list[str], Iterator[list[str]]]:
    """Names of the columns, and the rows below them."""
    stamp = [STAMP] if lines.stamped else []
    if lines.names:
        return stamp + lines.names, reader
    header = next((row for row in reader if any(f.strip() for f in row)), None)
    if header is None:
        raise AnalysisError(f"{source}: empty")
    rows: Iterator[list[str]] = reader
    if all(map(is_number, header)) and (above := _above(lines, len(header))):
        header, rows = above, chain([header], reader)  # as NumPy's savetxt writes names
    names = stamp + [_bare(f) for f in header[len(stamp) :]]
    if len(names) > 1 and not names[-1]:
        names.pop()  # every line ends with a separator
    return names, rows


def _above(lines: TableLines, count: int) -> list[str]:
    """Names from the last comment that has as many words and more than units; none without one."""
    split = [comment.split(lines.delimiter) for comment in lines.comments]
    fitting = [words for words in split if len(words) == count > 1]
    named = [words for words in fitting if not all(map(is_unit, words))]
    return (named or fitting or [[]])[-1]


def _bare(name: str) -> str:
    """A name without single quotes around it."""
    name = name.strip()
    return name[1:-1].strip() if len(name) > 2 and name[0] == name[-1] == "'" else name


def _check_names(source: str, names: Sequence[str]) -> None:
    if len(names) > MOST_COLUMNS:
        raise AnalysisError(f"{source}: {len(names)} columns; {MOST_COLUMNS} at most")
    if all(map(is_number, names)):
        example = "for example by a line 't,u,y' above it"
        raise AnalysisError(
            f"{source}: the first row holds numbers; it must name the columns, {example}"
        )
    for name in names:
        if any(ord(c) < 32 or ord(c) == 127 for c in name):
            raise AnalysisError(f"{source}: a column is called {name!r}, with control characters")
        if names.count(name) > 1:
            raise AnalysisError(f"{source}: two columns are called '{name}'")


class _Rows:
    """Rows of a text file on their way to columns."""

    def __init__(self, source: str, names: list[str], form: Numbers) -> None:
        self._source, self._names, self._form = source, names, form
        self.values: list[list[float]] = []
        self.notes: list[str] = []
        self._begun: dict[str, datetime] = {}
        self._last: dict[str, datetime] = {}
        self._midnights: Counter[str] = Counter()  # that times of day have passed
        self._dates: Counter[str] = Counter()
        self._words: Counter[str] = Counter()  # fields of a column that are no numbers
        self._first_word: dict[str, tuple[int, str]] = {}  # row and text of the first
        self._units: dict[str, Counter[str]] = {}  # behind the numbers of a column
        self._stray = 0  # rows of another length
        self._first_stray: tuple[int, int] | None = None  # number and length of the first
        self._text = 0  # rows without any number

    def add(self, row: list[str], line: int) -> None:
        """Take one row that is not empty; dates count from the first of their column."""
        numbers = [number(f, self._form) for f in row]
        stamped = self._names[0] == STAMP
        if [f.strip() for f in row[stamped:]] == self._names[stamped:]:  # a board began anew
            self._text += 1
            return
        if len(row) != len(self._names):
            if any(map(math.isfinite, numbers[stamped:])):
                self._stray += 1
                self._first_stray = self._first_stray or (line, len(row))
            else:
                self._text += 1
            return
        if math.inf in numbers:
            self._read_units(row, numbers)
            self._read_dates(row, numbers)
            if len(row) > 1 and not any(map(math.isfinite, numbers[stamped:])):
                self._text += bool(self.values or self.notes)
                if not self.values and not self.notes:  # units, perhaps
                    self.notes.append(f"row {line} ({', '.join(row)}) has no number, left out")
                return
            for name, text, value in zip(self._names, row, numbers, strict=True):
                if value == math.inf:
                    self._words[name] += 1
                    self._first_word.setdefault(name, (line, text.strip()))
        self.values.append(numbers)

    def _read_units(self, row: list[str], numbers: list[float]) -> None:
        for k, name in enumerate(self._names):
            if numbers[k] == math.inf and (found := with_unit(row[k], self._form)) is not None:
                numbers[k] = found[0]
                self._units.setdefault(name, Counter())[found[1]] += 1

    def _read_dates(self, row: list[str], numbers: list[float]) -> None:
        for k, name in enumerate(self._names):
            if numbers[k] == math.inf and (moment := instant(row[k])) is not None:
                at = moment.at
                if not moment.dated and self._last.get(name, at) - at > _HALF_A_DAY:
                    self._midnights[name] += 1
                self._last[name] = at
                # differences are exact to the microsecond, seconds since 1970 are not
                since = at - self._begun.setdefault(name, at)
                numbers[k] = (since + self._midnights[name] * 2 * _HALF_A_DAY).total_seconds()
                self._dates[name] += 1

    def ended(self, text: int) -> TextColumns:
        """All columns, after `text` lines that were no rows."""
        few = STRAY * len(self.values)
        if self._first_stray and self._stray > few:
            line, fields = self._first_stray
            raise AnalysisError(
                f"{self._source}: row {line} has {fields} fields, the header {len(self._names)}"
            )
        if len(self.values) > MOST_ROWS:
            raise AnalysisError(f"{self._source}: more than {MOST_ROWS} rows")
        if not self.values:
            raise AnalysisError(
                f"{self._source}: a header but no rows of numbers; a line must name the columns, as"
                " 't,u,y', and those below it hold a number for each, as '0.01,3.2,2.9'"
            )
        if self._first_stray:
            line, fields = self._first_stray
            of = f"the first row {line} with {fields} fields for {len(self._names)}"
            self.notes.append(f"{_counted(self._stray, 'row')} of another length left out, {of}")
        if text + self._text:
            self.notes.append(f"{_counted(text + self._text, 'line')} of text left out")
        table = np.array(self.values)
        unusable = self._unusable(table, few)
        columns = {name: table[:, k] for k, name in enumerate(self._names)}
        begins = {name: moment.timestamp() for name, moment in self._begun.items()}
        units = {n: next(iter(u)) for n, u in self._units.items() if len(u) == 1}
        return TextColumns(columns, unusable, "; ".join(self.notes), begins, units)

    def _unusable(self, table: Array, few: float) -> dict[str, str]:
        """What is wrong with columns; in others single words become missing values."""
        found: dict[str, str] = {}
        for k, name in enumerate(self._names):
            if name in self._words:
                line, text = self._first_word[name]
                infinite = text.lstrip("+-").lower() in {"inf", "infinity"}
                if self._words[name] <= few and not infinite:
                    table[np.isinf(table[:, k]), k] = math.nan
                    where = f"{_counted(self._words[name], 'field')} of '{name}'"
                    first = f"the first {text[:40]!r} in row {line}"
                    self.notes.append(f"no number in {where}, taken as missing, {first}")
                else:
                    fault = "infinite" if infinite else f"{text[:40]!r} is not a number"
                    fault += _remedy(text)
                    found[name] = f"{self._source}: row {line}, column '{name}': {fault}"
            if len(units := self._units.get(name, Counter())) > 1:
                both = " and ".join(sorted(units))
                found[name] = f"{self._source}: column '{name}' has values in {both}; give one unit"
            if name in self._dates and self._dates[name] < np.isfinite(table[:, k]).sum():
                found.setdefault(name, f"{self._source}: column '{name}' holds dates and numbers")
        return found


def _remedy(text: str) -> str:
    """What helps where a field is no number."""
    if match := re.match(r"[-+]?[\d.,]*\d\s*([^\W\d_]\S{0,9})$", text):
        return f"; of units behind numbers {match[1]!r} is none that is known"
    return "; leave the field empty where there is no reading"


def _counted(count: int, what: str) -> str:
    return f"{count} {what}{'s' * (count != 1)}"
