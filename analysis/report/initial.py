"""Records that begin with a command already given: a step from the first reading."""

from dataclasses import replace

import numpy as np

from analysis.array import Array
from analysis.recording.measurements import Measurement

MOVED = 0.5  # of the distance between first reading and command, at least, makes it a step
LARGER = 5.0  # times the scatter at the end


def with_initial_step(run: Measurement) -> tuple[Measurement, tuple[str, ...]]:
    """Prepend the first angle as the command of axes that move to a constant command.

    Logs of single steps often begin at the command. Its instant is then that of the first row.

    Returns
    -------
    The run, with one more command row if an axis needs it; and a note for each such axis
    """
    before = run.command.values[0].copy()
    notes = []
    for k, name in enumerate(run.command.components):
        axis = run.axis(name)
        if axis is None or len(axis.command.changes()) or not _moves(axis):
            continue
        before[k] = axis.angles.value[0]
        notes.append(
            f"{run.name}, {name}: the record begins with its command; the step is taken to start "
            "at the first row, from the first angle"
        )
    if not notes:
        return run, ()
    command = run.command
    period = float(np.median(np.diff(run.axes[0].angles.time)))
    # stamps increase, so the command itself moves by a thousandth of a period
    time: Array = np.concatenate([[command.time[0]], command.time + 1e-3 * period])
    prepended = replace(command, time=time, values=np.vstack([before, command.values]))
    return replace(run, command=prepended), tuple(notes)


def _moves(axis: Measurement) -> bool:
    angle, command = axis.angles.value, float(axis.command.value[0])
    tail = angle[-max(3, len(angle) // 5) :]
    distance = abs(command - angle[0])
    left = abs(command - float(tail.mean()))
    return bool(distance > LARGER * float(tail.std()) and left < (1.0 - MOVED) * distance)
