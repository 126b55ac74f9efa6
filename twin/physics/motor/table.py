"""Thrust curves as tables: two columns, time [s] and thrust [N].

The other figures of the motor are those of the motor it replaces, unless comment lines give them:
`# propellant_mass = 60 g`, `# loaded_mass = 125 g`, `# diameter = 29 mm`, `# length = 124 mm`.
"""

import csv
import math
import re
from collections.abc import Mapping
from typing import Final

from analysis.units import Kind, UnitError, is_number, quantity
from twin.physics.motor.curve import Motor
from twin.physics.motor.eng import MOST_POINTS, curve
from twin.physics.motor.entry import Entry
from twin.physics.motor.figures import MotorError

FIGURES: Final[Mapping[str, Kind]] = {
    "propellant_mass": "mass",
    "loaded_mass": "mass",
    "diameter": "length",
    "length": "length",
}
_FIGURE = re.compile(r"\s*(\w+)\s*[=:]\s*(.*?)\s*")
_SEPARATOR = re.compile(r"\s*[,;\t]\s*|\s+")
_DECIMAL = re.compile(r"([-+]?\d*),(\d+)")  # between semicolons or tabs
_OWN_UNIT = re.compile(r"(?<=[\d.])\s*(?:s|N)(?=\s*(?:[,;\t\"]|$))")  # behind a number
_OTHER_UNITS = re.compile(
    r"(?:^|[^a-z])(ms|msec|milliseconds|min|kn|mn|lbf|lbs|lb|kgf|kg|g|ozf)(?=[^a-z]|$)"
)


def entries(
    text: str, source: str, name: str, like: Mapping[str, float] | None = None
) -> list[Entry]:
    """The one motor of a table.

    Parameters
    ----------
    name : of the motor
    like : figures [SI] of the motor that it replaces, by the names of `FIGURES`

    Raises
    ------
    MotorError : not a table of two columns, or without the other figures
    """
    figures, points = dict(like or {}), []
    heading = True  # one line of column names may come first, and one of units
    for number, raw in enumerate(text.removeprefix("\ufeff").splitlines(), 1):
        where = f"{source}, line {number}"
        line, _, comment = raw.partition("#")
        _read_figure(comment, where, figures)
        if not (line := line.strip(" \t,;")):
            continue
        cells = _cells(line)
        if (heading or _are_units(cells)) and not any(map(is_number, cells)):
            _check_units(cells, where)
            heading = False
            continue
        heading = False
        points.append(_point(cells, where))
        if len(points) > MOST_POINTS:
            raise MotorError(f"{where}: more than {MOST_POINTS} points in one curve")
    return [_entry(points, figures, source, name)]


def _entry(
    points: list[tuple[float, float]], figures: Mapping[str, float], source: str, name: str
) -> Entry:
    if not points:
        raise MotorError(f"{source}: holds no points; must have two columns, time [s], thrust [N]")
    if missing := [figure for figure in FIGURES if figure not in figures]:
        raise MotorError(
            f"{source}: a thrust table has no {', '.join(missing)}; give each as a comment line"
            " such as '# propellant_mass = 60 g'"
        )
    time, thrust = curve(points)
    try:
        motor = Motor(name=name, time=time, thrust=thrust, **figures)  # type: ignore[arg-type]
    except MotorError as error:
        return Entry(name, fault=f"{source}: {error}")
    return Entry(name, motor=motor)


def _read_figure(comment: str, where: str, figures: dict[str, float]) -> None:
    match = _FIGURE.fullmatch(comment)
    if match is None or match[1] not in FIGURES:
        return
    text = match[2]
    value: object = float(text) if is_number(text) else text
    try:
        figures[match[1]] = quantity(value, FIGURES[match[1]])
    except UnitError as error:
        raise MotorError(f"{where}: {match[1]} = {text[:40]!r} {error}") from None


def _cells(line: str) -> list[str]:
    line = _OWN_UNIT.sub("", line)
    if '"' in line:
        between = next((mark for mark in ";\t" if mark in line), ",")
        cells = next(csv.reader([line], delimiter=between, skipinitialspace=True), [])
        return [_DECIMAL.sub(r"\1.\2", c) if _DECIMAL.fullmatch(c) else c for c in cells]
    if ";" not in line and "\t" not in line:
        return _SEPARATOR.split(line)
    cells = [cell.strip() for cell in re.split(r"[;\t]", line)]
    return [_DECIMAL.sub(r"\1.\2", c) if _DECIMAL.fullmatch(c) else c for c in cells]


def _are_units(cells: list[str]) -> bool:
    return all(cell.strip("()[]").lower() in {"s", "sec", "n", "newton"} for cell in cells)


def _check_units(cells: list[str], where: str) -> None:
    """Refuse columns that say they are in other units."""
    for cell in cells:
        if found := _OTHER_UNITS.search(cell.lower().replace("_", " ")):
            raise MotorError(
                f"{where}: column {cell[:40]!r} is in {found[1]}; a thrust table has time in s and"
                " thrust in N"
            )


def _point(cells: list[str], where: str) -> tuple[float, float]:
    if len(cells) != 2:
        raise MotorError(
            f"{where}: has {len(cells)} columns; a thrust table has two, time [s] and thrust [N]"
        )
    for cell in cells:
        if not is_number(cell) or not math.isfinite(float(cell)):
            raise MotorError(f"{where}: {cell[:40]!r} is not a finite number")
    return float(cells[0]), float(cells[1])
