"""RASP `.eng` files: comment lines, a header line, lines of time and thrust; several to a file.

Format: thrustcurve.org, "RASP file format"; the curve starts at (0, 0) without stating it and ends
at zero thrust. Also read: comments anywhere, lines of comment that begin with # or //, a byte order
mark, any line ends, decimal commas, a comma between time and thrust, points given twice, further
points of zero thrust after the end.
"""

import math
import re
from dataclasses import dataclass, field
from typing import Final

from analysis.units import is_number
from twin.physics.motor.curve import Motor
from twin.physics.motor.entry import Entry
from twin.physics.motor.figures import MotorError

MOST_POINTS: Final = 20_000  # per motor
MOST_MOTORS: Final = 10_000
HEADER: Final = "name diameter[mm] length[mm] delays propellant[kg] loaded[kg] maker"
HEADER_WORDS: Final = 7
_DECIMAL: Final = re.compile(r"(?<=\s)([-+]?\d*),(?=\d+(?:\s|$))")


def parse(text: str, source: str = "motor") -> list[Motor]:
    """All motors of an `.eng` text; `source` names it in errors.

    Raises
    ------
    MotorError : the first motor that is malformed, with the line
    """
    motors = []
    for entry in entries(text, source):
        if entry.motor is None:
            raise MotorError(entry.fault)
        motors.append(entry.motor)
    return motors


def entries(text: str, source: str = "motor") -> list[Entry]:
    """All motors of an `.eng` text in order; one that is malformed spoils no other.

    Raises
    ------
    MotorError : the text holds no motor, or too many
    """
    drafts: list[_Draft] = []
    text = text.removeprefix("\ufeff").rstrip("\0\x1a")  # ends of files on old systems
    if "\0" in text:
        raise MotorError(f"{source}: holds zero bytes; not a text file")
    for number, raw in enumerate(text.splitlines(), 1):
        words = _DECIMAL.sub(r"\1.", f" {raw.partition(';')[0]}").split()
        if not words or words[0].startswith(("#", "//")):
            continue
        where = f"{source}, line {number}"
        if not drafts or _starts_motor(words):
            drafts.append(_Draft(words, where))
        else:
            drafts[-1].add([words[0].rstrip(","), *words[1:]], where)
        if len(drafts) > MOST_MOTORS:
            raise MotorError(f"{where}: more than {MOST_MOTORS} motors in one file")
    if not drafts:
        raise MotorError(f"{source}: holds no motor; a header line reads {HEADER}")
    return [draft.entry(source) for draft in drafts]


def _starts_motor(words: list[str]) -> bool:
    """Whether a line is a header, also a malformed one: a point begins with a number."""
    if len(words) >= HEADER_WORDS:
        return True
    return not (
        is_number(words[0].rstrip(",")) or (words[0][0] in "+-.0123456789" and len(words) < 4)
    )


@dataclass
class _Draft:
    """A motor while its lines are read; the first fault is kept."""

    header: list[str]
    where: str
    points: list[tuple[float, float]] = field(default_factory=list)
    fault: str = ""

    def __post_init__(self) -> None:
        if len(self.header) < HEADER_WORDS:
            self.fault = (
                f"{self.where}: a header line has {HEADER_WORDS} words, {HEADER};"
                f" here are {len(self.header)}: {_quote(self.header)}"
            )
            return
        for k in (1, 2, 4, 5):
            self._number(self.header[k], self.where)

    def add(self, words: list[str], where: str) -> None:
        """Take a line of the curve."""
        if self.fault:
            return
        if len(words) != 2:
            self.fault = (
                f"{where}: expected time [s] and thrust [N], found {len(words)} words:"
                f" {_quote(words)}"
            )
        elif len(self.points) >= MOST_POINTS:
            self.fault = f"{where}: more than {MOST_POINTS} points in one curve"
        else:
            self.points.append((self._number(words[0], where), self._number(words[1], where)))

    def _number(self, word: str, where: str) -> float:
        if not is_number(word):
            self.fault = self.fault or (
                f"{where}: {_quote([word])} is not a number; a header reads {HEADER}, names without"
                " blanks and numbers without units"
                if where == self.where
                else f"{where}: {_quote([word])} is not a number; time is in s and thrust in N,"
                " without units"
            )
            return math.nan
        if not math.isfinite(float(word)):
            self.fault = self.fault or f"{where}: {word[:40]} is not finite"
        return float(word)

    def entry(self, source: str) -> Entry:
        """The motor, or why there is none."""
        name, maker = self.header[0][:60], " ".join(self.header[6:])[:60]
        if self.fault:
            return Entry(name, maker, fault=self.fault)
        try:
            return Entry(name, maker, self._motor(name))
        except MotorError as error:
            return Entry(name, maker, fault=f"{source}: {error}")

    def _motor(self, name: str) -> Motor:
        if not self.points:
            raise MotorError(
                f"motor {name!r}: the thrust curve never ends: the header is its last line;"
                " points of time [s] and thrust [N] must follow, the last with a thrust of 0"
            )
        time, thrust = curve(self.points)
        return Motor(
            name=name,
            time=time,  # type: ignore[arg-type]
            thrust=thrust,  # type: ignore[arg-type]
            propellant_mass=float(self.header[4]),
            loaded_mass=float(self.header[5]),
            diameter=float(self.header[1]) * 1e-3,
            length=float(self.header[2]) * 1e-3,
        )


def curve(points: list[tuple[float, float]]) -> tuple[list[float], list[float]]:
    """Times [s] and thrusts [N] from (0, 0) or the first point, without zeros after the end."""
    last = max((k for k, (_, thrust) in enumerate(points) if thrust != 0), default=0)
    points = points[: last + 2]
    kept = [p for p, before in zip(points, [None, *points], strict=False) if p != before]
    if kept and kept[0][0] > 0:
        kept = [(0.0, 0.0), *kept]
    return [t for t, _ in kept], [f for _, f in kept]


def _quote(words: list[str]) -> str:
    text = " ".join(words)
    return repr(text if len(text) <= 60 else text[:57] + "...")
