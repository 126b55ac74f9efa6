"""What is wrong with a record, before a model is made of it."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from analysis.array import Array
from analysis.identify.errors import IdentificationError
from analysis.identify.evidence.evidence import ChannelFit
from analysis.identify.problem.noise import resolution
from analysis.recording.columns import far_command
from analysis.recording.measurements import Measurement

DEGREES = 180.0 / np.pi
_USUAL = 1.5  # a gimbal turns about as far as commanded
_SURELY = 1.05  # within this one no gimbal is known, and two units are
_NEAR = 1.2  # a ratio within this factor of 57.3 is degrees, not an unusual gimbal
_FEWEST_CHANGES = 2
_RESTING = 10  # readings before a single step
_MOST_MISSING = 0.5
_CLIPPED_RUN = 5
_REMEMBERED = 1.0  # s after which no gimbal still moves


def check_records(records: Sequence[Measurement]) -> None:
    """Refuse records no model can come from.

    Raises
    ------
    IdentificationError : no record, differing axes, constant or indistinguishable commands, too few
        steps, too many missing or clipped readings, and gyro and potentiometer in different units
    """
    if not records:
        raise IdentificationError("no record to identify from")
    first = records[0]
    for r in records:
        if (r.inputs, r.outputs) != (first.inputs, first.outputs):
            raise IdentificationError(
                f"{r.name}: commands {r.inputs} and axes {r.outputs}, but {first.name} has "
                f"{first.inputs} and {first.outputs}"
            )
    _check_commands(records)
    for r in records:
        for what, series in r.sensors:
            _check_readings(r, what, series.values)
    for name in first.outputs:
        _check_units(records, name)


def _before(records: Sequence[Measurement], j: int) -> str:
    """What helps where every record begins with its step."""
    if any(len(r.command.values) and r.command.values[0, j] != 0.0 for r in records):
        return "; if another command was in force before the first row, give it (--before 0)"
    return ""


def _check_commands(records: Sequence[Measurement]) -> None:
    for j, name in enumerate(records[0].inputs):
        count = sum(_felt_changes(r, j) for r in records)
        if count == 0 and (apart := next((r for r in records if len(r.command.changes(j))), None)):
            changed = apart.command.time[apart.command.changes(j)]
            raise IdentificationError(
                f"{apart.name}: command '{name}' changes from {changed[0]:g} s to {changed[-1]:g} "
                f"s, the samples are from {apart.time[0]:g} s to {apart.time[-1]:g} s; are both "
                "dated by one clock?"
            )
        if count == 0:
            raise IdentificationError(
                f"command '{name}' never changes while the gimbal is sampled; "
                f"nothing can be learnt from a constant input{_before(records, j)}"
            )
        if count < _FEWEST_CHANGES and not any(_from_rest(r, j) for r in records):
            raise IdentificationError(
                f"command '{name}' changes {count} time; {_FEWEST_CHANGES} steps or more are "
                f"needed, or {_RESTING} readings at rest before a single one, or the command in "
                "force before the first row (--before 0)"
            )
    moves = np.concatenate([np.diff(r.command.values, axis=0) for r in records])
    lengths = np.linalg.norm(moves, axis=0)
    alike = np.abs(moves.T @ moves) / np.outer(lengths, lengths)
    for i, j in zip(*np.nonzero(np.triu(alike, 1) > 0.98), strict=True):
        names = records[0].inputs
        raise IdentificationError(
            f"commands '{names[i]}' and '{names[j]}' always move together; step them one at a time"
        )


def _felt_changes(r: Measurement, column: int) -> int:
    """Changes of a command that some sample comes after, and not long after."""
    times = r.command.time[r.command.changes(column)]
    return int(np.sum((times >= r.time[0] - _REMEMBERED) & (times <= r.time[-1])))


def _from_rest(r: Measurement, column: int) -> bool:
    """Whether a single step starts from rest: by readings, or by a command given before them."""
    times = r.command.time[r.command.changes(column)]
    if r.initial != "rest" or not len(times) or times[0] > r.time[-1]:
        return False
    return bool(np.sum(r.time < times[0]) >= _RESTING or r.command.time[0] < r.time[0])


def _check_readings(r: Measurement, what: str, values: Array) -> None:
    for axis, name in enumerate(r.outputs):
        good = np.isfinite(values[:, axis])
        # with two sensors in one table each is silent at the stamps of the other
        gaps = len(r.sensors) == 1 and 1.0 - good.mean() > _MOST_MISSING
        if gaps or good.sum() < 10:
            raise IdentificationError(
                f"{r.name}: {what} '{name}' has {int(good.sum())} readings in {len(values)} samples"
                f"; {100 * (1 - good.mean()):.0f} % are missing"
            )
        if np.ptp(values[good, axis]) == 0.0:
            raise IdentificationError(
                f"{r.name}: {what} '{name}' is {values[good, axis][0]:g} in every sample; give a"
                " column that moves, or check the sensor"
            )
        stuck = clipped(values[good, axis])
        if stuck.any():
            level = values[good, axis][stuck][0]
            raise IdentificationError(
                f"{r.name}: {what} '{name}' is clipped at {level:g} in {int(stuck.sum())} samples; "
                "measure with a wider range, step less, or mark them as missing"
            )


def clipped(values: Array) -> NDArray[np.bool_]:
    """Readings (n,) that stand at the end of the sensor's range.

    A run of equal extreme values that is entered or left at high speed: a settling gimbal slows
    down before it rests, a clipped reading does not.
    """
    stuck = np.zeros(len(values), dtype=bool)
    change = np.diff(values)
    step = resolution(values) or float(np.abs(change[change != 0.0]).min(initial=np.inf))
    for extreme in (values.max(), values.min()):
        edges = np.flatnonzero(np.diff(np.concatenate([[0], (values == extreme).astype(int), [0]])))
        runs = [(a, b) for a, b in zip(edges[::2], edges[1::2], strict=True)]
        for a, b in runs:
            into = abs(change[a - 1]) if a > 0 else 0.0
            out = abs(change[b - 1]) if b < len(values) else 0.0
            before = abs(change[a - 2]) if a > 1 else 0.0
            steep = 0.4 * np.abs(change).max()
            # steep in two samples before or one after, on both sides unless the record ends
            fast_in = into > 3.0 * step and before > steep
            fast_out = out > 3.0 * step and out > 0.5 * steep
            if b - a >= _CLIPPED_RUN and fast_in and (fast_out or b == len(values)):
                stuck[a:b] = True
    return stuck


def _check_units(records: Sequence[Measurement], name: str) -> None:
    """Turned angle of every step against the integral of the rate."""
    turned, integral, lasted = [], [], []
    for r in records:
        if r.angle is None or r.rate is None:
            continue
        both = [s.select((name,)).known() for s in (r.angle, r.rate)]
        time, a, b = np.intersect1d(both[0].time, both[1].time, return_indices=True)
        if len(time) < 20:
            continue
        angle, rate = both[0].value[a], both[1].value[b]
        path = np.concatenate([[0.0], np.cumsum(np.diff(time) * (rate[1:] + rate[:-1]) / 2.0)])
        cuts = np.linspace(0, len(time) - 1, min(40, len(time) // 5)).astype(np.intp)
        turned.append(np.diff(angle[cuts]))
        integral.append(np.diff(path[cuts]))
        lasted.append(np.diff(time[cuts]))
    if not turned:
        return
    y, x, t = np.concatenate(turned), np.concatenate(integral), np.concatenate(lasted)
    scale = float(np.linalg.lstsq(np.stack([x, t], axis=1), y, rcond=None)[0][0])
    mistaken = _degrees(scale)
    if mistaken is not None:
        which = ("angle", "rate") if scale > 1.0 else ("rate", "angle")
        raise IdentificationError(
            f"axis '{name}': the angle turns {scale:.3g} times as far as the rate says; "
            f"{which[0]} in degrees and {which[1]} in radians? one unit holds for both; convert one"
        )


def _degrees(ratio: float) -> float | None:
    for factor in (DEGREES, 1.0 / DEGREES):
        if 1.0 / _NEAR < abs(ratio) / factor < _NEAR:
            return factor
    return None


_CROSSED = 0.2  # of the gain from the other command: an axis that follows its own has more


def check_gain(gain: float, record: Measurement, command: str, axis: str) -> list[str]:
    """Refuse a gain that is a unit and not a gimbal, unless the units were given; or doubt it.

    A wrong unit of both sides leaves the gain alone: then the size of the commands is doubted.

    Raises
    ------
    IdentificationError : gains near 57.3 (degrees per radian) and 0.0175, of units assumed
    """
    if record.command.unit != "rad":
        return []  # commands that are no angles have no expected gain
    assumed = record.units == "assumed"
    mistaken = _degrees(gain)
    if mistaken is not None:
        sides = ("axis", "command") if mistaken > 1.0 else ("command", "axis")
        text = (
            f"gain from command '{command}' to axis '{axis}' is {gain:.4g}, near {mistaken:.4g}: "
            f"{sides[0]} in degrees and {sides[1]} in radians? "
            + ("give both (--angle-unit, --input-unit)" if assumed else "check the units given")
        )
        if assumed and 1.0 / _SURELY < abs(gain) / mistaken < _SURELY:
            raise IdentificationError(text)
        return [text]
    if gain < 0.0:
        text = (
            f"gain from command '{command}' to axis '{axis}' is {gain:.4g}, negative: the axis "
            "moves against its command; a loop closed over it diverges"
        )
        return [text]
    reach = float(np.abs(record.command.column(command)).max())
    if text := far_command(command, reach, None if assumed else "rad"):
        return [] if record.unit_doubt else [text]  # the note of a table has it
    if not 1.0 / _USUAL < gain < _USUAL:
        text = (
            f"gain from command '{command}' to axis '{axis}' is {gain:.4g}, far from 1: is the "
            "command an angle of the gimbal, and are the units right?"
        )
        return [text]
    return []


def exchanged(
    rows: Sequence[Sequence[ChannelFit]], inputs: Sequence[str], outputs: Sequence[str]
) -> list[str]:
    """Doubt of the order of two columns whose axes each follow the other's command."""
    if not len(rows) == len(inputs) == len(outputs) == 2:
        return []
    gain = [[abs(c.num[-1] / c.den[-1]) for c in row] for row in rows]
    if not all(gain[i][i] < _CROSSED * gain[i][1 - i] for i in (0, 1)):
        return []
    (a, b), (x, y) = inputs, outputs
    text = (
        f"axis '{x}' follows command '{b}' and axis '{y}' follows command '{a}': are the columns"
        " exchanged (--input, --angle, --rate)?"
    )
    return [text]
