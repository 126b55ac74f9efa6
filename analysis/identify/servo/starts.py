"""Where the search for a bounded servo begins, and how far it may go."""

from dataclasses import replace

import numpy as np

from analysis.array import Array
from analysis.identify.problem.problem import Problem
from analysis.transfer_function.servo import Structure


def command_unit(problem: Problem, axis: int) -> float:
    """Range of the command over that of the readings: what makes a search free of units."""
    command = max(float(np.ptp(p.input[:, axis])) for p in problem.parts)
    moved = 0.0
    for index in range(len(problem.parts)):
        for is_rate in (False, True):
            rows = (problem.owner == index) & (problem.is_rate == is_rate) & (problem.weight > 0)
            value = problem.measured[rows]
            if len(value) > 1 and is_rate:
                steps = np.diff(problem.time[rows])
                value = np.cumsum(steps * (value[1:] - np.median(value)))
            if len(value) > 1 and (moved == 0.0 or not is_rate):
                moved = max(moved, float(np.ptp(value)))
    return command / moved if moved > 0.0 else 1.0


def scaled(problem: Problem, axis: int, unit: float) -> Problem:
    """The problem with an axis' command over `unit`, counted from the first of all records.

    The others stand still: in units of their own they would be taken for the amplitude.
    """
    origin, parts = problem.parts[0].input[0, axis], []
    for part in problem.parts:
        command = np.zeros_like(part.input)
        command[:, axis] = (part.input[:, axis] - origin) / unit
        parts.append(replace(part, input=command))
    return replace(problem, parts=tuple(parts), cache={})


def with_values(theta: Array, places: list[int], values: Array) -> Array:
    """θ with these values in some places."""
    changed = theta.copy()
    changed[places] = values
    return changed


def reverses(problem: Problem, axis: int) -> bool:
    """Whether the command ever turns back within a record."""
    for part in problem.parts:
        steps = np.diff(part.input[:, axis])
        if (steps > 0.0).any() and (steps < 0.0).any():
            return True
    return False


def grid_of_starts(problem: Problem, max_delay: float, structure: Structure) -> list[Array]:
    """Grid over speed, delay and limit; the limit around the fastest motion in the readings."""
    fixed = problem.layout.delays[0]
    delays = np.linspace(0.0, 0.6 * max_delay, 6) if np.isnan(fixed) else np.array([fixed])
    quick = fastest(problem)
    starts = []
    for limit in quick * np.array([0.5, 0.8, 1.1]):
        for speed in (6.0, 12.0, 25.0, 50.0, 100.0):
            for delay in delays:
                section = [np.log(speed)]
                if problem.layout.poles == 2:
                    section = [np.log(1.6 * speed), 2.0 * np.log(speed)]
                starts.append(np.array([*section, delay, np.log(limit), 0.0, 0.0]))
    if structure == "set-point":  # the set point moves about as fast as the servo ever does
        slews = quick * np.array([0.8, 1.2, 2.0])
        starts = [np.append(s, [np.log(slew), 0.0]) for s in starts for slew in slews]
    return starts


def fastest(problem: Problem) -> float:
    """Fastest motion that lasts: the 98th percentile of the speed over 5 samples [rad/s]."""
    found = [1e-6]
    for index in range(len(problem.parts)):
        for is_rate in (False, True):
            rows = (problem.owner == index) & (problem.is_rate == is_rate) & (problem.weight > 0)
            if rows.sum() < 12:
                continue
            time, value = problem.time[rows], problem.measured[rows]
            if is_rate:
                centred = np.abs(value - np.median(value))
                found.append(float(np.quantile(centred, 0.98)))
            else:
                speed = np.abs((value[5:] - value[:-5]) / (time[5:] - time[:-5]))
                found.append(float(np.quantile(speed, 0.98)))
    return max(found)


def scales(problem: Problem, structure: Structure) -> Array:
    """Change of each parameter that matters (θ,)."""
    amplitude = max(float(np.ptp(p.input)) for p in problem.parts)
    least = [0.3] * problem.layout.poles + [0.01, 0.1, 0.01 * amplitude, 0.01 * amplitude]
    return np.array(least + ([0.1, 0.1] if structure == "set-point" else []))


def limits(problem: Problem, max_delay: float, structure: Structure) -> tuple[Array, Array]:
    """Range of every parameter: what the samples can tell, and the readings allow."""
    poles = problem.layout.poles
    amplitude = max(float(np.ptp(p.input)) for p in problem.parts)
    fixed = problem.layout.delays[0]
    slack = max(p.slack for p in problem.parts)
    delay = (-slack - 1e-6, max_delay) if np.isnan(fixed) else (fixed - 1e-12, fixed + 1e-12)
    rate = np.log(fastest(problem))
    low = [-3.0] * poles + [delay[0], rate - 2.0, -1e-12, -1e-12]
    fast = np.log(10.0 / min(float(np.median(np.diff(p.time))) for p in problem.parts))
    section = [fast] if poles == 1 else [fast + 0.7, 2.0 * fast]
    high = [*section, delay[1], rate + 3.0, 0.25 * amplitude, 0.25 * amplitude]
    if structure == "set-point":
        low, high = [*low, rate - 2.0, -1.0], [*high, rate + 3.0, 1.0]
    return np.array(low), np.array(high)
