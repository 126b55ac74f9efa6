"""Fit of a bounded servo: linear part and delay together with rate limit, dead band and backlash.

Four places for the bound are tried, because servos differ in it, and the one that predicts steps
held out best is kept. `speed`: the servo's own loop saturates (`servo.motion`). `command`: the
command is limited to ramps ahead of the linear part (`problem.ramps`). `clipped`: the speed of a
linear servo is clipped. `set-point`: as `speed`,
behind a set point of bounded speed, with a limit each way. Gain, offsets and biases enter linearly
and are solved for in every step.
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from analysis.array import Array
from analysis.identify import progress
from analysis.identify.errors import IdentificationError
from analysis.identify.linear.starts import ROWS, thinned
from analysis.identify.problem.noise import Mask, quantisation
from analysis.identify.problem.problem import Problem
from analysis.identify.problem.segments import step_folds, step_of_row
from analysis.identify.servo.dead_band import static_dead_band
from analysis.identify.servo.descent import (
    descend,
    fit_at,
    in_units,
    loss_of,
    prepared,
    project,
    settled,
)
from analysis.identify.servo.fit import ServoFit
from analysis.identify.servo.reached import without_idle_limits
from analysis.identify.servo.starts import grid_of_starts, reverses, scales, with_values
from analysis.transfer_function.servo import Structure

# the one that can do most first: what is far behind it needs no steps held out
_ORDER: tuple[Structure, ...] = ("set-point", "speed", "command", "clipped")
_FOLLOWED = 3
_FOLDS = 4
_WORTH = 0.97  # of the held-out loss: what a parameter more must save
_HOPELESS = 10.0  # times the lowest loss: what a dead band or play does not explain
_CHANCE = 1.64  # deviations of a difference that chance exceeds in 5 % of all cases


def search_servo(
    problem: Problem,
    axis: int,
    *,
    max_delay: float,
    structure: Structure | None = None,
    keep: Mask | None = None,
) -> ServoFit:
    """Fit a bounded servo to one axis, driven by the command of the same number.

    Raises
    ------
    IdentificationError : the layout has zeros or more than two poles, which no bounded servo here
        has, or one pole where the structure has two
    """
    if problem.layout.zeros or problem.layout.poles not in (1, 2):
        raise IdentificationError(
            f"servo: fitted with 1 or 2 poles and no zeros, not {problem.layout.poles} and "
            f"{problem.layout.zeros}; leave zeros away or fit without the servo"
        )
    if problem.layout.poles == 1 and structure in ("clipped", "set-point"):
        raise IdentificationError(f"servo: the structure '{structure}' has 2 poles, not 1")
    kept = np.ones(len(problem.measured), dtype=bool) if keep is None else keep
    floor = quantisation(problem)
    problem, alike, unit = prepared(problem, axis, kept, floor)
    tried: tuple[Structure, ...] = ("speed", "command", "set-point", "clipped")
    if structure is not None:
        tried = (structure,)
    elif problem.layout.poles == 1:
        tried = ("speed", "command")
    elif not reverses(problem, axis):
        # steps one way only do not show what becomes of small motions to and fro
        tried = ("speed", "command", "clipped")
    few = thinned(alike, ROWS)
    begins = {s: grid_of_starts(alike, max_delay, s) for s in tried}
    ends: dict[Structure, Array] = {}
    for s in tried:
        progress.say(f"servo of structure {s}")
        ends[s] = _best(few, axis, s, begins[s], max_delay, _always(few, s))
    without = {s: loss_of(few, axis, s, end) for s, end in ends.items()}
    fits: dict[Structure, ServoFit] = {}
    held_out: dict[Structure, Array] = {}
    for s in sorted(tried, key=_ORDER.index):
        progress.say(f"servo of structure {s}, dead band and play")
        least = min((float(loss.sum()) for loss in held_out.values()), default=np.inf)
        if without[s] > _HOPELESS * (least if s == "clipped" else min(without.values())):
            # far behind another already where it is fitted: dead band and play are not looked for
            fits[s] = fit_at(few, axis, s, ends[s], (np.nan, np.nan), True)
            squares = fits[s].weighted ** 2
            held_out[s] = np.bincount(step_of_row(few, axis), squares).astype(np.float64)
            continue
        static = static_dead_band(alike, axis)
        free, theta, held_out[s] = _worth_having(
            few, axis, s, ends[s], begins[s], max_delay, static, least
        )
        fits[s] = settled(alike, axis, s, theta, free, max_delay, kept, floor)
    fits = {s: fits[s] for s in tried}
    losses = {s: float(held_out[s].sum()) for s in tried}
    if "set-point" in losses:
        losses["set-point"] /= _WORTH
    if "clipped" in losses and not _better("clipped", "speed", held_out):
        # servos limit what their loop aims at; the speed itself is clipped in simulations
        losses["clipped"] = max(losses["clipped"], losses.get("speed", 0.0))
    best = min(fits.values(), key=lambda f: losses[f.structure])
    rival = _rival(best, fits, held_out)
    best = without_idle_limits(best, axis, max_delay)
    return replace(in_units(best, problem, unit), losses=losses, rival=rival)


def _best(
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


def _always(problem: Problem, structure: Structure) -> NDArray[np.intp]:
    """Parameters that are always searched: all but dead band and backlash."""
    poles = problem.layout.poles
    own = np.arange(poles + 2)
    return np.append(own, [poles + 4, poles + 5]) if structure == "set-point" else own


def _worth_having(
    problem: Problem,
    axis: int,
    structure: Structure,
    theta: Array,
    starts: list[Array],
    max_delay: float,
    static: float,
    least: float,
) -> tuple[NDArray[np.intp], Array, Array]:
    """Which parameters to free, and where to start: dead band and backlash if they predict steps.

    On the steps it is fitted to, a second excuse for a static error always helps; so steps held
    out decide, whose losses (steps,) are returned. Where the gimbal settled, the dead band is read
    off there (`static_dead_band`). Backlash shows only where the motion reverses: elsewhere it is
    gain by another name. Where no choice comes near `least`, the lowest loss held out of structures
    tried before, the losses are those of the fit.
    """
    poles = problem.layout.poles
    tight = _always(problem, structure)
    band, play_ = poles + 2, poles + 3
    choices = [(tight, theta)]
    if structure in ("speed", "clipped"):
        if static > 0.0:  # by chance in one of forty, and of a structure that is not the servo's
            begin = with_values(theta, [band], np.array([static]))
            choices.append((tight, _best(problem, axis, structure, [begin], max_delay, tight)))
        extra = [[band], [play_], [band, play_]]
    else:
        extra = [[play_]] if structure == "command" else [[band], [play_], [band, play_]]
    unpaid = len(choices)
    shown = scales(problem, structure)
    for more in extra if reverses(problem, axis) else [e for e in extra if play_ not in e]:
        free = np.concatenate([tight, more])
        # settled angles fall short by a dead band or by half of a backlash: they cannot tell which
        shares = [static / len(more) if k == band else 2.0 * static / len(more) for k in more]
        values = np.maximum(shares, shown[more])
        near = [theta]
        if structure == "set-point":  # one that is missed is taken for slew and delay: begin there
            near += [start for _, start in choices[1:] if len(more) > 1]
        begins = [with_values(t, more, np.where(t[more] > 0.0, t[more], values)) for t in near]
        if structure != "set-point" or len(more) > 1:
            begins += [with_values(t, more, values) for t in starts]
        choices.append((free, _best(problem, axis, structure, begins, max_delay, free)))
    folds = step_folds(problem, axis, _FOLDS)
    steps = step_of_row(problem, axis)
    inside = [loss_of(problem, axis, structure, start) for _, start in choices]
    if min(inside) > _HOPELESS * least:
        free, start = choices[int(np.argmin(inside))]
        squares = project(problem, axis, structure, start)[0] ** 2
        return free, start, np.bincount(steps, squares).astype(np.float64)
    total, losses = np.full(len(choices), np.inf), [np.zeros(0)] * len(choices)
    for i in np.argsort(inside):
        free, start = choices[i]
        out_of_reach = float(total.min()) / _WORTH  # the loss held out is hardly below that inside
        squares = np.full(len(problem.measured), np.inf if inside[i] > out_of_reach else 0.0)
        for fold in folds:
            if float(squares.sum()) > out_of_reach:
                break
            training = problem.weighed(np.where(fold, 0.0, problem.weight))
            found, _ = descend(training, axis, structure, start, max_delay, free)
            squares += _held_out(problem, project(training, axis, structure, found)[2], fold)
        else:
            losses[i] = np.bincount(steps, squares).astype(np.float64)
            total[i] = float(losses[i].sum())
    best, simple = int(np.argmin(total)), int(np.argmin(total[:unpaid]))
    if total[best] >= _WORTH * total[simple]:
        best = simple
    return *choices[best], losses[best]


def _better(one: Structure, other: Structure, held_out: Mapping[Structure, Array]) -> bool:
    """Whether one structure predicts steps held out better than another, beyond chance.

    By the scatter of the differences over the steps, of models none of which holds the other:
    Q. H. Vuong, Econometrica 57 (1989), 307-333.
    """
    if other not in held_out:
        return True
    gain = held_out[other] - held_out[one]
    deviation = float(np.std(gain, ddof=1)) * np.sqrt(len(gain)) if len(gain) > 1 else 0.0
    # one step that only one of them explains makes the scatter as large as the gain
    return float(gain.sum()) > min(_CHANCE * deviation, float(held_out[one].sum()))


def _rival(
    best: ServoFit, fits: Mapping[Structure, ServoFit], held_out: Mapping[Structure, Array]
) -> tuple[Structure, Array] | None:
    """The structure that predicts steps held out nearly as well, and what its figures differ by."""
    near = [
        s
        for s in fits
        if s != best.structure
        and (s, best.structure) != ("set-point", "speed")  # it holds the other
        and not _better(best.structure, s, held_out)
    ]
    if not near:
        return None
    other = min(near, key=lambda s: float(held_out[s].sum()))
    shared = best.poles + 2
    return other, fits[other].theta[:shared] - best.theta[:shared]


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
