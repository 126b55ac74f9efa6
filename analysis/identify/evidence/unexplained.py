"""What a better model could still explain: an answer to the commands, a change with their size."""

import numpy as np

from analysis.array import Array
from analysis.identify.evidence.uncertainty import of_steps
from analysis.identify.problem.problem import Problem, Solution
from analysis.identify.problem.segments import step_folds, step_of_row
from analysis.identify.problem.states import Part

_KNOTS = 24
_REMEMBERED = 1.0  # s after a command that count as its answer
_ROWS = 4000  # per sensor, of all records together; more change nothing
_FOLDS = 4
_RIDGE = 1e-6
_SMALLEST = 0.02  # of the largest step; smaller ones count as this one


def repeatable(problem: Problem, residual: Array, column: int) -> float:
    """Share of the residual's power that a better linear model would take; 0 if none.

    A step response that is free at 24 times after a command is fitted to the residual of three
    quarters of the steps and judged on the others: noise, scatter of the steps and what grows
    otherwise than with the command do not repeat there.

    Parameters
    ----------
    residual : measured − model (rows,)
    column : the command that the axis is to follow
    """
    left = explained = 0.0
    folds = step_folds(problem, column, _FOLDS)
    for is_rate in (False, True):
        rows = np.flatnonzero((problem.is_rate == is_rate) & (problem.weight > 0.0))
        rows = rows[:: max(1, len(rows) // _ROWS)]
        if len(rows) < 2 * _KNOTS:
            continue
        design = np.zeros((len(rows), _KNOTS))
        for index, part in enumerate(problem.parts):
            mine = problem.owner[rows] == index
            design[mine] = _answers(part, column, problem.time[rows[mine]])
        target = residual[rows] * problem.weight[rows]
        for fold in folds:
            out = fold[rows]
            A, b = design[~out], target[~out]
            normal = A.T @ A
            normal[np.diag_indices(_KNOTS)] += _RIDGE * max(float(np.trace(normal)), 1e-300)
            explained_by = design[out] @ np.linalg.solve(normal, A.T @ b)
            left += float(np.sum((target[out] - explained_by) ** 2))
            explained += float(np.sum(target[out] ** 2))
    return max(0.0, 1.0 - left / explained) if explained > 0.0 else 0.0


def over_sizes(
    problem: Problem, jacobian: Array, weighted: Array, places: list[int], column: int
) -> tuple[Array, Array] | None:
    """Change of some parameters from the smallest to the largest step, and its covariance.

    One Gauss-Newton step towards parameters that are linear in the logarithm of the size; the
    covariance is the jackknife's over whole steps, None with too few of them.

    Parameters
    ----------
    jacobian, weighted : of the fit (rows, all), (rows,)
    column : the command whose steps count
    """
    size = np.full(len(weighted), np.nan)
    for index, part in enumerate(problem.parts):
        step = np.abs(np.diff(part.input[:, column]))
        at, step = part.input_time[1:][step > 0.0], step[step > 0.0]
        mine = problem.owner == index
        last = np.searchsorted(at, problem.time[mine], side="right") - 1
        size[mine] = np.where(last >= 0, np.append(step, np.nan)[last], np.nan)
    counts = np.isfinite(size) & (problem.weight > 0.0)
    if not counts.any():
        return None
    size = np.log(np.maximum(size, _SMALLEST * size[counts].max()))
    apart = np.where(counts, size - size[counts].mean(), 0.0)
    whole = np.hstack([jacobian, jacobian[:, places] * apart[:, None]])
    spread = of_steps(whole, weighted, step_of_row(problem))
    if spread is None:
        return None
    new = slice(jacobian.shape[1], None)
    found = np.linalg.lstsq(whole, weighted, rcond=1e-10)[0][new]
    span = float(np.ptp(apart))
    return np.asarray(span * found), span**2 * spread[new, new]


def smeared(
    problem: Problem, solution: Solution, jacobian: Array, place: int, stamps: float
) -> Array:
    """What steps at scattered times change the parameters by (all,).

    The mean of answers at scattered times is the answer and half the variance of the times on its
    second derivative; the fit takes of that what its parameters can.

    Parameters
    ----------
    place : of the delay among the parameters
    stamps : scatter of the times [s]
    """
    theta, shift = solution.theta, np.zeros(len(solution.theta))
    shift[place] = stamps
    early, now, late = (
        problem.predict(theta + k * shift, solution.linear) for k in (-1.0, 0.0, 1.0)
    )
    bend = 0.5 * (early - 2.0 * now + late) * problem.weight
    return np.asarray(np.linalg.lstsq(jacobian, bend, rcond=1e-10)[0])


def _answers(part: Part, column: int, time: Array) -> Array:
    """Regressors of a free step response (n, knots): sizes of earlier commands by their age."""
    size = np.diff(part.input[:, column], prepend=part.input[0, column])
    at, size = part.input_time[size != 0.0], size[size != 0.0]
    found = np.zeros((len(time), _KNOTS))
    last = np.searchsorted(at, time, side="right") - 1
    rows = np.arange(len(time))
    for back in range(len(at)):
        which = last - back
        age = time - at[np.maximum(which, 0)]
        near = (which >= 0) & (age < _REMEMBERED)
        if not near.any():
            break
        place = (_KNOTS - 1) * np.sqrt(age[near] / _REMEMBERED)
        low = np.minimum(place.astype(int), _KNOTS - 2)
        share, weight = place - low, size[which[near]]
        np.add.at(found, (rows[near], low), (1.0 - share) * weight)
        np.add.at(found, (rows[near], low + 1), share * weight)
    return found
