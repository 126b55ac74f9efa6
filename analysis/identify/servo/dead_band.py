"""A servo's dead band, read off where the gimbal came to rest."""

import numpy as np

from analysis.identify.problem.problem import Problem


def static_dead_band(problem: Problem, axis: int) -> float:
    """Dead band as the shortfall of settled angles behind the command, in its direction [rad].

    Angle at rest = gain·u + offset − band·(direction of approach); the scatter of such points grows
    with the amplitude, hence the weights 1/√|u|. Zero where it does not stand out of the scatter.
    """
    points = [p for i in range(len(problem.parts)) for p in _settled(problem, i, axis)]
    if len(points) < 4:
        return 0.0
    command, angle, direction, weight = np.array(points).T
    if len(set(direction)) < 2:
        return 0.0  # one direction only: shortfall and offset are the same
    columns = np.stack([command, -direction], axis=1) * weight[:, None]
    found, _, rank, _ = np.linalg.lstsq(columns, angle * weight, rcond=None)
    scatter = (angle * weight - columns @ found) / np.sqrt(max(len(points) - 2, 1))
    if rank < 2 or found[0] <= 0.0:
        return 0.0
    error = np.sqrt(np.linalg.inv(columns.T @ columns)[1, 1] * float(scatter @ scatter))
    return float(found[1] / found[0]) if found[1] > 2.0 * error else 0.0


def _settled(problem: Problem, index: int, axis: int) -> list[tuple[float, float, float, float]]:
    """Command, angle, direction and weight of every step of a record that came to rest."""
    part = problem.parts[index]
    rows = (problem.owner == index) & ~problem.is_rate & (problem.weight > 0.0)
    time, angle = problem.time[rows], problem.measured[rows]
    moved = np.flatnonzero(np.diff(part.input[:, axis]) != 0.0) + 1
    found = []
    for k, row in enumerate(moved):
        end = part.input_time[moved[k + 1]] if k + 1 < len(moved) else np.inf
        inside = np.flatnonzero((time >= part.input_time[row]) & (time < end))
        change = part.input[row, axis] - part.input[row - 1, axis]
        rest = inside[-(len(inside) // 3) :]
        if len(inside) < 12 or np.ptp(angle[rest]) > 0.1 * abs(change):
            continue
        before = angle[time < part.input_time[row]]
        offset = float(before[-1]) if k == 0 and len(before) else float(angle[0]) if k == 0 else 0.0
        target = part.input[row, axis] - part.input[0, axis]
        start = float(angle[0]) if k else offset
        found.append(
            (
                float(target),
                float(angle[rest].mean()) - start,
                float(np.sign(change)),
                float(1.0 / np.sqrt(max(abs(target), 1e-9))),
            )
        )
    return found
