"""A history of commands from a file, as gimbal angles: tables in any unit, and recordings."""

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from analysis import recording
from analysis.recording import TimeSeries, tables
from analysis.recording.columns import UNITS, commands_of_table
from analysis.recording.loader import is_table
from hardware.calibration import Calibration
from hardware.frames import AXES
from hardware.rig.rig import PULSES
from twin import status
from twin.errors import TwinError

Array = NDArray[np.float64]
CENTRE, HALF = 0.5 * (PULSES[0] + PULSES[1]), 0.5 * (PULSES[1] - PULSES[0])  # s; 0 and 100 %


@dataclass(frozen=True)
class Source:
    """Where commands stand in a file, and what they mean.

    Attributes
    ----------
    file : recording or table
    time, inputs : columns of a table; `inputs` one, for the chosen axes, or x and y
    unit : of an angle, or `us` (pulse width) and `percent` (of the way from neutral to the longest
        pulse)
    ratio : gimbal angle per servo shaft angle, where shaft angles are commanded
    time_scale : seconds per unit of the time column
    flag : that gives the unit
    """

    file: Path
    time: str | None = None
    inputs: tuple[str, ...] = ()
    unit: str = "rad"
    ratio: float | None = None
    time_scale: float | None = None
    flag: str = "--input-unit"

    @property
    def pulses(self) -> bool:
        """Whether the commands are pulses, which a calibration turns into angles."""
        return self.unit in ("us", "percent")

    def scaled(self, values: Array) -> Array:
        """Commands in SI: pulse widths [s], or angles [rad].

        Raises
        ------
        TwinError : an unknown unit
        """
        if self.unit == "us":
            return values * 1e-6
        if self.unit == "percent":
            return CENTRE + 0.01 * HALF * values
        if self.unit not in UNITS:
            valid = ", ".join(sorted({*UNITS, "us", "percent"}))
            raise TwinError(f"--input-unit {self.unit}: must be one of {valid}")
        return values * UNITS[self.unit] * (1.0 if self.ratio is None else self.ratio)


def read(source: Source) -> TimeSeries:
    """Commands of a file, dated from its first one: angles [rad], or pulse widths [s].

    Raises
    ------
    TwinError, AnalysisError : a file, column or unit that cannot be used
    """
    if not is_table(source.file):
        scaled = source.ratio is not None or source.time_scale is not None
        if source.inputs or source.time or scaled or source.unit != "rad":
            raise TwinError(
                "--time, --time-scale, --input, --input-unit and --ratio are only for tables;"
                f" {source.file} is a recording"
            )
        command = recording.load(source.file).command
        return command.shifted(-float(command.time[0]))
    if not source.time or not 1 <= len(source.inputs) <= len(AXES):
        raise TwinError(
            f"{source.file}: name its columns: --time t --input u, or --input ux,uy; it has "
            + ", ".join(tables.read(source.file).columns)
        )
    if source.pulses and source.ratio is not None:
        raise TwinError(f"--ratio: not with --input-unit {source.unit}, which has no shaft angle")
    command, note = commands_of_table(source.file, source.time, source.inputs, source.time_scale)
    if note:
        status.note(f"twin: {source.file}: {note}")
    command = command.shifted(-float(command.time[0]))
    return TimeSeries(
        command.name, command.time, source.scaled(command.values), "rad", command.components
    )


def gimbal_angles(
    source: Source,
    commands: TimeSeries,
    calibration: Calibration | None,
    axis: str,
    stops: float | None,
) -> Array:
    """Gimbal angles (n, 2) that commands ask for [rad].

    Parameters
    ----------
    calibration : map of pulses to angles; only needed for pulses
    axis : which axis one column commands, `x` or `y`; its own name if `both`
    stops : largest angle of the mechanism [rad]; None where it has no stops

    Raises
    ------
    TwinError : commands outside the stops, or pulses that no servo is sent
    """
    given = _both(commands, axis, calibration.zero if source.pulses and calibration else (0, 0))
    if source.pulses:
        assert calibration is not None
        low, high = PULSES
        _check(source, commands.time, given, low, high, 1e6, "µs", "a pulse width")
        pairs, back = np.unique(given, axis=0, return_inverse=True)
        of_pairs = [calibration.angles((float(p), float(q))) for p, q in pairs]
        given = np.array(of_pairs, np.float64)[back.ravel()]
    limit = (math.pi / 2 if stops is None else stops) * (1.0 + 1e-9)
    _check(source, commands.time, given, -limit, limit, math.degrees(1.0), "°", "between the stops")
    return given


def _both(commands: TimeSeries, axis: str, rest: tuple[float, float]) -> Array:
    values = commands.values
    if values.shape[1] == len(AXES):
        return np.array(values)
    chosen = axis if axis in AXES else commands.components[0]
    both = np.full((len(values), len(AXES)), rest, np.float64)
    both[:, AXES.index(chosen)] = values[:, 0]
    return both


def _check(
    source: Source, time: Array, values: Array, low: float, high: float,
    scale: float, unit: str, what: str,
) -> None:  # fmt: skip
    wrong = np.flatnonzero(((values < low) | (values > high)).any(axis=1))
    if not len(wrong):
        return
    k = int(wrong[0])
    worst = float(values[k][np.argmax(np.maximum(low - values[k], values[k] - high))])
    text, hint = f"{scale * worst:.4g} {unit}", ""
    if unit == "°" and source.unit == "rad" and is_table(source.file):
        text = f"{worst / (source.ratio or 1.0):.4g} rad, {text},"  # as it stands in the file
        hint = f"; is it in degrees? give {source.flag} deg"
    raise TwinError(
        f"{source.file}: command of {text} at {time[k]:g} s: must be {what},"
        f" from {scale * low:.4g} to {scale * high:.4g} {unit}{hint}"
    )
