"""Stretches in which a sensor stands still while the gimbal is commanded to move."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from analysis.array import Array
from analysis.recording.measurements import Measurement

_STILL = 0.5  # s of equal readings
_ANSWERED = 0.25  # s, or ten readings: by then a gimbal has begun to answer
_MOVED = 0.25  # of the command's range


def without_frozen(records: Sequence[Measurement]) -> tuple[list[Measurement], list[str]]:
    """Records without the readings of a sensor that stood still, and a line for each stretch.

    Equal readings under commands that move over a quarter of their range, the last of them long
    enough ago for any gimbal to have answered. A servo that ignores small commands is no such case.
    """
    kept, found = [], []
    for r in records:
        series = {}
        for what, sensor in r.sensors:
            values = sensor.values.copy()
            for axis, name in enumerate(r.outputs):
                column = r.inputs.index(name) if name in r.inputs else 0
                readings = sensor.select((name,)).known()
                for low, high, count in _still(readings.time, readings.value, r, column):
                    values[(sensor.time >= low) & (sensor.time <= high), axis] = np.nan
                    found.append(
                        f"{r.name}: {what} '{name}' does not move between {low:.4g} and {high:.4g}"
                        f" s while the command does ({count} changes); these readings are left out,"
                        " check the sensor"
                    )
            series[what] = replace(sensor, values=values)
        kept.append(replace(r, angle=series.get("angle"), rate=series.get("rate")))
    return (kept if found else list(records)), found


def _still(
    time: Array, values: Array, r: Measurement, column: int
) -> list[tuple[float, float, int]]:
    """Begin, end [s] and commands of every such stretch of a sensor."""
    command = r.command.values[:, column]
    if not len(values) or np.ptp(values) == 0.0:
        return []  # a constant column, which is refused as such
    reach = _MOVED * float(np.ptp(command))
    answered = max(_ANSWERED, 10.0 * r.period)
    edges = np.flatnonzero(np.diff(values) != 0.0)
    found = []
    for a, b in zip(np.append(0, edges + 1), np.append(edges, len(values) - 1), strict=True):
        if time[b] - time[a] < _STILL + answered:
            continue
        first = max(int(np.searchsorted(r.command.time, time[a], side="right")) - 1, 0)
        last = int(np.searchsorted(r.command.time, time[b] - answered, side="right"))
        held = command[first:last]
        if reach > 0.0 and len(held) and np.ptp(held) >= reach:
            found.append((float(time[a]), float(time[b]), int(np.sum(np.diff(held) != 0.0))))
    return found
