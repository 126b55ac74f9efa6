"""Two motions and their difference as one recording."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from analysis import schema
from analysis.array import Array
from analysis.comparison import bridged
from analysis.recording import Measurement, TimeSeries

if TYPE_CHECKING:
    from twin.evaluation.drift import RunDrift

REFERENCE, OTHER, DIFFERENCE = "gimbal/reference", "gimbal/other", "gimbal/difference"


def record(
    file: Path,
    reference: TimeSeries,
    other: TimeSeries,
    run: Measurement,
    recordings: Sequence[Path],
    drift: "RunDrift | None",
) -> None:
    """Write both motions and their difference at the reference's stamps.

    Parameters
    ----------
    run : whose commands are recorded beside the motions
    recordings : files that were compared
    drift : of the gimbal of `run`, if it was estimated

    Raises
    ------
    RecorderError : the file cannot be written
    """
    from twin.recorder import Recorder

    signals = ["gimbal/command", REFERENCE, OTHER, DIFFERENCE]
    properties: dict[str, object] = {
        "command": "compare",
        "configuration": {"recordings": [str(f) for f in recordings]},
        "reference": reference.name,
        "other": other.name,
    }
    stamps = np.rint(reference.time * 1e9).astype(np.int64)
    rows = np.full((len(stamps), 8), np.nan)
    command = run.command.held(reference.time + 1e-9)
    for k, name in enumerate(schema.SIGNALS[REFERENCE].components):
        if name not in reference.components or name not in other.components:
            continue
        there = other.select((name,)).known()
        rows[:, k] = command[:, run.inputs.index(name)]
        rows[:, 2 + k] = reference.column(name)
        rows[:, 4 + k] = bridged(reference.time, there.time, there.value)
        rows[:, 6 + k] = rows[:, 4 + k] - rows[:, 2 + k]
    rows[:, :2] = np.nan_to_num(rows[:, :2])
    events = [(0.0, f"reference: {reference.name}", "INFO"), (0.0, f"other: {other.name}", "INFO")]
    if drift is not None:
        more = drift.signals(run.recording["gimbal/measured"])
        rows = np.hstack([rows, *(_placed(reference.time, *given) for given in more.values())])
        signals += more
        events += [(0.0, f"from the start: {t}", "INFO") for d in drift.axes.values()
                   for t in d.differs]  # fmt: skip
        events += [(c.noticed, c.text, "WARN") for c in drift.changes]
    with Recorder(file, signals=signals, properties=properties, drain_ns=8_000_000_000) as recorder:
        for when, text, level in sorted(events, key=lambda e: e[0]):
            recorder.event(max(int(stamps[0]), round(when * 1e9)), text, level)
        for stamp, row in zip(stamps.tolist(), rows, strict=True):
            recorder.row[:] = row
            recorder.commit(stamp, stamp)


def _placed(time: Array, stamps: Array, values: Array) -> Array:
    """Values (m, k) in the rows of times (n,) that they belong to; NaN in the others."""
    out = np.full((len(time), values.shape[1]), np.nan)
    out[np.minimum(np.searchsorted(time, stamps - 1e-9), len(time) - 1)] = values
    return out
