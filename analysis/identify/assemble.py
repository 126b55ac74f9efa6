"""The samples of one axis from all records, as one least-squares problem."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from analysis.identify.layout import Layout
from analysis.identify.problem import Problem
from analysis.identify.states import Part, Rows
from analysis.recording.record import Record

Array = NDArray[np.float64]


def assemble(
    records: Sequence[Record], axis: int, layout: Layout, *, shared_offset: bool = True
) -> Problem:
    """Collect the samples of one axis from all records, every row weighing the same."""
    parts, angle, rate = [], [], []
    for r in records:
        a_rows, r_rows = _measured_rows(r.angle, axis), _measured_rows(r.rate, axis)
        parts.append(
            Part(
                r.time, r.input_time, r.input, a_rows, r_rows, r.initial == "free", r.slack, r.doubt
            )
        )
        angle.append(np.zeros(0) if r.angle is None else r.angle[a_rows, axis])
        rate.append(np.zeros(0) if r.rate is None else r.rate[r_rows, axis])
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
        shared_offset,
    )


def _measured_rows(values: Array | None, axis: int) -> Rows:
    if values is None:
        return np.zeros(0, dtype=np.intp)
    return np.flatnonzero(np.isfinite(values[:, axis]))
