"""Whether a servo has a dead band and play: what predicts steps held out better than without."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.array import Array
from analysis.identify.problem.noise import Mask
from analysis.identify.problem.problem import Problem
from analysis.identify.problem.segments import step_folds, step_of_row
from analysis.identify.servo.descent import descend, loss_of, project
from analysis.identify.servo.starts import reverses, scales, with_values
from analysis.transfer_function.servo import Structure

HOPELESS = 10.0  # times the lowest loss: what a dead band or play does not explain
WORTH = 0.97  # of the held-out loss: what a parameter more must save
_FOLLOWED = 3
_FOLDS = 4


@dataclass(frozen=True, slots=True)
class Choice:
    """Parameters to search and a minimum over them.

    Attributes
    ----------
    free : places in θ of what is searched
    theta : the minimum
    more : dead band or play is searched: they must be worth it
    """

    free: NDArray[np.intp]
    theta: Array
    more: bool


def lowest(
    problem: Problem,
    axis: int,
    structure: Structure,
    starts: list[Array],
    max_delay: float,
    free: NDArray[np.intp],
) -> Array:
    """Where the best few of the starts lead, the lowest of them."""
    ranked = sorted(starts, key=lambda t: loss_of(problem, axis, structure, t))[:_FOLLOWED]
    ended = [descend(problem, axis, structure, t, max_delay, free)[0] for t in ranked]
    return min(ended, key=lambda t: loss_of(problem, axis, structure, t))


def always_free(problem: Problem, structure: Structure) -> NDArray[np.intp]:
    """Parameters that are always searched: all but dead band and backlash."""
    poles = problem.layout.poles
    own = np.arange(poles + 2)
    return np.append(own, [poles + 4, poles + 5]) if structure == "set-point" else own


def dead_band_and_play(
    problem: Problem,
    axis: int,
    structure: Structure,
    theta: Array,
    starts: list[Array],
    max_delay: float,
    static: float,
) -> list[Choice]:
    """What may be freed and the minimum found with it, first without a parameter more.

    Where the gimbal settled, the dead band is read off there (`static`, of `static_dead_band`).
    Backlash shows only where the motion reverses: elsewhere it is gain by another name.
    """
    poles = problem.layout.poles
    tight = always_free(problem, structure)
    band, play_ = poles + 2, poles + 3
    choices = [Choice(tight, theta, False)]
    if structure in ("speed", "clipped"):
        if static > 0.0:  # by chance in one of forty, and of a structure that is not the servo's
            begin = with_values(theta, [band], np.array([static]))
            end = lowest(problem, axis, structure, [begin], max_delay, tight)
            choices.append(Choice(tight, end, False))
        extra = [[band], [play_], [band, play_]]
    else:
        extra = [[play_]] if structure == "command" else [[band], [play_], [band, play_]]
    shown = scales(problem, structure)
    for more in extra if reverses(problem, axis) else [e for e in extra if play_ not in e]:
        free = np.concatenate([tight, more])
        # settled angles fall short by a dead band or by half of a backlash: they cannot tell which
        shares = [static / len(more) if k == band else 2.0 * static / len(more) for k in more]
        values = np.maximum(shares, shown[more])
        near = [theta]
        if structure == "set-point":  # one that is missed is taken for slew and delay: begin there
            near += [c.theta for c in choices[1:] if len(more) > 1]
        begins = [with_values(t, more, np.where(t[more] > 0.0, t[more], values)) for t in near]
        if structure != "set-point" or len(more) > 1:
            begins += [with_values(t, more, values) for t in starts]
        end = lowest(problem, axis, structure, begins, max_delay, free)
        choices.append(Choice(free, end, True))
    return choices


def by_steps_held_out(
    problem: Problem,
    axis: int,
    structure: Structure,
    choices: Sequence[Choice],
    max_delay: float,
    least: float,
) -> tuple[NDArray[np.intp], Array, Array]:
    """Which parameters to free, and where to start: dead band and backlash if they predict steps.

    On the steps it is fitted to, a second excuse for a static error always helps; so steps held
    out decide, whose losses (steps,) are returned. Where no choice comes near `least`, the lowest
    loss held out of structures tried before, the losses are those of the fit.
    """
    folds = step_folds(problem, axis, _FOLDS)
    steps = step_of_row(problem, axis)
    inside = [loss_of(problem, axis, structure, c.theta) for c in choices]
    if min(inside) > HOPELESS * least:
        chosen = choices[int(np.argmin(inside))]
        squares = project(problem, axis, structure, chosen.theta)[0] ** 2
        return chosen.free, chosen.theta, np.bincount(steps, squares).astype(np.float64)
    total, losses = np.full(len(choices), np.inf), [np.zeros(0)] * len(choices)
    for i in np.argsort(inside):
        out_of_reach = float(total.min()) / WORTH  # the loss held out is hardly below that inside
        squares = np.full(len(problem.measured), np.inf if inside[i] > out_of_reach else 0.0)
        for fold in folds:
            if float(squares.sum()) > out_of_reach:
                break
            training = problem.weighed(np.where(fold, 0.0, problem.weight))
            begin, free = choices[i].theta, choices[i].free
            found, _ = descend(training, axis, structure, begin, max_delay, free)
            squares += _held_out(problem, project(training, axis, structure, found)[2], fold)
        else:
            losses[i] = np.bincount(steps, squares).astype(np.float64)
            total[i] = float(losses[i].sum())
    best = int(np.argmin(total))
    simple = int(
        np.argmin([t if not c.more else np.inf for t, c in zip(total, choices, strict=True)])
    )
    if total[best] >= WORTH * total[simple]:
        best = simple
    return choices[best].free, choices[best].theta, losses[best]


def _held_out(problem: Problem, residual: Array, fold: Mask) -> Array:
    """Weighted squares (rows,) of the held-out residual around each record's own offset."""
    squares = np.zeros(len(residual))
    for index in range(len(problem.parts)):
        for is_rate in (False, True):
            rows = fold & (problem.owner == index) & (problem.is_rate == is_rate)
            rows &= problem.weight > 0.0
            if rows.any():
                centred = residual[rows] - residual[rows].mean()
                squares[rows] = (centred * problem.weight[rows]) ** 2
    return squares
