"""The samples of one axis from all records, as one least-squares problem."""

from collections.abc import Sequence

import numpy as np

from analysis.array import Array
from analysis.identify.problem.layout import Layout
from analysis.identify.problem.noise import Mask
from analysis.identify.problem.problem import Problem
from analysis.identify.problem.states import Part, Rows
from analysis.recording.measurements import Measurement
from analysis.recording.series import TimeSeries


def assemble(
    records: Sequence[Measurement], axis: int, layout: Layout, *, shared_offset: bool = True
) -> Problem:
    """Collect the samples of one axis from all records, every row weighing the same."""
    parts, angle, rate = [], [], []
    for r in records:
        (a_rows, a), (r_rows, v) = _readings(r, r.angle, axis), _readings(r, r.rate, axis)
        u, free = r.command, r.initial == "free"
        parts.append(Part(r.time, u.time, u.values, a_rows, r_rows, free, r.slack, r.doubt, r.late))
        angle.append(a)
        rate.append(v)
    counts = [len(x) for x in angle + rate]
    owner = np.repeat(np.tile(np.arange(len(records)), 2), counts)
    stamps = [p.time[p.angle_rows] for p in parts] + [p.time[p.rate_rows] for p in parts]
    is_rate = np.repeat([False, True], [sum(map(len, angle)), sum(map(len, rate))])
    measured = np.concatenate(angle + rate)
    return Problem(
        layout,
        tuple(parts),
        measured,
        is_rate,
        owner,
        np.concatenate(stamps),
        np.ones(len(measured)),
        _offsets(is_rate, owner, shared_offset),
    )


def _offsets(is_rate: Mask, owner: Rows, shared: bool) -> Array:
    """Columns of the angle offset, or those of each record, then of each record's gyro bias."""
    groups = [~is_rate & (owner == i) for i in np.unique(owner[~is_rate])]
    if shared and groups:
        groups = [~is_rate]
    groups += [is_rate & (owner == i) for i in np.unique(owner[is_rate])]
    return np.stack(groups, axis=1).astype(float)


def _readings(r: Measurement, series: TimeSeries | None, axis: int) -> tuple[Rows, Array]:
    """Places of one sensor's readings among the stamps of both, and their values."""
    if series is None:
        return np.zeros(0, dtype=np.intp), np.zeros(0)
    good = np.isfinite(series.values[:, axis])
    return np.searchsorted(r.time, series.time[good]), series.values[good, axis]
