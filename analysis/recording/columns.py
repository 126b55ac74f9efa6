"""Measurements from tables, by the names of their columns."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType
from typing import Literal

import numpy as np

from analysis.array import Array
from analysis.recording import tables
from analysis.recording.arrays import measurement
from analysis.recording.measurements import (
    COMMAND,
    Initial,
    InputStamps,
    Measurement,
    check_stamps,
)
from analysis.recording.series import Recording, TimeSeries
from analysis.recording.stamps import TURN, turn_of, unwrapped
from analysis.schema import AnalysisError, unknown

UNITS: Mapping[str, float] = MappingProxyType(
    {
        "rad": 1.0, "mrad": 1e-3, "deg": math.pi / 180.0, "turn": 2.0 * math.pi,
        "us": 1.0, "percent": 1.0, "counts": 1.0, "1": 1.0,
    }
)  # fmt: skip
NO_ANGLES = ("us", "percent", "counts", "1")  # pulse width [µs], of full travel, of a converter
FARTHEST = math.pi / 2  # rad; no gimbal is commanded so far
_TIMES: Mapping[str, float] = MappingProxyType({"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9})
_SLOWEST = 0.5  # s between samples; no gimbal's motion is sampled that seldom


@dataclass(frozen=True, slots=True)
class Columns:
    """Which columns of a table hold what, and in which units.

    Attributes
    ----------
    time : column of stamps
    inputs, angle, rate : columns of commands, potentiometer, and gyro (per second)
    unit : of angle, rate and command: one of `UNITS`; `rad` without it
    input_unit : of the command, where it is another
    time_scale : seconds per unit of the time column (1e-3 for milliseconds); 1 without it
    commands : table of the commands with a time column of the same name; without it they change
        at the sample that first shows them
    stamps : without `commands`, what is known of that sample; see `measurement`
    before : the command in force before the first stamp, in its unit

    Raises
    ------
    AnalysisError : one column of a table for two purposes
    """

    time: str
    inputs: tuple[str, ...]
    angle: tuple[str, ...] = ()
    rate: tuple[str, ...] = ()
    unit: str | None = None
    input_unit: str | None = None
    time_scale: float | None = None
    commands: Path | None = None
    stamps: InputStamps = "shown"
    before: tuple[float, ...] | None = None

    def __post_init__(self) -> None:
        """Refuse what a slip of the pen makes: a model of a column from itself fits well."""
        here = (self.time, *self.angle, *self.rate)
        commanded = (self.time, *self.inputs)
        tables = (here, commanded) if self.commands else ((*commanded, *here[1:]),)
        for names in tables:
            twice = next((n for n in names if names.count(n) > 1), None)
            if twice is not None:
                raise AnalysisError(
                    f"column '{twice}' is named twice; time, command, angle and rate of an axis"
                    " are different columns"
                )


def measurement_of_table(
    table: tables.Table,
    columns: Columns,
    *,
    gyro_delay: float = 0.0,
    initial: Initial = "rest",
    name: str | None = None,
) -> Measurement:
    """Pick the columns of a measurement by name; empty fields are missing readings.

    Parameters
    ----------
    gyro_delay : delay of the gyro's own filter [s]
    name : used in messages and reports; the file's name without it

    Raises
    ------
    AnalysisError : unknown columns and units, stamps that are hardly in seconds, and what no
        `Measurement` may hold
    """
    table = table.dated(columns.time)
    given = None
    if columns.commands is not None:
        given = tables.read(columns.commands).dated(columns.time)
    columns = with_units(columns, table, given or table)
    unit = columns.unit or "rad"
    input_unit = columns.input_unit or unit
    scale, own = _scale(unit), _scale(input_unit)
    seconds = columns.time_scale
    if seconds is not None and not 0.0 < seconds < math.inf:
        raise AnalysisError(f"{table.source}: a time scale of {seconds:g} s; must be more than 0 s")
    if seconds is None:
        _check_seconds(table.source, columns.time, table.column(columns.time))
        seconds = 1.0
    commands, held = _filled(given or table, columns.inputs)
    run = measurement(
        unwrapped(table.column(columns.time)) * seconds,
        commands,
        angle=table.stack(columns.angle) if columns.angle else None,
        rate=table.stack(columns.rate) if columns.rate else None,
        command_time=_of_commands(given, table, columns.time, seconds),
        stamps=columns.stamps,
        before=columns.before,
        scale=scale,
        input_scale=own,
        input_unit=input_unit if input_unit in NO_ANGLES else "rad",
        gyro_delay=gyro_delay,
        initial=initial,
        name=name or table.source,
        inputs=columns.inputs if len(columns.inputs) > 2 else (),
    )
    # reports name a run by the gimbal seat of its recording; a table has only its file name
    named = Recording({"configuration": {"gimbal": table.source}}, {})
    both = columns.unit is not None and columns.input_unit is not None
    doubt = _doubted(columns, commands)
    notes = (table.note, (given or table).note, held, doubt)
    note = "; ".join(dict.fromkeys(n for n in notes if n))
    units: Literal["given", "assumed"] = "given" if both else "assumed"
    return replace(run, recording=named, units=units, note=note, unit_doubt=doubt)


def with_units(columns: Columns, table: tables.Table, commands: tables.Table) -> Columns:
    """Columns with the units that stand behind the numbers of a table, where none are given.

    Raises
    ------
    AnalysisError : columns for one purpose with different units, or others than those given
    """
    own = _unit_in(table, (*columns.angle, *columns.rate), columns.unit, "--angle-unit")
    default = columns.input_unit or columns.unit
    asked = _unit_in(commands, columns.inputs, default, "--input-unit")
    time = table.units.get(columns.time)
    scale = columns.time_scale
    if time is not None and time not in _TIMES:
        raise AnalysisError(f"{table.source}: '{columns.time}' has values in {time}, not of time")
    if time is not None and scale not in (None, _TIMES[time]):
        raise AnalysisError(
            f"{table.source}: '{columns.time}' has values in {time}, --time-scale {scale:g} is"
            " given"
        )
    return replace(
        columns,
        unit=own or columns.unit,
        input_unit=asked or columns.input_unit,
        time_scale=scale if time is None else _TIMES[time],
    )


def _unit_in(
    table: tables.Table, names: tuple[str, ...], given: str | None, flag: str
) -> str | None:
    """The unit behind the numbers of columns; None where none of them has any."""
    found = {table.units[n]: n for n in names if n in table.units}
    if not found:
        return None
    if len(found) > 1:
        both = " and ".join(f"'{n}' in {u}" for u, n in found.items())
        raise AnalysisError(f"{table.source}: {both}; one unit holds for both")
    unit, name = next(iter(found.items()))
    if unit not in UNITS:
        raise AnalysisError(f"{table.source}: '{name}' has values in {unit}, not of angle")
    if given not in (None, unit):
        raise AnalysisError(f"{table.source}: '{name}' has values in {unit}; give {flag} {unit}")
    return unit


def commands_of_table(
    path: Path | str, time: str, inputs: tuple[str, ...], time_scale: float | None = None
) -> tuple[TimeSeries, str]:
    """Commands of a table in the unit of the file, value in force from each stamp [s] on; a note.

    Columns are named `x` and `y`, one column `x`. The note is of missing commands, or empty.

    Raises
    ------
    AnalysisError : unknown columns, stamps that do not increase or are hardly in seconds, and
        commands that are not finite
    """
    table = tables.read(path).dated(time)
    stamps = unwrapped(table.column(time))
    if time_scale is None:
        _check_seconds(table.source, time, stamps)
    values, note = _filled(table, inputs)
    if len(stamps) != len(values):
        raise AnalysisError(
            f"{table.source}: {len(stamps)} stamps in '{time}' but {len(values)} commands"
        )
    seconds = check_stamps(stamps * (time_scale or 1.0), time, table.source, 1)
    return TimeSeries(COMMAND, seconds, values, "1", ("x", "y")[: len(inputs)]), note


def _check_seconds(source: str, name: str, stamps: Array) -> None:
    """Refuse stamps too far apart for a gimbal: a column of milliseconds or finer."""
    apart = np.diff(stamps)
    period = float(np.median(apart)) if len(apart) and np.isfinite(apart).all() else 0.0
    if period < _SLOWEST:
        return
    scale = next(s for s in (1e-3, 1e-6, 1e-9) if period * s < _SLOWEST or s == 1e-9)
    raise AnalysisError(
        f"{source}: samples {period:g} s apart; if '{name}' is not in seconds, give its unit "
        f"(--time-scale {scale:g}), otherwise --time-scale 1"
    )


def _doubted(columns: Columns, commands: Array) -> str:
    """Doubt of the unit of commands (n, k) that turn farther than any gimbal, in one line."""
    given = columns.input_unit or columns.unit
    if (given or "rad") in NO_ANGLES:
        return ""
    reach = np.abs(commands).max(axis=0, initial=0.0)
    k = int(np.argmax(reach))
    return far_command(columns.inputs[k], float(reach[k]), given)


def far_command(name: str, reach: float, unit: str | None) -> str:
    """Doubt of the unit of a command that turns beyond `FARTHEST`, in one line; "" of others.

    Parameters
    ----------
    reach : its largest value, as it stands in the file
    unit : that was given for it; None where radians were assumed
    """
    angle = reach * UNITS[unit or "rad"]
    if angle <= FARTHEST:
        return ""
    asked = "check the unit given" if unit else "is it in degrees? give --angle-unit deg"
    return (
        f"command '{name}' reaches {reach:.4g} {unit or 'rad'}, {math.degrees(angle):.4g}°: {asked}"
    )


def _of_commands(
    given: tables.Table | None, table: tables.Table, name: str, seconds: float
) -> Array | None:
    """Stamps (n,) [s] of commands from a file of their own, on the clock of the readings."""
    if given is None:
        return None
    apart = given.begins.get(name, 0.0) - table.begins.get(name, 0.0)
    turns = [turn_of(t.column(name)) for t in (given, table)]
    if any(0.0 < turn < TURN for turn in turns):
        raise AnalysisError(
            f"{given.source}: '{name}' is a counter that overflows at {min(filter(None, turns)):g},"
            f" so its place in {table.source} is open; log both in one table or by a longer counter"
        )
    commands, readings = (unwrapped(t.column(name)) for t in (given, table))
    return (commands + _turns_apart(commands, readings)) * seconds + apart


def _turns_apart(stamps: Array, others: Array) -> float:
    """What the counter of a file lost that was begun behind, or before, an overflow in another."""
    if not (len(stamps) and len(others)):
        return 0.0
    first, last = float(stamps.min()), float(stamps.max())
    low, high = float(others.min()), float(others.max())
    for turn in (0.0, TURN, -TURN):
        if first + turn <= high and last + turn >= low:
            return turn
    return 0.0


def _scale(unit: str) -> float:
    if unit not in UNITS:
        raise AnalysisError(unknown("unit", unit, UNITS))
    return UNITS[unit]


def _filled(table: tables.Table, names: tuple[str, ...]) -> tuple[Array, str]:
    """Commands with empty fields taken as no change, and how many there were, in one line.

    Raises
    ------
    AnalysisError : the first row has none
    """
    values = table.stack(names)
    missing = ~np.isfinite(values)
    if missing[:1].any():
        name = names[int(np.argmax(missing[0]))]
        raise AnalysisError(
            f"{table.source}: the first row has no command in '{name}'; give it there, or leave out"
            " the rows before the first command"
        )
    if not missing.any():
        return values, ""
    rows = np.arange(len(values))[:, None]
    last = np.maximum.accumulate(np.where(missing, 0, rows), axis=0)
    first = int(np.argmax(missing.any(axis=1))) + 1
    many = int(missing.sum())
    count = "1 missing command is" if many == 1 else f"{many} missing commands are"
    note = f"{count} taken as the one before, {'' if many == 1 else 'first '}in sample {first}"
    return np.asarray(np.take_along_axis(values, last, axis=0)), note
