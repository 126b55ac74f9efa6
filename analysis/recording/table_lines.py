"""Lines of a text file as lines of a table: of programs, serial monitors, plotters, and JSON."""

import csv
import json
import math
import re
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from datetime import UTC, datetime

SAMPLE = 8192  # characters, from which the form of a file follows
STAMP = "monitor_time"  # column of a serial monitor's stamps
MISSING = frozenset({
    "", "na", "n/a", "#n/a", "null", "none", "-", "--", "---", "nan(ind)", "-nan(ind)", "ovf",
})  # fmt: skip  # float() reads "nan" itself
LONGEST_FIELD = 256  # characters
_LONGEST_JSON = 4096  # characters
_SEPARATOR = re.compile(r"\ufeff?sep=(.)\s*$")  # first line of tables that Excel is to open
_COMMENTS = ("#", "%", "//")
# Arduino's Serial Monitor with its stamps; its plotter takes labels before the values
_STAMPED = re.compile(r"(\d{1,2}:\d{2}:\d{2}(?:\.\d+)?) -> ?")
_LABELLED = re.compile(r"([A-Za-z_][^:=,\t\n]{0,63})[:=]\s*([-+.\dA-Za-z]{1,32})\s*(?:[,\t ]\s*|$)")
_UNITS = frozenset({
    "", "-", "1", "%", "s", "sec", "seconds", "ms", "us", "µs", "rad", "mrad", "deg", "degree",
    "degrees", "°", "turn", "rad/s", "deg/s", "°/s", "v", "mv", "volt", "volts", "a", "ma",
    "percent", "counts", "lsb", "m", "mm", "m/s", "m/s²", "m/s2", "g", "n",
})  # fmt: skip  # of a row below the names
_FORTRAN = re.compile(r"[-+]?\d*\.?\d+[dD][-+]?\d+")
_THOUSANDS = re.compile(r"[-+]?[1-9]\d{0,2}(,\d{3})+")  # or a decimal comma
_DATE = re.compile(r"\d{4}-\d{2}-\d{2}([T ].*)?")
_TIME = re.compile(r"\d{1,2}:\d{2}:\d{2}([.,:]\d+)?(Z|[-+]\d{2}:?\d{2})?")
_MINUTES = re.compile(r"\d{1,2}:\d{2}[.,]\d+")  # and seconds, as Excel writes them


class TableLines:
    """The lines of a file, each as a line of a table; an empty one where it belongs to none.

    Parameters
    ----------
    sample : the first `SAMPLE` characters of the file

    Attributes
    ----------
    delimiter : between the fields of a line that is given
    decimal_comma : whether numbers may have one; between commas, in quotes
    stamped : whether a serial monitor's stamps stand before the lines; they are the first field
    names : of the fields, where every line has them
    number : of the last line
    comment : the last comment, without its mark
    ended : whether the last line has its end
    text : lines of the file that belong to no table
    """

    def __init__(self, file: Iterable[str], sample: str) -> None:
        lines = re.split(r"\r\n?|\n", sample)  # as the file's lines, which other marks do not end
        if len(sample) >= SAMPLE and len(lines) > 1:
            lines.pop()  # perhaps cut
        self.stamped = _mostly(lambda line: _STAMPED.match(line) is not None, lines)
        if self.stamped:
            lines = [_STAMPED.sub("", line, count=1) for line in lines]
        self.names: list[str] = []
        if _mostly(lambda line: bool(_labelled(line)), lines):
            found = Counter(tuple(f) for f in map(_labelled, lines) if f)
            self.names = list(found.most_common(1)[0][0])
        self.delimiter = "," if self.names else _delimiter(lines)
        self.decimal_comma = _commas_are_decimal(lines, self.delimiter)
        self._begin = 0 if self.names else _first_line(lines, self.delimiter)
        self._file = iter(file)
        self.number, self.comment, self.ended, self.text = 0, "", True, 0

    def __iter__(self) -> Iterator[str]:
        return self

    def __next__(self) -> str:
        line = next(self._file)
        self.number += 1
        self.ended = line.endswith(("\n", "\r"))
        if _SEPARATOR.match(line):
            return "\n"
        if line.startswith(_COMMENTS):
            return self._commented(line)
        row = self._row(line) if self.number > self._begin else None
        if row is None:
            self.text += bool(line.strip())
            return "\n"
        return row

    def _row(self, line: str) -> str | None:
        stamp = ""
        if self.stamped:
            match = _STAMPED.match(line)
            if match is None:
                return None
            stamp, line = match[1] + self.delimiter, line[match.end() :]
            if line.startswith(_COMMENTS):
                return self._commented(line)
        if self.names:
            found = _labelled(line)
            if found is None:
                return None
            line = ",".join(found.get(name, "") for name in self.names)
            if not found.keys() >= set(self.names):
                line += ",0,0"  # a row of another length
        return stamp + self._aligned(line) if line.strip() else line

    def _commented(self, line: str) -> str:
        self.comment = self._aligned(line).lstrip("#%/ ").rstrip()
        return "\n"

    def _aligned(self, line: str) -> str:
        """One blank between columns that are aligned by blanks."""
        return " ".join(line.split()) if self.delimiter == " " else line


def number(text: str, *, decimal_comma: bool) -> float:
    """A field's value: NaN where it is empty, infinite where it is no number."""
    text = text.strip()
    if text.lower() in MISSING:
        return math.nan
    text = text.replace("\u2212", "-")  # the minus of typography
    if len(text) > LONGEST_FIELD or "_" in text or text.endswith(","):
        return math.inf
    try:
        value = float(text.replace(",", ".") if decimal_comma else text)
    except ValueError:
        if _FORTRAN.fullmatch(text):
            return number(text.lower().replace("d", "e"), decimal_comma=decimal_comma)
        return math.inf
    return math.inf if math.isinf(value) else value


def instant(text: str) -> datetime | None:
    """Instant of an ISO 8601 date and time, or of a time of day; None where it is neither.

    A time of day may lack its hours where it has a fraction: 01:02.5 is 62.5 s.
    """
    text = text.strip()
    # fromisoformat takes "10,000" for ten o'clock, and "00:01.5" for a minute past midnight
    if _MINUTES.fullmatch(text):
        text = f"00:{text}"
    if _TIME.fullmatch(text):
        text = f"1970-01-01T{'0' * (text[1] == ':')}{text}"
    elif not _DATE.fullmatch(text):
        return None
    try:
        moment = datetime.fromisoformat(text)
    except ValueError:
        return None
    return moment.replace(tzinfo=moment.tzinfo or UTC)


def _mostly(holds: Callable[[str], bool], lines: Sequence[str]) -> bool:
    held = [holds(line) for line in lines if line.strip()]
    return 2 * sum(held) > len(held)


def _labelled(line: str) -> dict[str, str] | None:
    """Names and values of a line that states both; None of any other."""
    line = line.strip()
    if line.startswith("{"):
        return _of_json(line)
    found: dict[str, str] = {}
    at = 0
    while at < len(line):
        match = _LABELLED.match(line, at)
        if match is None or math.isinf(number(match[2], decimal_comma=False)):
            return None
        found[match[1].strip()] = match[2]
        at = match.end()
    return found or None


def _of_json(line: str) -> dict[str, str] | None:
    try:
        found = json.loads(line) if len(line) <= _LONGEST_JSON else None
    except (ValueError, RecursionError):
        return None
    if not isinstance(found, dict):
        return None
    numbers = {k: v for k, v in found.items() if v is None or type(v) in (int, float)}
    return {k: "" if v is None else repr(v) for k, v in numbers.items()} or None


def _fields(line: str, delimiter: str) -> list[str]:
    line = line.strip(" ")
    if '"' in line:
        fields = next(csv.reader([line], delimiter=delimiter, skipinitialspace=True), [])
    else:
        fields = line.split(delimiter)
    return [f.strip().strip('"') for f in fields if f or delimiter != " "]


def _numbers(line: str, delimiter: str) -> int:
    """How many fields of a line are numbers or instants."""
    return sum(
        math.isfinite(number(f, decimal_comma=True)) or instant(f) is not None
        for f in _fields(line, delimiter)
    )


def _delimiter(lines: Sequence[str]) -> str:
    """The separator that makes most numbers; but between commas they may have a comma."""
    lines = [line for line in lines if line.strip() and not line.startswith(_COMMENTS)]
    first = lines[0] if lines else ""
    if stated := _SEPARATOR.match(first):
        return stated[1]
    candidates = (";", "\t", "|", ",", " ")
    alike = {c: Counter(n for line in lines if (n := _numbers(line, c)) > 1) for c in candidates}
    counts = {c: max((n * k for n, k in found.items()), default=0) for c, found in alike.items()}
    if any(counts.values()):
        return max(candidates, key=lambda c: counts[c])
    return next((c for c in candidates if c in first.strip(" \r\n")), ",")


def _first_line(lines: Sequence[str], delimiter: str) -> int:
    """Lines before the first of a table: names, perhaps with units below, right above the rows."""
    rows = [(_numbers(line, delimiter), len(_fields(line, delimiter))) for line in lines]
    usual = Counter(row for row in rows if row[0] > 1).most_common(1)
    if not usual:
        return 0
    begin, wide = rows.index(usual[0][0]), usual[0][0][1]
    above = [k for k in range(begin) if lines[k].strip() and not lines[k].startswith(_COMMENTS)]
    names = [k for k in above if rows[k] == (0, wide)]
    if not names:  # perhaps one separator more or less, as at the end of every row
        near = above[-1:] if above and abs(rows[above[-1]][1] - wide) < 2 else []
        return (near or [begin])[0]
    units = all(map(_is_unit, _fields(lines[names[-1]], delimiter)))
    before = [k for k in above if k < names[-1]][-1:]  # the line above them
    return before[0] if units and before and before[0] in names else names[-1]


def _is_unit(field: str) -> bool:
    return field.strip("()[]").lower() in _UNITS or f"{field[:1]}{field[-1:]}" in {"()", "[]"}


def _commas_are_decimal(lines: Sequence[str], delimiter: str) -> bool:
    """Whether numbers have decimal commas, not commas between their thousands."""
    fields = [f for line in lines if "," in line for f in _fields(line, delimiter)]
    numbers = [f for f in fields if math.isfinite(number(f, decimal_comma=True))]
    if any("," in f and not _THOUSANDS.fullmatch(f) for f in numbers):
        return True
    return delimiter != "," and not any("." in f for f in numbers)
