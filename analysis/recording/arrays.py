"""Measurements from plain columns of numbers."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from analysis.array import Array
from analysis.recording.measurements import (
    COMMAND,
    MEASURED,
    RATE,
    Initial,
    InputStamps,
    Measurement,
    check_stamps,
)
from analysis.recording.series import RecordingError, TimeSeries


def measurement(
    time: ArrayLike,
    command: ArrayLike,
    *,
    angle: ArrayLike | None = None,
    rate: ArrayLike | None = None,
    command_time: ArrayLike | None = None,
    stamps: InputStamps = "shown",
    before: ArrayLike | None = None,
    scale: float = 1.0,
    input_scale: float | None = None,
    input_unit: str = "rad",
    gyro_delay: float = 0.0,
    initial: Initial = "rest",
    name: str = "record",
    inputs: Sequence[str] = (),
    outputs: Sequence[str] = (),
) -> Measurement:
    """Build a measurement from columns as they stand in a file.

    Without `command_time` the commands change at the sample that first shows them. A logger beside
    the loop that gives commands sees them up to a period late, which the columns do not show: then
    delays come out that much too short, and their deviation is widened to cover it.

    Parameters
    ----------
    time : sample times [s] (n,)
    command : commanded angle (n, p), or (k, p) with `command_time` [s] (k,)
    angle, rate : readings (n, q), NaN where there is none
    stamps : what is known of commands without `command_time`: `exact`, given at the sample that
        first shows them, as in the log of the loop that gives them; `sampled`, given at any time
        since the sample before, and taken as given half-way; `shown`, taken as given at the
        sample, with deviations that cover any time since the one before
    before : the command (p,) in force before the first stamp, where it was another
    scale : radians per unit of angle, and of rate per second (pi/180 for degrees)
    input_scale : the same for the command; as `scale` if left out
    input_unit : of the command after scaling: `rad`, or what it is if it is not an angle
    gyro_delay : delay of the gyro's own filter [s]; taken out of the rate readings

    Raises
    ------
    RecordingError : `command_time` that begins later than the samples, without `before`; and for
        what no `Measurement` may hold
    """
    samples = check_stamps(time, "time", name, 3)
    input_scale = scale if input_scale is None else input_scale
    values = _table(command) * input_scale
    own = samples if command_time is None else np.asarray(command_time, dtype=np.float64)
    if len(values) != len(own):
        raise RecordingError(f"{name}: {len(values)} commands but {len(own)} stamps for them")
    slack = 0.0
    if command_time is None:
        own, slack = _first_shown(own, stamps)
    elif stamps != "shown":
        raise RecordingError(f"{name}: stamps='{stamps}' is for commands without time stamps")
    elif before is None and len(own) and own[0] > samples[0]:
        # a first row that is a step already would be taken for the rest before it
        raise RecordingError(
            f"{name}: the commands begin at {own[0]:g} s, the samples at {samples[0]:g} s; give "
            "the command in force before (--before 0)"
        )
    if before is not None and len(own):
        first = _before(before, values.shape[1], name) * input_scale
        own = np.concatenate([[min(own[0], samples[0]) - 1.0], own])
        values = np.concatenate([first[None, :], values])
    check_stamps(own, "command time", name, 1)
    both = [None if v is None else _readings(v, len(samples), scale, name) for v in (angle, rate)]
    q = next((v.shape[1] for v in both if v is not None), 0)
    names = tuple(outputs) or _names(q)
    angles, rates = (
        None if v is None else TimeSeries(signal, t, v, unit, names[: v.shape[1]])
        for v, signal, t, unit in (
            (both[0], MEASURED, samples, "rad"),
            (both[1], RATE, samples - gyro_delay, "rad/s"),
        )
    )
    given = TimeSeries(COMMAND, own, values, input_unit, tuple(inputs) or _names(values.shape[1]))
    return Measurement(
        given, angles, rates, initial, slack, "exact" if command_time is not None else stamps,
        name=name,
    )  # fmt: skip


def _first_shown(samples: Array, stamps: InputStamps) -> tuple[Array, float]:
    """When commands changed that the samples show, and how much earlier it may have been [s]."""
    if stamps == "exact" or len(samples) < 2:
        return samples, 0.0
    period = float(np.median(np.diff(samples)))
    if stamps == "shown":
        return samples, period
    return samples - 0.5 * np.diff(samples, prepend=samples[0] - period), 0.5 * period


def _before(values: ArrayLike, count: int, name: str) -> Array:
    first = np.atleast_1d(np.asarray(values, dtype=np.float64))
    if first.shape not in {(1,), (count,)}:
        raise RecordingError(f"{name}: {len(first)} commands before the first, not {count}")
    return np.broadcast_to(first, (count,))


def _names(count: int) -> tuple[str, ...]:
    return ("x", "y")[:count] if count <= 2 else tuple(f"{i + 1}" for i in range(count))


def _table(values: ArrayLike) -> Array:
    array = np.asarray(values, dtype=np.float64)
    return array[:, None] if array.ndim == 1 else array


def _readings(values: ArrayLike, rows: int, scale: float, name: str) -> Array:
    table = _table(values) * scale
    if table.ndim != 2 or len(table) != rows or table.shape[1] < 1:
        raise RecordingError(f"{name}: readings of shape {table.shape}, expected ({rows}, ...)")
    return table
