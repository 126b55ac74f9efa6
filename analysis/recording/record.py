"""Validated measurements: what was commanded, and what gyro and potentiometer saw."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from analysis.schema import AnalysisError

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Initial = Literal["rest", "free"]
InputStamps = Literal["exact", "shown", "sampled"]

MAX_SAMPLES = 20_000_000
_LARGEST = 1e9  # no gimbal reads more, in any unit: a larger number is a broken file


class RecordError(AnalysisError):
    """Samples or commands that no analysis can use, said in one line."""


@dataclass(frozen=True, slots=True)
class Record:
    """One run of a gimbal: held commands with stamps of their own, and sampled angle and rate.

    Attributes
    ----------
    time : sample times [s], strictly increasing, any spacing (n,)
    input_time : times at which the command takes a new value [s] (k,)
    input : the value it holds from then on [rad] (k, p)
    angle : potentiometer angle [rad], NaN where there is no reading (n, q), or None
    rate : gyro rate [rad/s], NaN where there is no reading (n, q), or None
    initial : `rest` if the gimbal stood still when the record starts, `free` if it may have moved
    slack : how long before its stamp a command may have been given [s]; one sampling period where
        the command was only sampled
    stamps : what commands are dated by: their giving (`exact`), the sample that first shows them
        (`shown`), or half-way between that and the sample before (`sampled`)
    name : how messages call the record
    inputs, outputs : names of the p commands and q axes

    Raises
    ------
    RecordError
        for stamps that do not increase, wrong shapes, readings that are not finite numbers.
    """

    time: Array
    input_time: Array
    input: Array
    angle: Array | None = None
    rate: Array | None = None
    initial: Initial = "rest"
    slack: float = 0.0
    stamps: InputStamps = "exact"
    name: str = "record"
    inputs: tuple[str, ...] = ()
    outputs: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if self.angle is None and self.rate is None:
            raise RecordError(f"{self.name}: neither angle nor rate; give at least one")
        time = _stamps(self.time, "time", self.name)
        input_time = _stamps(self.input_time, "command time", self.name)
        values = _columns(self.input, len(input_time), "command", self.name)
        if not np.isfinite(values).all():
            raise RecordError(f"{self.name}: the command holds values that are no numbers")
        angle = _outputs(self.angle, len(time), "angle", self.name)
        rate = _outputs(self.rate, len(time), "rate", self.name)
        if angle is not None and rate is not None and angle.shape != rate.shape:
            raise RecordError(
                f"{self.name}: {angle.shape[1]} angles but {rate.shape[1]} rates; "
                "give one of each per axis"
            )
        measured = angle if angle is not None else rate
        assert measured is not None
        settings: dict[str, object] = {
            "time": time,
            "input_time": input_time,
            "input": values,
            "angle": angle,
            "rate": rate,
            "inputs": tuple(self.inputs) or _names(values.shape[1]),
            "outputs": tuple(self.outputs) or _names(measured.shape[1]),
        }
        for field, value in settings.items():
            if isinstance(value, np.ndarray):
                value.setflags(write=False)
            object.__setattr__(self, field, value)

    @property
    def size(self) -> int:
        """Number of sample times."""
        return len(self.time)

    @property
    def duration(self) -> float:
        """Time from first to last sample [s]."""
        return float(self.time[-1] - self.time[0])

    @property
    def period(self) -> float:
        """Median spacing of the samples [s]."""
        return float(np.median(np.diff(self.time)))

    @property
    def doubt(self) -> float:
        """How far the stamps of all commands may be off together [s], root mean square.

        That of a uniform distribution: over the slack before a stamp, or as much on either side.
        """
        return 0.0 if self.stamps == "exact" else self.slack / math.sqrt(3.0)

    def changes(self, column: int | None = None) -> NDArray[np.intp]:
        """Rows of `input` at which the command (or one column of it) takes another value."""
        moved = np.diff(self.input, axis=0) != 0.0
        chosen = moved.any(axis=1) if column is None else moved[:, column]
        return np.flatnonzero(chosen) + 1

    def held_input(self, times: Array) -> Array:
        """Command (..., p) that holds at the given times; before the first stamp, the first."""
        row = np.searchsorted(self.input_time, times, side="right") - 1
        return self.input[np.clip(row, 0, None)]

    def without(self, rows: Mask) -> "Record":
        """The record with the chosen samples (n,) taken as not measured."""
        keep = np.where(rows[:, None], math.nan, 0.0)
        return replace(
            self,
            angle=None if self.angle is None else self.angle + keep,
            rate=None if self.rate is None else self.rate + keep,
        )


def record(
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
    gyro_delay: float = 0.0,
    initial: Initial = "rest",
    name: str = "record",
    inputs: Sequence[str] = (),
    outputs: Sequence[str] = (),
) -> Record:
    """Build a record from columns as they stand in a file.

    Without stamps of their own the commands change at the sample that first shows them. Whoever
    logs beside the loop that gives them sees them up to a period late, which nothing in the columns
    tells: then delays come out that much too short, and their deviation is widened to cover it.

    Parameters
    ----------
    time : sample times [s] (n,)
    command : commanded angle (n, p), or (k, p) with `command_time` [s] (k,)
    angle, rate : readings (n, q)
    stamps : what is known of commands without stamps of their own: `exact`, given at the sample
        that first shows them, as in the log of the loop that gives them; `sampled`, given at any
        time since the sample before, and taken as given half-way; `shown`, taken as given at the
        sample, with deviations that cover any time since the one before
    before : the command (p,) that held before the first stamp, where it was another
    scale : radians per unit of angle, and of rate per second (pi/180 for degrees)
    input_scale : the same for the command; as `scale` if left out
    gyro_delay : delay of the gyro's own filter [s]; taken out of the rate readings

    Raises
    ------
    RecordError
        for commands with stamps of their own that begin later than the samples, without `before`;
        and for what no `Record` may hold.
    """
    samples = np.asarray(time, dtype=np.float64)
    values = _table(command) * (scale if input_scale is None else input_scale)
    own = samples if command_time is None else np.asarray(command_time, dtype=np.float64)
    if len(values) != len(own):
        raise RecordError(f"{name}: {len(values)} commands but {len(own)} stamps for them")
    slack = 0.0
    if command_time is None:
        own, slack = _first_shown(own, stamps)
    elif stamps != "shown":
        raise RecordError(f"{name}: the commands have stamps of their own, exact ones")
    elif before is None and len(own) and len(samples) and own[0] > samples[0]:
        # a first row that is a step already would be taken for the rest before it
        raise RecordError(
            f"{name}: the commands begin at {own[0]:g} s, the samples at {samples[0]:g} s; say "
            "which command held before (--before 0)"
        )
    if before is not None and len(own):
        first = _before(before, values.shape[1], name) * (
            scale if input_scale is None else input_scale
        )
        own = np.concatenate([[min(own[0], *samples[:1]) - 1.0], own])
        values = np.concatenate([first[None, :], values])
    angles = None if angle is None else _table(angle) * scale
    rates = None if rate is None else _table(rate) * scale
    if gyro_delay and rates is not None:
        samples, angles, rates = _advance_rate(samples, angles, rates, gyro_delay)
    return Record(
        samples, own, values, angles, rates, initial, slack,
        "exact" if command_time is not None else stamps, name, tuple(inputs), tuple(outputs),
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
        raise RecordError(f"{name}: {len(first)} commands before the first, not {count}")
    return np.broadcast_to(first, (count,))


def merge_stamps(
    angle_time: Array, angle: Array, rate_time: Array, rate: Array
) -> tuple[Array, Array, Array]:
    """Two sensors with stamps of their own on one axis of time, NaN where one is silent."""
    time = np.union1d(angle_time, rate_time)
    angles = np.full((len(time), angle.shape[1]), math.nan)
    rates = np.full((len(time), rate.shape[1]), math.nan)
    angles[np.searchsorted(time, angle_time)] = angle
    rates[np.searchsorted(time, rate_time)] = rate
    return time, angles, rates


def _advance_rate(
    time: Array, angle: Array | None, rate: Array, delay: float
) -> tuple[Array, Array | None, Array]:
    """Date every gyro reading back to when its filter's output was true."""
    if angle is None:
        return time - delay, None, rate
    return merge_stamps(time, angle, time - delay, rate)


def _names(count: int) -> tuple[str, ...]:
    return ("x", "y")[:count] if count <= 2 else tuple(f"{i + 1}" for i in range(count))


def _table(values: ArrayLike) -> Array:
    array = np.asarray(values, dtype=np.float64)
    return array[:, None] if array.ndim == 1 else array


def _stamps(values: ArrayLike, what: str, name: str) -> Array:
    time = np.array(values, dtype=np.float64)
    if time.ndim != 1 or len(time) < 1 or (what == "time" and len(time) < 3):
        raise RecordError(f"{name}: {what} must be a column of at least 3 stamps")
    if len(time) > MAX_SAMPLES:
        raise RecordError(f"{name}: {len(time)} stamps; {MAX_SAMPLES} at most")
    if not np.isfinite(time).all():
        row = int(np.flatnonzero(~np.isfinite(time))[0])
        raise RecordError(f"{name}: {what} of sample {row} is {time[row]}, not a number")
    backwards = np.flatnonzero(np.diff(time) <= 0.0)
    if len(backwards):
        row = int(backwards[0])
        raise RecordError(
            f"{name}: {what} runs from {time[row]:g} s to {time[row + 1]:g} s at sample {row + 1}; "
            f"stamps must increase ({len(backwards)} do not)"
        )
    return time


def _columns(values: ArrayLike, rows: int, what: str, name: str) -> Array:
    table = np.array(_table(values))
    if table.ndim != 2 or len(table) != rows or table.shape[1] < 1:
        raise RecordError(f"{name}: {what} has shape {table.shape}, expected ({rows}, ...)")
    if np.abs(table[np.isfinite(table)]).max(initial=0.0) > _LARGEST:
        raise RecordError(f"{name}: {what} holds values beyond {_LARGEST:g}")
    return table


def _outputs(values: ArrayLike | None, rows: int, what: str, name: str) -> Array | None:
    if values is None:
        return None
    table = _columns(values, rows, what, name)
    if np.isinf(table).any():
        raise RecordError(f"{name}: {what} holds infinite readings")
    missing = np.isnan(table).all(axis=0)
    if missing.any():
        raise RecordError(f"{name}: {what} {int(np.argmax(missing)) + 1} has no reading")
    return table
