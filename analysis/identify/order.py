"""How many poles and zeros: the smallest order that predicts steps it has not seen."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from analysis.array import Array
from analysis.identify import checks, progress
from analysis.identify.errors import IdentificationError
from analysis.identify.identification import check_order, layout_of, longest_delay
from analysis.identify.linear.fit import search
from analysis.identify.linear.starts import ROWS, thinned
from analysis.identify.prediction import nrmse_fit
from analysis.identify.problem.assemble import assemble
from analysis.identify.problem.problem import Problem
from analysis.identify.problem.segments import Mask, step_folds
from analysis.plain import Plain
from analysis.recording.measurements import Measurement

_FOLDS = 4
_GAIN = 0.02  # of the error: what one more parameter must save on steps held out


@dataclass(frozen=True, slots=True)
class OrderScore(Plain):
    """How well one order predicts steps that were held out.

    Attributes
    ----------
    poles, zeros : the order
    fit : NRMSE fit on held-out steps [%]
    error : weighted root mean square of the held-out residual; 1 is the noise of the best order
    """

    poles: int
    zeros: int
    fit: float
    error: float


def select_order(
    records: Sequence[Measurement],
    candidates: Sequence[tuple[int, int]] = ((1, 0), (2, 0), (2, 1), (3, 0), (3, 1), (4, 2)),
    *,
    delay: Literal["free"] | float = "free",
    axis: int = 0,
    max_delay: float | None = None,
) -> tuple[tuple[int, int], tuple[OrderScore, ...]]:
    """Choose (poles, zeros) for one axis on held-out steps; returns the choice and all scores.

    Every order is fitted with a quarter of the steps left out, four times over. The first in order
    of size is taken whose error no larger order undercuts by more than 2 % per parameter. Readings
    that the best order sets aside as spikes are left out for all; what only a smaller order cannot
    explain counts against it.

    Parameters
    ----------
    candidates : orders (poles, zeros) to choose from
    delay, max_delay : as for `identify`
    axis : number of the axis

    Raises
    ------
    IdentificationError : no candidates or impossible ones, and records no model can come from
    """
    if not candidates:
        raise IdentificationError("no orders to choose from")
    for order in candidates:
        check_order(*order, delay)
    checks.check_records(records)
    longest = longest_delay(records, max_delay)
    orders = sorted(candidates, key=lambda c: (sum(c), c[0]))
    problems = [
        assemble(records, axis, layout_of(records, *order, delay), shared_offset=False)
        for order in orders
    ]
    if problems[0].layout.inputs > 1:  # minutes with all readings
        problems = [thinned(problem, ROWS) for problem in problems]
    held_out = []
    for problem in problems:
        progress.say(f"axis {records[0].outputs[axis]}, {problem.layout.poles} poles")
        held_out.append(_held_out(problem, longest))
    whole = [_error(problems[0], h.residual, ~h.spikes) for h in held_out]
    kept = ~held_out[int(np.argmin(whole))].spikes
    errors = [_error(problems[0], h.residual, kept) for h in held_out]
    scores = tuple(
        OrderScore(*order, _fit(problems[0], h.residual, kept), error / min(errors))
        for order, h, error in zip(orders, held_out, errors, strict=True)
    )
    chosen = scores[0]
    for score in scores[1:]:
        more = score.poles + score.zeros - chosen.poles - chosen.zeros
        if score.error < chosen.error * (1.0 - _GAIN * max(more, 1)):
            chosen = score
    return (chosen.poles, chosen.zeros), scores


@dataclass(frozen=True, slots=True)
class _HeldOut:
    residual: Array  # of every reading, by a model that did not see its step (rows,)
    spikes: Mask  # what a fit of all steps sets aside (rows,)


def _held_out(problem: Problem, max_delay: float) -> _HeldOut:
    whole = search(problem, max_delay=max_delay)
    residual = np.zeros(len(problem.measured))
    for fold in step_folds(problem, None, _FOLDS):
        fit = search(problem, max_delay=max_delay, keep=~fold, start=whole.solution.theta)
        residual[fold] = fit.solution.residual[fold]
    return _HeldOut(residual, whole.spikes)


def _sensors(problem: Problem, kept: Mask) -> list[Mask]:
    both = [kept & (problem.is_rate == is_rate) for is_rate in (False, True)]
    return [rows for rows in both if rows.any()]


def _error(problem: Problem, residual: Array, kept: Mask) -> float:
    """Root mean square, geometric mean of both sensors: no noise has to be known."""
    powers = [np.log(np.mean(residual[rows] ** 2)) for rows in _sensors(problem, kept)]
    return float(np.exp(np.mean(powers) / 2.0))


def _fit(problem: Problem, residual: Array, kept: Mask) -> float:
    """NRMSE fit [%], mean of both sensors."""
    pairs = [(problem.measured[r], residual[r]) for r in _sensors(problem, kept)]
    return float(np.mean([nrmse_fit(measured, measured - off) for measured, off in pairs]))
