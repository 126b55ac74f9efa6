"""A bounded servo in a second or two: what it takes to see what a record says of the bounds."""

import numpy as np

from analysis.array import Array
from analysis.identify.dead_band import static_dead_band
from analysis.identify.noise import quantisation
from analysis.identify.problem import Problem
from analysis.identify.reached import without_idle_limits
from analysis.identify.servo_descent import descend, in_units, loss_of, prepared, settled
from analysis.identify.servo_fit import ServoFit
from analysis.identify.servo_starts import fastest, grid_of_starts, reverses, scales, with_values

_FOLLOWED = 3


def short_search(
    problem: Problem, axis: int, section: Array, delay: float, *, max_delay: float
) -> ServoFit:
    """The best of a few short searches of a `speed` servo, all its parameters free.

    Parameters
    ----------
    section, delay : denominator and delay of a linear fit, where a search may begin
    """
    kept = np.ones(len(problem.measured), dtype=bool)
    floor = quantisation(problem)
    problem, alike, unit = prepared(problem, axis, kept, floor)
    n = alike.layout.poles
    linear = [*section, max(delay, 0.0)]
    begins = [np.array([*linear, np.log(x * fastest(alike)), 0.0, 0.0]) for x in (0.8, 1.1)]
    begins += grid_of_starts(alike, max_delay, "speed")
    turns = reverses(alike, axis)
    free = np.arange(n + 4 if turns else n + 3)
    static, least = static_dead_band(alike, axis), scales(alike, "speed")[n + 2 : n + 4]
    shares = [np.maximum(static * np.array(s), least) for s in ((1.0, 0.0), (0.5, 1.0))]
    begins = [with_values(b, [n + 2, n + 3], s * [1.0, turns]) for b in begins for s in shares]
    begins = sorted(begins, key=lambda b: loss_of(alike, axis, "speed", b))[:_FOLLOWED]
    ended = [descend(alike, axis, "speed", b, max_delay, free) for b in begins]
    theta, _ = min(ended, key=lambda e: loss_of(alike, axis, "speed", e[0]))
    fit = settled(alike, axis, "speed", theta, free, max_delay, kept, floor)
    return in_units(without_idle_limits(fit, axis, max_delay), problem, unit)
