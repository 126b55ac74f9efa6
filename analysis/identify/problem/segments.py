"""Whole steps: what order selection holds out and the bootstrap draws."""

import numpy as np
from numpy.typing import NDArray

from analysis.array import Array
from analysis.identify.problem.problem import Problem

Mask = NDArray[np.bool_]

_MOST = 200  # segments: commands that change at every sample are cut into stretches instead


def step_of_row(problem: Problem, column: int | None = None) -> NDArray[np.intp]:
    """Number of the step every reading belongs to (rows,), counted through all records.

    A step lasts from one change of the command (any, or one column) to the next.
    """
    owner = np.zeros(len(problem.measured), dtype=np.intp)
    first = 0
    for index, part in enumerate(problem.parts):
        mine = problem.owner == index
        cuts = _cuts(part.input_time, part.input, column, _MOST // len(problem.parts) + 2)
        inside = cuts[(cuts > part.time[0]) & (cuts <= part.time[-1])]
        owner[mine] = first + np.searchsorted(inside, problem.time[mine], side="right")
        first += len(inside) + 1
    return owner


def step_folds(problem: Problem, column: int | None, folds: int) -> list[Mask]:
    """Masks of the readings (rows,) of every fold: neighbouring steps together.

    Test programmes often go through amplitudes in order; held out together, neighbours ask a model
    for an amplitude it has not seen.
    """
    number = step_of_row(problem, column)
    _, number = np.unique(number, return_inverse=True)
    folds = min(folds, int(number.max()) + 1)
    block = number * folds // (int(number.max()) + 1)
    return [block == fold for fold in range(folds)]


def _cuts(time: Array, command: Array, column: int | None, most: int) -> Array:
    moved = np.diff(command, axis=0) != 0.0
    rows = np.flatnonzero(moved.any(axis=1) if column is None else moved[:, column]) + 1
    if len(rows) > most:
        rows = rows[np.linspace(0, len(rows) - 1, most).astype(np.intp)]
    return time[rows]


def series_of(problem: Problem) -> list[NDArray[np.intp]]:
    """Rows of each sensor of each record that count, in the order of time."""
    counted = problem.weight > 0.0
    every = [
        np.flatnonzero(counted & (problem.is_rate == is_rate) & (problem.owner == index))
        for is_rate in (False, True)
        for index in range(len(problem.parts))
    ]
    return [rows for rows in every if len(rows)]
