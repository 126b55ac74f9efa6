"""Lines of a text file as lines of a table: of programs, serial monitors, plotters, and JSON."""

import csv
import json
import math
import re
from collections import Counter, deque
from collections.abc import Callable, Iterable, Iterator, Sequence

from analysis.recording.fields import UNITS, Numbers, instant, number, with_unit
from analysis.units import is_number

SAMPLE = 8192  # characters, from which the form of a file follows
STAMP = "monitor_time"  # column of a serial monitor's stamps
MOST_COMMENTS = 20  # of which one may name the columns
_FORMS = (Numbers(True, "."), Numbers(False, ","))
_LONGEST_JSON = 4096  # characters
_SEPARATOR = re.compile(r"\ufeff?sep=(.)\s*$")  # first line of tables that Excel is to open
_COMMENTS = ("#", "%", "//")
# Arduino's Serial Monitor with its stamps; its plotter takes labels before the values
_STAMPED = re.compile(r"(\d{1,2}:\d{2}:\d{2}(?:\.\d+)?) -> ?")
_LABELLED = re.compile(
    r"([A-Za-z_][^:=,\t\n]{0,63})[:=]\s*([-+.\dA-Za-z°µμ%/]{1,32})\s*(?:[,;\t ]\s*|$)"
)
_UNITS = UNITS.keys() | frozenset({
    "", "-", "1", "v", "mv", "volt", "volts", "a", "ma", "m", "mm", "m/s", "m/s²", "m/s2", "g", "n",
})  # fmt: skip  # of a row below the names
_RULE = re.compile(r"[\s|:=+-]*-{3}[\s|:=+-]*")  # below the names of Markdown and Org tables
_DEEPEST = 3  # objects of JSON in objects


class TableLines:
    """The lines of a file, each as a line of a table; an empty one where it belongs to none.

    Parameters
    ----------
    sample : the first `SAMPLE` characters of the file

    Attributes
    ----------
    delimiter : between the fields of a line that is given
    form : how numbers are written; between commas, a decimal comma is in quotes
    stamped : whether a serial monitor's stamps stand before the lines; they are the first field
    names : of the fields, where every line has them
    number : of the last line
    comments : the last of them, without their marks
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
        if self.delimiter == "|":
            lines = ["" if _RULE.fullmatch(line) else line for line in lines]
        fields = (f for line in lines for f in _fields(line, self.delimiter))
        self.form = Numbers.of(fields, split_by_commas=self.delimiter == ",")
        self._begin = 0 if self.names else _first_line(lines, self.delimiter)
        self._file = iter(file)
        self.comments: deque[str] = deque(maxlen=MOST_COMMENTS)
        self.number, self.ended, self.text = 0, True, 0

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
        if row is None or (self.delimiter == "|" and _RULE.fullmatch(line)):
            self.text += row is None and bool(line.strip())
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
        self.comments.append(self._aligned(line).lstrip("#%/ ").rstrip())
        return "\n"

    def _aligned(self, line: str) -> str:
        """One blank between columns that are aligned by blanks; no frame around those of `|`."""
        if self.delimiter == "|" and line.lstrip().startswith("|"):
            return line.strip().removeprefix("|").removesuffix("|") + "\n"
        return " ".join(line.split()) if self.delimiter == " " else line


def _mostly(holds: Callable[[str], bool], lines: Sequence[str]) -> bool:
    held = [holds(line) for line in lines if line.strip()]
    return 2 * sum(held) > len(held)


def _labelled(line: str) -> dict[str, str] | None:
    """Names and values of a line that states both; None of any other."""
    line = line.strip()
    if line.startswith(("{", "[{")):
        return _of_json(line)
    found: dict[str, str] = {}
    at = 0
    while at < len(line):
        match = _LABELLED.match(line, at)
        if match is None or _value(match[2]) == math.inf:
            return None
        found[match[1].strip()] = match[2]
        at = match.end()
    return found or None


def _of_json(line: str) -> dict[str, str] | None:
    """Numbers of an object by name; also of a line of a list of objects, and of strings."""
    line = line.removeprefix("[").removesuffix("]").removesuffix(",")
    try:
        found = json.loads(line) if len(line) <= _LONGEST_JSON else None
    except (ValueError, RecursionError):
        return None
    return _leaves(found) or None if isinstance(found, dict) else None


def _leaves(found: dict[str, object], before: str = "", depth: int = 1) -> dict[str, str]:
    """Numbers of an object and of those in it, named as `data.u` and `angles[0]`."""
    leaves: dict[str, str] = {}
    for key, value in found.items():
        name = f"{before}{key}"
        items: dict[str, object] = {name: value}
        if isinstance(value, list):
            items = {f"{name}[{k}]": v for k, v in enumerate(value)}
        elif isinstance(value, dict) and depth < _DEEPEST:
            leaves |= _leaves(value, f"{name}.", depth + 1)
        for own, v in items.items():
            if v is None:
                leaves[own] = ""
            elif type(v) in (int, float):
                leaves[own] = repr(v)
            elif isinstance(v, str) and len(v) < 40 and (is_number(v) or instant(v)):
                leaves[own] = v
    return leaves


def _fields(line: str, delimiter: str) -> list[str]:
    line = line.strip(" ")
    if '"' in line:
        fields = next(csv.reader([line], delimiter=delimiter, skipinitialspace=True), [])
    else:
        fields = line.split(delimiter)
    return [f.strip().strip('"') for f in fields if f or delimiter != " "]


def _numbers(line: str, delimiter: str) -> int:
    """How many fields of a line are numbers or instants."""
    return sum(map(_is_value, _fields(line, delimiter)))


def _is_value(field: str) -> bool:
    """Whether a field is a number with whatever marks, or an instant."""
    if any(math.isfinite(number(field, form)) for form in _FORMS):
        return True
    return with_unit(field, _FORMS[0]) is not None or instant(field) is not None


def _value(field: str) -> float:
    """A field's value, NaN where it is empty, infinite where it is no number."""
    found = with_unit(field)
    return found[0] if found else number(field)


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
    at = len(above) - 1 - above[::-1].index(names[-1])
    while (
        at and above[at - 1] in names and all(map(is_unit, _fields(lines[above[at]], delimiter)))
    ):  # rows of units, below the line of names
        at -= 1
    return above[at]


def is_unit(field: str) -> bool:
    """Whether a field is a unit, or anything in brackets."""
    field = field.strip()
    return field.strip("()[]").lower() in _UNITS or f"{field[:1]}{field[-1:]}" in {"()", "[]"}
