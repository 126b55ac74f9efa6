"""Fit of a bounded servo: linear part and delay together with rate limit, dead band and backlash.

Four places for the bound are tried, because servos differ in it, and the one that predicts steps
held out best is kept. `speed`: the servo's own loop saturates (`servo.motion`). `command`: the
command is limited to ramps ahead of the linear part (`problem.ramps`). `clipped`: the speed of a
linear servo is clipped. `set-point`: as `speed`,
behind a set point of bounded speed, with a limit each way. Gain, offsets and biases enter linearly
and are solved for in every step.
"""

from collections.abc import Iterable, Mapping
from dataclasses import replace

import numpy as np

from analysis.array import Array
from analysis.identify import progress
from analysis.identify.errors import IdentificationError
from analysis.identify.linear.starts import ROWS, thinned
from analysis.identify.problem.noise import Mask, quantisation
from analysis.identify.problem.problem import Problem
from analysis.identify.problem.segments import step_of_row
from analysis.identify.servo.dead_band import static_dead_band
from analysis.identify.servo.dead_band_and_play import (
    HOPELESS,
    WORTH,
    always_free,
    by_steps_held_out,
    dead_band_and_play,
    lowest,
)
from analysis.identify.servo.descent import (
    fit_at,
    in_units,
    loss_of,
    prepared,
    settled,
)
from analysis.identify.servo.fit import ServoFit
from analysis.identify.servo.reached import without_idle_limits
from analysis.identify.servo.starts import grid_of_starts, reverses
from analysis.transfer_function.servo import Structure

# the one that can do most first: what is far behind it needs no steps held out
_ORDER: tuple[Structure, ...] = ("set-point", "speed", "command", "clipped")
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
    _check(problem, structure)
    kept = np.ones(len(problem.measured), dtype=bool) if keep is None else keep
    floor = quantisation(problem)
    problem, alike, unit = prepared(problem, axis, kept, floor)
    tried = _tried(problem, axis, structure)
    few = thinned(alike, ROWS)
    begins = {s: grid_of_starts(alike, max_delay, s) for s in tried}
    ends: dict[Structure, Array] = {}
    for s in tried:
        progress.say(f"servo of structure {s}")
        ends[s] = lowest(few, axis, s, begins[s], max_delay, always_free(few, s))
    without = {s: loss_of(few, axis, s, end) for s, end in ends.items()}
    fits: dict[Structure, ServoFit] = {}
    held_out: dict[Structure, Array] = {}
    for s in sorted(tried, key=_ORDER.index):
        progress.say(f"servo of structure {s}, dead band and play")
        least = min((float(loss.sum()) for loss in held_out.values()), default=np.inf)
        if without[s] > HOPELESS * (least if s == "clipped" else min(without.values())):
            # far behind another already where it is fitted: dead band and play are not looked for
            fits[s] = fit_at(few, axis, s, ends[s], (np.nan, np.nan), True)
            squares = fits[s].weighted ** 2
            held_out[s] = np.bincount(step_of_row(few, axis), squares).astype(np.float64)
            continue
        static = static_dead_band(alike, axis)
        choices = dead_band_and_play(few, axis, s, ends[s], begins[s], max_delay, static)
        free, theta, held_out[s] = by_steps_held_out(few, axis, s, choices, max_delay, least)
        fits[s] = settled(alike, axis, s, theta, free, max_delay, kept, floor)
    losses = _losses(tried, held_out)
    best = min((fits[s] for s in tried), key=lambda f: losses[f.structure])
    rival = _rival(best, fits, held_out)
    best = without_idle_limits(best, axis, max_delay)
    return replace(in_units(best, problem, unit), losses=losses, rival=rival)


def _check(problem: Problem, structure: Structure | None) -> None:
    if problem.layout.zeros or problem.layout.poles not in (1, 2):
        raise IdentificationError(
            f"servo: fitted with 1 or 2 poles and no zeros, not {problem.layout.poles} and "
            f"{problem.layout.zeros}; leave zeros away or fit without the servo"
        )
    if problem.layout.poles == 1 and structure in ("clipped", "set-point"):
        raise IdentificationError(f"servo: the structure '{structure}' has 2 poles, not 1")


def _tried(problem: Problem, axis: int, structure: Structure | None) -> tuple[Structure, ...]:
    """The structures that the order and the record allow, or the one that is asked for."""
    if structure is not None:
        return (structure,)
    if problem.layout.poles == 1:
        return "speed", "command"
    if not reverses(problem, axis):
        # steps one way only do not show what becomes of small motions to and fro
        return "speed", "command", "clipped"
    return "speed", "command", "set-point", "clipped"


def _losses(
    tried: Iterable[Structure], held_out: Mapping[Structure, Array]
) -> dict[Structure, float]:
    """Loss of each structure on steps held out, with what speaks for or against it beforehand."""
    losses = {s: float(held_out[s].sum()) for s in tried}
    if "set-point" in losses:
        losses["set-point"] /= WORTH
    if "clipped" in losses and not _better("clipped", "speed", held_out):
        # servos limit what their loop aims at; the speed itself is clipped in simulations
        losses["clipped"] = max(losses["clipped"], losses.get("speed", 0.0))
    return losses


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
