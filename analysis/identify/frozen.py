"""Readings that are none of the gimbal: of a sensor that stands still, repeats, or is away."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from analysis.array import Array
from analysis.identify.problem.noise import clipped_rms
from analysis.recording.measurements import Measurement

_STILL = 0.5  # s of equal readings, or within the noise
_ANSWERED = 0.25  # s, or ten readings: by then a gimbal has begun to answer
_MOVED = 0.4  # of the command's range
_NOISE = 8.0  # deviations: 100 Gaussian readings are within 5
_MARKS = 5  # equal readings far beyond all others: a mark for a missing one
_BEYOND = 3.0  # times the range of all others
_CHANGES = 20  # of a sensor that repeats its readings
_TURN = 2.0 * np.pi
_LIKE = 0.7  # correlation of command and readings, at the best of these lags [s]
_LAGS = np.arange(0.0, 1.0, 0.02)


def without_frozen(records: Sequence[Measurement]) -> tuple[list[Measurement], list[str]]:
    """Records without the readings that are none of the gimbal, and a line for each kind.

    Left out are marks such as -9999, repetitions of a sensor that is slower than the log, and
    readings that stand still, but for noise, under commands that move over 0.4 of their range and
    were given long enough ago for any gimbal to have answered: a servo that ignores small commands
    is no such case, nor one that never follows its command. Angles that jump by a turn go on
    behind it.
    """
    kept, found = [], []
    for r in records:
        series = {}
        for what, sensor in r.sensors:
            values = sensor.values.copy()
            for axis, name in enumerate(r.outputs):
                known = np.flatnonzero(np.isfinite(values[:, axis]))
                own, time = values[known, axis], sensor.time[known]
                column = r.inputs.index(name) if name in r.inputs else 0
                turns = what == "angle" and r.command.unit == "rad"
                said = _cleaned(own, time, r, column, turns=turns)
                values[known, axis] = own
                found += [f"{r.name}: {what} '{name}' {text}" for text in said]
            left = np.isfinite(values).any(axis=1) | np.isnan(sensor.values).all(axis=1)
            series[what] = replace(sensor, values=values).rows(np.asarray(left))
        kept.append(replace(r, angle=series.get("angle"), rate=series.get("rate")))
    return (kept if found else list(records)), found


def _cleaned(values: Array, time: Array, r: Measurement, column: int, *, turns: bool) -> list[str]:
    """Mark the readings (n,) of one sensor that are none, in place; what was wrong."""
    if len(values) < _CHANGES or np.ptp(values) == 0.0:
        return []
    found = []
    for extreme in (values.max(), values.min()):
        rows = values == extreme
        others = values[~rows & np.isfinite(values)]
        if rows.sum() < _MARKS or len(others) < _CHANGES:
            continue
        if np.abs(others - extreme).min() > _BEYOND * np.ptp(others):
            values[rows] = np.nan
            found.append(f"has a mark far beyond all others in {rows.sum()} samples, left out")
    good = np.flatnonzero(np.isfinite(values))
    # what leaves one turn is no sensor of angles that begins anew, but some other quantity
    within = np.ptp(values[good]) <= 1.02 * _TURN
    if turns and within and (np.abs(np.diff(values[good])) > 0.9 * _TURN).any():
        whole = np.unwrap(values[good])
        if np.ptp(whole) < 0.5 * np.ptp(values[good]):
            values[good] = whole
            found.append("jumps by a turn where its sensor begins anew; counted through")
    changes = np.flatnonzero(np.diff(values[good]) != 0.0) + 1
    every = int(np.gcd.reduce(np.diff(changes))) if len(changes) > _CHANGES else 1
    if every > 1:
        again = np.ones(len(good), dtype=bool)
        again[changes[0] % every :: every] = False
        values[good[again]] = np.nan
        found.append(f"gives each reading {every} times, slower than the log; repetitions left out")
        good = good[~again]
    still = _still(time[good], values[good], r, column)
    if still and not _answers(time[good], values[good], r, column, still):
        still = []  # of exchanged columns, or a servo without power: the sensor is not to blame
    for low, high, count in still:
        values[(time >= low) & (time <= high)] = np.nan
        found.append(
            f"does not move between {low:.4g} and {high:.4g} s while the command does ({count}"
            " changes); these readings are left out, check the sensor"
        )
    return found


def _still(
    time: Array, values: Array, r: Measurement, column: int
) -> list[tuple[float, float, int]]:
    """Begin, end [s] and commands of every stretch in which a sensor stands still."""
    from scipy.ndimage import binary_dilation, maximum_filter1d, minimum_filter1d

    command = r.command.values[:, column]
    reach = _MOVED * float(np.ptp(command))
    if len(values) < _CHANGES or reach == 0.0 or np.ptp(values) == 0.0:
        return []  # a constant column is refused as such
    period = float(np.median(np.diff(time)))
    answered = max(_ANSWERED, 10.0 * period)
    low, high = np.quantile(values, (0.05, 0.95))
    noise = _NOISE * clipped_rms(np.diff(values, 2) / np.sqrt(6.0))
    span = max(int(np.ceil(_STILL / period)), 8) // 2 * 2 + 1
    found: list[tuple[float, float, int]] = []
    for band in (0.0, noise) if noise < 0.1 * (high - low) else (0.0,):
        calm = maximum_filter1d(values, span) - minimum_filter1d(values, span) <= band
        calm = binary_dilation(calm, np.ones(span, dtype=bool))
        edges = np.flatnonzero(np.diff(np.concatenate([[0], calm.astype(int), [0]])))
        for a, b in zip(edges[::2], edges[1::2] - 1, strict=True):
            first = max(int(np.searchsorted(r.command.time, time[a], side="right")) - 1, 0)
            last = int(np.searchsorted(r.command.time, time[b] - answered, side="right"))
            held = command[first:last]
            if len(held) and np.ptp(held) >= reach and not _beside(found, time[a], time[b]):
                count = int(np.sum(np.diff(held) != 0.0))
                found.append((float(time[a]), float(time[b]), count))
    return sorted(found)


def _answers(
    time: Array,
    values: Array,
    r: Measurement,
    column: int,
    still: Sequence[tuple[float, float, int]],
) -> bool:
    """Whether readings follow the command outside the stretches in which they stand still."""
    moves = np.ones(len(time), dtype=bool)
    for low, high, _ in still:
        moves &= (time < low) | (time > high)
    answer = values[moves] - values[moves].mean()
    if not answer.any():
        return False
    best = 0.0
    for late in _LAGS:
        place = np.searchsorted(r.command.time, time[moves] - late, side="right") - 1
        held = r.command.values[np.maximum(place, 0), column]
        held = held - held.mean()
        if held.any():
            likeness = abs(float(held @ answer)) / float(np.sqrt(held @ held * (answer @ answer)))
            best = max(best, likeness)
    return best > _LIKE


def _beside(found: Sequence[tuple[float, float, int]], begin: float, end: float) -> bool:
    return any(low <= end and begin <= high for low, high, _ in found)
