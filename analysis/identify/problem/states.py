"""States of a channel's modes under the commands of a record."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.array import Array
from analysis.identify.problem.basis import Denominator
from analysis.identify.problem.modal import impulse_response, modal_response
from analysis.identify.problem.ramps import Bounds, ramps

Rows = NDArray[np.intp]


@dataclass(frozen=True, slots=True)
class Part:
    """The samples of one record that speak about one axis."""

    time: Array  # (n,)
    input_time: Array  # (k,)
    input: Array  # (k, p)
    angle_rows: Rows
    rate_rows: Rows
    free: bool
    slack: float = 0.0
    doubt: float = 0.0  # [s]
    late: float = 0.0  # [s]


def part_states(part: Part, den: Denominator, column: int, delay: float) -> Array:
    """Real and imaginary parts of the modes' states, and the delayed input (n, 4·modes + 1)."""
    times, values = command_changes(part.input_time, part.input[:, column])
    single, double, held = modal_response(part.time, times, values, den.poles, delay)
    return np.hstack([single.real, -single.imag, double.real, -double.imag, held[:, None]])


def held_states(
    time: Array, input_time: Array, command: Array, den: Denominator, delay: float, bounds: Bounds
) -> tuple[NDArray[np.complex128], Array]:
    """States of 1/(s−p) (n, modes) behind a bounded command, and that command (n,), from zero."""
    times, values = command_changes(input_time, command)
    corners, slopes, reached = ramps(times, values, bounds.rate_limit, bounds.dead_band)
    single, _, _ = modal_response(time, corners, slopes, den.poles, delay)
    held = np.zeros(len(time))
    if len(corners):
        held = np.interp(time - delay, corners, reached)
    # a ramp is the integral of its slope: 1/(s−p)·1/s = (1/(s−p) − 1/s)/p
    return (single - held[:, None]) / den.poles, held


def command_changes(input_time: Array, command: Array) -> tuple[Array, Array]:
    """When a command takes a new value, and which, counted from the first."""
    moved = command - command[0]
    rows = np.flatnonzero(np.diff(moved, prepend=0.0) != 0.0)
    return input_time[rows], moved[rows]


def free_states(part: Part, den: Denominator) -> Array:
    """Real and imaginary parts of the modes' free motion, columns as `part_states`."""
    return free_motion(part.time - part.time[0], den)


def free_motion(time: Array, den: Denominator) -> Array:
    """Columns of `free_states` at times (n,) since the start."""
    single, double = impulse_response(time, den.poles)
    none = np.zeros((len(time), 1))
    return np.hstack([single.real, -single.imag, double.real, -double.imag, none])
