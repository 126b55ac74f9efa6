"""Which channels an axis has, and how many zeros each: what the readings give evidence of.

By Schwarz's criterion (G. Schwarz, Ann. Statist. 6, 1978), with fewer independent readings where
the residual is coloured. A zero that is not there takes the delay with it: the two together are
then known to no figure.
"""

from dataclasses import dataclass, replace

import numpy as np

from analysis.array import Array
from analysis.identify.linear.fit import AxisFit, prepared, search, settled
from analysis.identify.linear.starts import (
    ROWS,
    alone,
    along_delay,
    by_channel,
    follow,
    joined,
    one_channel,
    response,
    thinned,
)
from analysis.identify.problem.problem import Problem

_SWEEPS = 3  # each leaves of an error the square of how alike two commands are
_OVERSHOOTS = 0.6  # damping of two poles below which one, which never does, need not be tried


@dataclass(frozen=True, slots=True)
class Choice:
    """Channels of one axis that the readings show.

    Attributes
    ----------
    columns : commands that the axis follows; those of the fit, in its order
    fit : of these channels
    """

    columns: tuple[int, ...]
    fit: AxisFit


def select(problem: Problem, max_delay: float) -> Choice:
    """Fit one axis with the channels and zeros that the readings show, at most those asked for."""
    layout = problem.layout
    every = tuple(range(layout.inputs))
    if layout.inputs == 1 and layout.zeros == 0:
        return Choice(every, search(problem, max_delay=max_delay))
    kept = np.ones(len(problem.measured), dtype=bool)
    weighed, aside = prepared(problem, kept)
    columns, zeros, theta = _chosen(thinned(weighed, ROWS), max_delay)
    return Choice(columns, settled(weighed.channels(columns, zeros), theta, kept, aside, max_delay))


def _chosen(problem: Problem, max_delay: float) -> tuple[tuple[int, ...], tuple[int, ...], Array]:
    """Commands that the axis follows, zeros of their channels, and θ."""
    columns = tuple(range(problem.layout.inputs))
    thetas, driven = by_channel(problem, max_delay)
    if len(columns) > 1 and problem.layout.zeros:
        thetas, driven = _together(problem, thetas, driven, max_delay)
    zeros = [problem.layout.zeros] * len(columns)
    for j in columns:
        zeros[j], thetas[j] = _evident(alone(problem, j, driven, zeros[j]), thetas[j], max_delay)
    whole = problem.channels(columns, tuple(zeros))
    theta = follow(whole, joined(whole, thetas), max_delay)
    colour = colouring(whole, theta)
    for j in sorted(columns, key=lambda k: float(np.abs(driven[k]).max())):
        rest = tuple(k for k in columns if k != j)
        if not rest:
            break
        fewer = problem.channels(rest, tuple(zeros[k] for k in rest))
        without = follow(fewer, joined(fewer, [thetas[k] for k in rest]), max_delay)
        more = whole.layout.size + whole.layout.numerators
        more -= fewer.layout.size + fewer.layout.numerators
        if not _worth((fewer, without), (whole, theta), more, colour):
            columns, whole, theta = rest, fewer, without
    return columns, tuple(zeros[j] for j in columns), theta


def _together(
    problem: Problem, thetas: list[Array], driven: dict[int, Array], max_delay: float
) -> tuple[list[Array], dict[int, Array]]:
    """θ and motion of each channel where all descend together.

    One after the other, the first took what the later ones move for its own: what is left of it
    is coloured, and of few independent readings no zero is worth its parameter.
    """
    theta = follow(problem, joined(problem, thetas), max_delay)
    poles, own = problem.layout.poles, problem.layout.own
    heads = [theta[poles * j * own :][:poles] for j in range(len(thetas))]
    rest = theta[poles * (len(thetas) if own else 1) :]
    tails = np.split(rest, np.cumsum([len(t) - poles for t in thetas])[:-1])
    thetas = [np.concatenate([head, tail]) for head, tail in zip(heads, tails, strict=True)]
    motions = dict(driven)
    for _ in range(_SWEEPS):  # of the numerators, each on what the others leave
        for j, t in enumerate(thetas):
            left = alone(problem, j, motions, problem.layout.zeros_of(j))
            motions[j] = response(left, t)
    return thetas, motions


def _evident(problem: Problem, found: Array, max_delay: float) -> tuple[int, Array]:
    """Number of zeros of a problem of one command, at most its own, and θ with them.

    Parameters
    ----------
    found : θ with as many zeros as there may be
    """
    asked = problem.layout.zeros_of(0)
    followed = follow(problem, found, max_delay)
    # a zero on the other side of the axis, with another delay, is a minimum of its own
    again = along_delay(problem, followed[: problem.layout.poles], max_delay) if asked else followed
    largest = (problem, min(followed, again, key=problem.loss))
    colour = colouring(*largest)
    tried = [
        (one, along_delay(one, largest[1][: problem.layout.poles], max_delay))
        for one in (problem.channels((0,), (zeros,)) for zeros in range(asked))
    ]
    tried.append(largest)
    chosen = 0
    for zeros in range(1, asked + 1):
        if _worth(tried[chosen], tried[zeros], zeros - chosen, colour):
            chosen = zeros
    return chosen, tried[chosen][1]


def one_pole_less(fit: AxisFit, max_delay: float) -> bool:
    """Whether one pole less explains the readings of one command as well."""
    problem, theta = thinned(fit.problem, ROWS), fit.solution.theta
    layout = problem.layout
    if layout.inputs != 1 or layout.poles <= layout.zeros_of(0) + 1:
        return False
    if layout.poles == 2 and theta[0] < theta[1] / 2.0 + np.log(2.0 * _OVERSHOOTS):
        return False
    fewer = problem.with_layout(replace(layout, poles=layout.poles - 1))
    found = one_channel(fewer, max_delay)
    return not _worth((fewer, found), (problem, theta), 1, colouring(problem, theta))


def _worth(
    smaller: tuple[Problem, Array], larger: tuple[Problem, Array], more: int, colour: float
) -> bool:
    """Whether some parameters more are worth what they save of the loss."""
    count = max(float((smaller[0].weight > 0.0).sum()) / colour, 10.0)
    before, after = smaller[0].loss(smaller[1]), larger[0].loss(larger[1])
    return bool(count * np.log(before / max(after, 1e-300)) > more * np.log(count))


def colouring(problem: Problem, theta: Array) -> float:
    """How many readings count as one, for the colour of what the model leaves: (1+ρ)/(1−ρ)."""
    weighted = problem.solve(theta).weighted
    rho = float(weighted[1:] @ weighted[:-1]) / max(float(weighted @ weighted), 1e-300)
    rho = min(max(rho, 0.0), 0.99)
    return (1.0 + rho) / (1.0 - rho)
