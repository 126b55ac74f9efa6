"""Records out of tables, by the names of their columns."""

import math
from collections.abc import Mapping, Sequence
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from analysis.recording.record import Initial, InputStamps, Record, record
from analysis.recording.tables import Table
from analysis.schema import AnalysisError, unknown

Array = NDArray[np.float64]


_SLOWEST = 0.5  # s between samples; no gimbal's motion is seen that seldom
UNITS: Mapping[str, float] = MappingProxyType(
    {"rad": 1.0, "mrad": 1e-3, "deg": math.pi / 180.0, "turn": 2.0 * math.pi, "1": 1.0}
)


def to_record(
    table: Table,
    *,
    time: str,
    inputs: Sequence[str],
    rate: Sequence[str] = (),
    angle: Sequence[str] = (),
    unit: str = "rad",
    input_unit: str | None = None,
    time_scale: float | None = None,
    gyro_delay: float = 0.0,
    commands: Table | None = None,
    input_stamps: InputStamps = "shown",
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
    time_scale : seconds per unit of the time column (1e-3 for milliseconds); 1 without it
    gyro_delay : delay of the gyro's own filter [s]
    commands : a table of the commands with a time column of the same name; without it they change
        at the sample that first shows them
    input_stamps : without `commands`, what is known of that sample; see `record`
    before : the command that held before the first stamp, in its unit

    Raises
    ------
    AnalysisError
        for columns and units that are none, and stamps that are hardly in seconds;
        `IdentificationError` for what no record may hold.
    """
    scale, own = _scale(unit), _scale(input_unit or unit)
    if time_scale is not None and not 0.0 < time_scale < math.inf:
        raise AnalysisError(f"{table.source}: a time scale of {time_scale:g} s; more than 0 s")
    if time_scale is None:
        _check_seconds(table.source, time, table.column(time))
    seconds = 1.0 if time_scale is None else time_scale
    stamps = table.column(time) * seconds
    source = table if commands is None else commands
    filled = _held(source.stack(inputs))
    return record(
        stamps,
        filled,
        angle=table.stack(angle) if angle else None,
        rate=table.stack(rate) if rate else None,
        command_time=None if commands is None else commands.column(time) * seconds,
        stamps=input_stamps,
        before=before,
        scale=scale,
        input_scale=own,
        gyro_delay=gyro_delay,
        initial=initial,
        name=table.source,
        inputs=tuple(inputs) if len(inputs) > 2 else (),
    )


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


def _scale(unit: str) -> float:
    if unit not in UNITS:
        raise AnalysisError(unknown("unit", unit, UNITS))
    return UNITS[unit]


def _held(values: Array) -> Array:
    """Commands with empty fields taken as no change."""
    rows = np.arange(len(values))[:, None]
    last = np.maximum.accumulate(np.where(np.isfinite(values), rows, 0), axis=0)
    return np.asarray(np.take_along_axis(values, last, axis=0))
