"""Physical parameters of a simulated gimbal, fitted to a recording with `mujoco.sysid`.

The model is injected: whoever calls says how a set of parameters becomes a compiled model. Every
trial flies the recording's own commands from rest, and its angles are compared where the gimbal was
read; a sensor's offset and a transport delay are no property of the model and are fitted beside it.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from analysis.array import Array
from analysis.identify.evidence.evidence import Estimate
from analysis.identify.evidence.uncertainty import of_steps
from analysis.linkage.problem import (
    DELAY,
    HELD_OUT,
    Build,
    Knob,
    LinkageError,
    LinkageProblem,
    Moves,
    sysid_module,
)
from analysis.linkage.search import best, descended, lowest, plane, slope

# Deviations across which each plane is laid, and how far at least: where the noise is far below the
# dents only places closer and closer around it tell the minimum.
_PLANES = (
    (6.0, 2e-2), (4.0, 1e-2), (3.0, 5e-3), (3.0, 2e-3),
    (3.0, 1e-3), (3.0, 1e-3), (3.0, 5e-4), (3.0, 5e-4),
)  # fmt: skip
_LAST = 4  # planes whose mean is the estimate: their scatter is what the dents leave open
_SPREAD = 1.5  # deviation over moves, over the Jacobian's: beyond, the Jacobian is wrong
_VAGUE = 0.5  # deviation over value: beyond, the recording does not tell the parameter
_POOR = 80.0  # percent of fit


@dataclass(frozen=True, slots=True)
class LinkageFit:
    """Fitted parameters and how far to trust them.

    Attributes
    ----------
    estimates : one per knob
    fit, held_out : NRMSE fit [%] per axis, of the moves fitted and of those held out
    start : the same of all moves before anything was fitted
    spread : deviation over moves, over the Jacobian's, median; NaN if unknown
    warnings : everything a reader must know before using a value
    """

    estimates: tuple[Estimate, ...]
    fit: tuple[float, ...]
    held_out: tuple[float, ...]
    start: tuple[float, ...]
    spread: float
    warnings: tuple[str, ...]

    def value(self, name: str) -> float:
        """One fitted value by name."""
        return next(e.value for e in self.estimates if e.name == name)


def fit_linkage(
    moves: Moves,
    knobs: Sequence[Knob],
    build: Build,
    joints: Sequence[str] = ("gimbal_x", "gimbal_y"),
    *,
    most: int = 6,
) -> LinkageFit:
    """Fit physical parameters to a recording.

    Parameters
    ----------
    moves : commands and readings
    knobs : parameters; one called `delay` shifts the answer instead of changing the model
    build : a compiled model with the given values; called on one thread, models may share nothing
    joints : whose angles were read
    most : iterations of the search

    Raises
    ------
    LinkageError : no parameters, too few moves, or a model without such joints
    """
    if not knobs:
        raise LinkageError("no parameter to fit")
    if len(moves.changes) < HELD_OUT:
        raise LinkageError(
            f"{len(moves.changes)} moves; {HELD_OUT} or more are needed, one is held out"
        )
    problem = LinkageProblem(moves, tuple(knobs), build, tuple(joints))
    start = problem.start
    before = problem.fits(start, np.ones(len(moves.time), dtype=bool))
    x = descended(problem, best(problem), most)
    estimates, spread, x = _estimates(problem, x)
    train = ~moves.held_out
    fits = problem.fits(x, train), problem.fits(x, ~train)
    notes = _warnings(problem, x, estimates, fits[1], spread)
    return LinkageFit(estimates, *fits, before, spread, notes)


def _estimates(problem: LinkageProblem, x: Array) -> tuple[tuple[Estimate, ...], float, Array]:
    """Values with deviations: from the Jacobian or, where moves disagree more, from them.

    The loss is rough, and its lowest dent is not its minimum. Planes through many places around x
    see past the dents; where they end one after the other scatters by what the dents leave open.
    """
    jacobian = slope(problem, x)
    ends = []
    for turn, across in enumerate(_PLANES):
        residual, jacobian = plane(problem, x, jacobian, across, turn + 1)
        x = lowest(problem, x, residual, jacobian)
        ends.append(x)
    last = np.array(ends[-_LAST:])
    x = last.mean(axis=0)
    residual = problem.residuals(x, problem.parameters.copy())[0][0]
    covariance, _ = sysid_module().calculate_intervals([residual], jacobian)
    std = np.sqrt(np.clip(np.diag(covariance), 0.0, None))
    moves = np.repeat(problem.moves.move[:, None], len(problem.joints), axis=1)
    drawn = of_steps(jacobian, residual, moves[problem.train][problem.read[problem.train]])
    spread = math.nan
    if drawn is not None:
        other = np.sqrt(np.clip(np.diag(np.atleast_2d(drawn)), 0.0, None))
        spread = float(np.median(other / np.maximum(std, 1e-300)))
        std = np.where(other > _SPREAD * std, other, std)
    std = np.hypot(std, last.std(axis=0, ddof=1))
    values = problem.amounts(x)
    std = std * np.where(problem.positive, values, problem.scale)
    return (
        tuple(
            Estimate(k.name, float(v), float(s), k.unit)
            for k, v, s in zip(problem.knobs, values, std, strict=True)
        ),
        spread,
        x,
    )


def _warnings(
    problem: LinkageProblem,
    x: Array,
    estimates: Sequence[Estimate],
    held_out: Sequence[float],
    spread: float,
) -> tuple[str, ...]:
    found = []
    for k, v, e in zip(problem.knobs, problem.amounts(x), estimates, strict=True):
        if min(v - k.low, k.high - v) < 1e-3 * (k.high - k.low):
            found.append(f"{k.name}: ended at its bound, {v:.4g}; the recording asks for more")
        elif not e.std <= _VAGUE * abs(e.value) and k.name != DELAY:
            found.append(f"{k.name}: the recording hardly tells it; take the value as a guess")
    for name, value in zip(problem.joints, held_out, strict=True):
        if not value >= _POOR:
            found.append(f"{name}: poor fit of {value:.0f} % on moves held out")
    if spread > _SPREAD:
        found.append(
            f"moves disagree {spread:.1f} times more than their noise; intervals are from the"
            " scatter of whole moves"
        )
    return tuple(found)
