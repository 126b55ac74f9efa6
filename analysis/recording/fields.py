"""Fields of a text table: numbers as people and programs write them, units, instants."""

import math
import re
from collections.abc import Iterable
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from typing import NamedTuple

MISSING = frozenset({
    "", "na", "n/a", "#n/a", "null", "none", "nil", "-", "--", "---", "----", "-.-", "--.-", "-.--",
    "--.--", "-nan", "nan(ind)", "-nan(ind)", "1.#ind", "-1.#ind", "1.#qnan", "-1.#qnan", "1.#r",
    "ovf", "ovl", "o.l", "overflow", "overload", "error", "err", "invalid", "missing", "undefined",
    "?", "??", "???", ".", "..", "...", "*", "**", "***", "****", "*****", "<na>",
    "#nv", "#wert!", "#value!", "#div/0!", "#num!", "#zahl!", "#ref!",
})  # fmt: skip  # float() reads "nan" itself
LONGEST_FIELD = 256  # characters
# unit as it may stand behind a number → its name; of a rate that of its angle
UNITS = {
    "s": "s", "sec": "s", "seconds": "s", "ms": "ms", "msec": "ms", "us": "us", "µs": "us",
    "μs": "us", "ns": "ns", "rad": "rad", "mrad": "mrad", "deg": "deg", "degree": "deg",
    "degrees": "deg", "°": "deg", "turn": "turn", "turns": "turn", "rev": "turn", "rad/s": "rad",
    "mrad/s": "mrad", "deg/s": "deg", "°/s": "deg", "dps": "deg", "%": "percent",
    "percent": "percent", "counts": "counts", "lsb": "counts",
}  # fmt: skip
_FORTRAN = re.compile(r"[-+]?\d*\.?\d+[dD][-+]?\d+")
_WITH_UNIT = re.compile(r"([-+\u2212]?[\d.,]*\d[.,]?(?:[eE][-+]?\d+)?)\s*([A-Za-z°µμ%][a-z/]*)")
# groups of three digits behind commas or dots; of marks that are never decimal
_GROUPED = {
    mark: re.compile(rf"[-+]?[1-9]\d{{0,2}}(?:{mark}\d{{3}})+(?:{decimal}\d*)?")
    for mark, decimal in ((",", r"\."), (r"\.", ","))
}
_THOUSANDS = re.compile(r"[-+]?[1-9]\d{0,2}(,\d{3})+")  # or a decimal comma
_DOTTED = re.compile(r"[-+]?[1-9]\d{0,2}(\.\d{3})+")  # or a decimal point
_APART = re.compile(r"[-+]?\d{1,3}(?:['’ \u00a0\u202f\u2009]\d{3})+(?:[.,]\d*)?")
_MARKS = str.maketrans("", "", "'’ \u00a0\u202f\u2009")

_CLOCK = re.compile(
    r"(?P<date>.*?)[T ]?\s*(?:(?P<hours>\d{1,5}):)?(?P<minutes>\d{1,2}):(?P<seconds>\d{2})"
    r"(?:[.,:](?P<part>\d+))?\s*(?P<half>[AaPp]\.?[Mm]\.?)?\s*(?P<zone>Z|UTC|[-+]\d{2}:?\d{2})?"
)
_YEAR_FIRST = re.compile(r"(\d{4})([-/.])(\d{1,2})\2(\d{1,2})")
_DAY_FIRST = re.compile(r"(\d{1,2})\.(\d{1,2})\.(\d{4}|\d{2})")
_NAMED = re.compile(r"(\d{1,2})[- ]([A-Za-z]{3})[a-z]*[- ,]+(\d{4}|\d{2})")
_DAYS = re.compile(r"(\d{1,5}) days?,?")  # of a duration
# either order of day and month, or no year: what is left is a time of day
_UNCLEAR = re.compile(
    r"\d{1,2}([-/])\d{1,2}\1(?:\d{4}|\d{2}),?|(?:[A-Za-z]{3},? )?[A-Za-z]{3} +\d{1,2}"
)
_MONTHS = ("jan", "feb", "mar", "apr", "may", "jun", "jul", "aug", "sep", "oct", "nov", "dec")
_BEGIN = datetime(1970, 1, 1, tzinfo=UTC)


@dataclass(frozen=True, slots=True)
class Numbers:
    """How the numbers of a file are written.

    Attributes
    ----------
    decimal_comma : whether they may have one
    thousands : what stands between their thousands, `,` or `.`; empty where nothing does
    """

    decimal_comma: bool = False
    thousands: str = ""

    @classmethod
    def of(cls, fields: Iterable[str], *, split_by_commas: bool) -> "Numbers":
        """How a file writes them, by the fields of its first lines.

        Commas are decimal where any is not between thousands, or where no number has a point. The
        other mark stands between thousands where it never stands elsewhere.
        """
        commas, points, grouped = False, False, True
        for field in fields:
            text = field.strip()
            if "," in text and "." in text:
                commas = commas or bool(_GROUPED[r"\."].fullmatch(text))
                points = points or bool(_GROUPED[","].fullmatch(text))
            elif ("," in text or "." in text) and math.isfinite(number(text, cls(True))):
                commas = commas or ("," in text and not _THOUSANDS.fullmatch(text))
                points = points or "." in text
                grouped = grouped and ("." not in text or bool(_DOTTED.fullmatch(text)))
        if commas:
            return cls(True, "." if grouped else "")
        if points:
            return cls(False, ",")
        return cls(not split_by_commas)


PLAIN = Numbers()


class Moment(NamedTuple):
    """An instant; of a time of day the day is that of 1970 and `dated` is false."""

    at: datetime
    dated: bool


def number(text: str, form: Numbers = PLAIN) -> float:
    """A field's value: NaN where it is empty, infinite where it is no number."""
    text = text.strip()
    if text.lower() in MISSING:
        return math.nan
    if len(text) > LONGEST_FIELD or "_" in text or text.endswith(","):
        return math.inf
    if form.thousands and form.thousands in text:
        text = _ungrouped(text, form.thousands)
    try:
        value = float(text.replace(",", ".") if form.decimal_comma else text)
    except ValueError:
        return _unusual(text, form)
    return math.inf if math.isinf(value) else value


def _ungrouped(text: str, mark: str) -> str:
    whole = _GROUPED["," if mark == "," else r"\."].fullmatch(text)
    return text.replace(mark, "") if whole else text


def _unusual(text: str, form: Numbers) -> float:
    """Value of what float() does not take."""
    if text[:1] == text[-1:] == "'" and len(text) > 1:
        return number(text[1:-1], form)
    if "\u2212" in text:  # the minus of typography
        return number(text.replace("\u2212", "-"), form)
    if _FORTRAN.fullmatch(text):
        return number(text.lower().replace("d", "e"), form)
    if _APART.fullmatch(text):
        return number(text.translate(_MARKS), form)
    return math.inf


def with_unit(text: str, form: Numbers = PLAIN) -> tuple[float, str] | None:
    """Value of a field and the unit behind it, one of the values of `UNITS`; None of others."""
    text = text.strip()
    match = _WITH_UNIT.fullmatch(text) if len(text) <= LONGEST_FIELD else None
    unit = UNITS.get(match[2].lower()) if match else None
    if match is None or unit is None:
        return None
    value = number(match[1], form)
    return (value, unit) if math.isfinite(value) else None


def instant(text: str) -> Moment | None:
    """Instant of a date and time, of a time of day, or a duration; None where it is none.

    Dates are those of ISO 8601 and of `27.11.2026`, `2026/11/27` and `27-Nov-2026`; of others,
    whose order of day and month is open, the time of day counts. A time of day may lack its hours
    where it has a fraction: 01:02.5 is 62.5 s.
    """
    text = text.strip()
    if len(text) > LONGEST_FIELD:
        return None
    if ":" not in text:
        day = _day(text)
        return None if day is None else Moment(day, True)
    match = _CLOCK.fullmatch(text)
    if match is None or (match["hours"] is None and (match["part"] is None or match["date"])):
        return None
    hours, seconds = int(match["hours"] or 0), int(match["seconds"])
    if int(match["minutes"]) > 59 or seconds > 60:
        return None
    if match["half"]:
        if not 1 <= hours <= 12:
            return None
        hours = hours % 12 + 12 * (match["half"][0] in "pP")
    # integers: a sum of floating seconds is rounded differently in every row
    micro = int(f"{match['part'] or '0':0<6}"[:6])
    since = timedelta(
        hours=hours, minutes=int(match["minutes"]), seconds=seconds, microseconds=micro
    )
    zone = _zone(match["zone"] or "")
    date = match["date"].strip()
    if not date or _UNCLEAR.fullmatch(date):
        return Moment(_BEGIN + since - zone, hours > 23)
    day = _day(date)
    if day is None or (hours > 23 and not _DAYS.fullmatch(date)):
        return None
    try:
        return Moment(day + since - zone, True)
    except OverflowError:
        return None


def _zone(text: str) -> timedelta:
    if text in {"", "Z", "UTC"}:
        return timedelta()
    digits = text[1:].replace(":", "")
    ahead = timedelta(hours=int(digits[:2]), minutes=int(digits[2:]))
    return -ahead if text[0] == "-" else ahead


def _day(text: str) -> datetime | None:
    """Midnight of a date, or of the first day and some days of a duration."""
    if match := _YEAR_FIRST.fullmatch(text):
        parts = (match[1], match[3], match[4])
    elif match := _DAY_FIRST.fullmatch(text):
        parts = (match[3], match[2], match[1])
    elif match := _NAMED.fullmatch(text):
        month = match[2].lower()
        if month not in _MONTHS:
            return None
        parts = (match[3], str(_MONTHS.index(month) + 1), match[1])
    elif match := _DAYS.fullmatch(text):
        return _BEGIN + timedelta(days=int(match[1]))
    else:
        return None
    year = int(parts[0]) + (2000 if len(parts[0]) < 4 else 0)
    try:
        return datetime(year, int(parts[1]), int(parts[2]), tzinfo=UTC)
    except ValueError:
        return None
