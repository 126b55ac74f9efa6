"""How many poles and zeros: the smallest order that predicts steps it has not seen."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.identify import checks
from analysis.identify.errors import IdentificationError
from analysis.identify.fit import search
from analysis.identify.identification import layout_of
from analysis.identify.prediction import nrmse_fit
from analysis.identify.problem import Problem, assemble
from analysis.identify.records import Record
from analysis.identify.segments import step_folds

Array = NDArray[np.float64]

_FOLDS = 4
_GAIN = 0.02  # of the error: what one more parameter must save on steps held out


@dataclass(frozen=True, slots=True)
class OrderScore:
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

    def to_dict(self) -> dict[str, object]:
        """Plain numbers for JSON."""
        return asdict(self)


def select_order(
    records: Sequence[Record],
    candidates: Sequence[tuple[int, int]] = ((1, 0), (2, 0), (2, 1), (3, 0), (3, 1)),
    *,
    axis: int = 0,
    max_delay: float = 0.1,
) -> tuple[tuple[int, int], tuple[OrderScore, ...]]:
    """Choose (poles, zeros) for one axis on held-out steps; returns the choice and all scores.

    Every order is fitted with a quarter of the steps left out, four times over. The first in order
    of size is taken whose error no larger order undercuts by more than 2 % per parameter.

    Raises
    ------
    IdentificationError
        for no candidates, and records no model can come from.
    """
    if not candidates:
        raise IdentificationError("no orders to choose from")
    checks.check_records(records)
    raw = []
    for poles, zeros in sorted(candidates, key=lambda c: (sum(c), c[0])):
        problem = assemble(records, axis, layout_of(records, poles, zeros), shared_offset=False)
        raw.append(((poles, zeros), *_held_out(problem, max_delay)))
    least = min(error for _, _, error in raw)
    scores = tuple(OrderScore(*order, fit, error / least) for order, fit, error in raw)
    chosen = scores[0]
    for score in scores[1:]:
        more = score.poles + score.zeros - chosen.poles - chosen.zeros
        if score.error < chosen.error * (1.0 - _GAIN * max(more, 1)):
            chosen = score
    return (chosen.poles, chosen.zeros), scores


def _held_out(problem: Problem, max_delay: float) -> tuple[float, float]:
    """Fit [%] and error over all folds, in units of a noise that is the same for every order."""
    folds = step_folds(problem, None, _FOLDS)
    start = search(problem, max_delay=max_delay).solution.theta
    residual = np.zeros(len(problem.measured))
    for fold in folds:
        fit = search(problem, max_delay=max_delay, keep=~fold, start=start)
        residual[fold] = fit.solution.residual[fold]
    fits, powers = [], []
    for is_rate in (False, True):
        rows = problem.is_rate == is_rate
        if not rows.any():
            continue
        measured = problem.measured[rows]
        fits.append(nrmse_fit(measured, measured - residual[rows]))
        far = np.abs(residual[rows]) < 8.0 * np.median(np.abs(residual[rows])) + 1e-12
        powers.append(float(np.log(np.mean(residual[rows][far] ** 2))))
    return float(np.mean(fits)), float(np.exp(np.mean(powers) / 2.0))
