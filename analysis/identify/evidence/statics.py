"""Where a gimbal comes to rest, against the straight line of a linear model."""

from dataclasses import dataclass

import numpy as np

from analysis.array import Array
from analysis.identify.problem.problem import Problem
from analysis.plain import Plain

_REST = 3  # the last third of a hold is its rest
_FEWEST_ROWS = 4  # readings of a rest
_FEWEST = 6  # rests
_MOVES = 0.02  # of the command's range: what the model still moves within a rest
_SHARE = 0.03  # of the rests' own spread: scatter that matters to a gain
_SURE = 4.0  # times what noise leaves of the mean of a rest


@dataclass(frozen=True, slots=True)
class Statics(Plain):
    """Angles at rest beside a line through them.

    Attributes
    ----------
    rests : that were compared
    scatter : of the angles at rest about the line, rms over their own spread; NaN of too few rests
    noise : what noise alone leaves of it
    small, large : gain of the smaller and the larger half of the steps; NaN where steps have one
        size
    """

    rests: int
    scatter: float
    noise: float
    small: float
    large: float

    @property
    def bent(self) -> bool:
        """Whether the gain depends on the amplitude, by more than chance."""
        return bool(self.scatter > max(_SHARE, _SURE * self.noise))


_UNKNOWN = Statics(0, float("nan"), float("nan"), float("nan"), float("nan"))


def statics(problem: Problem, residual: Array, own: int) -> Statics:
    """Compare the angles at which an axis came to rest with a line over its commands.

    Parameters
    ----------
    residual : of the model (rows,)
    own : column of the axis' own command
    """
    found = [r for k in range(len(problem.parts)) for r in _rests(problem, residual, k, own)]
    if len(found) < _FEWEST:
        return _UNKNOWN
    table = np.array(found)
    part, angle, error, commands = table[:, 0], table[:, 1], table[:, 2], table[:, 3:]
    offsets = (part[:, None] == np.unique(part)).astype(np.float64)
    columns = np.hstack([commands, offsets])
    left = angle - columns @ np.linalg.lstsq(columns, angle, rcond=None)[0]
    spread = float(np.std(angle))
    count = len(found) - columns.shape[1]
    if spread == 0.0 or count < 2:
        return _UNKNOWN
    scatter = float(np.sqrt(left @ left / count)) / spread
    noise = float(np.sqrt(np.mean(error**2))) / spread
    step, answer = (np.diff(v)[np.diff(part) == 0.0] for v in (commands[:, own], angle))
    small = np.abs(step) <= 0.5 * np.abs(step).max(initial=0.0)
    gains = [_gain(step[g], answer[g]) for g in (small, ~small)]
    return Statics(len(found), scatter, noise, gains[0], gains[1])


def _gain(step: Array, answer: Array) -> float:
    return float(step @ answer / (step @ step)) if len(step) > 2 and step.any() else float("nan")


def _rests(problem: Problem, residual: Array, index: int, own: int) -> list[list[float]]:
    """Record, angle, its error and all commands of every hold at whose end nothing moves."""
    part = problem.parts[index]
    rows = np.flatnonzero((problem.owner == index) & ~problem.is_rate & (problem.weight > 0.0))
    if not len(rows):
        return []
    time = problem.time[rows]
    moved = np.flatnonzero(np.diff(part.input, axis=0).any(axis=1)) + 1
    ends = [*part.input_time[moved], np.inf]
    held = [0, *moved]
    moves = _MOVES * float(np.ptp(part.input[:, own]))
    found = []
    for k, end in zip(held, ends, strict=True):
        inside = rows[np.searchsorted(time, part.input_time[k]) : np.searchsorted(time, end)]
        rest = inside[-(len(inside) // _REST) :] if len(inside) >= _REST else inside[:0]
        if len(rest) < _FEWEST_ROWS:
            continue
        angle = problem.measured[rest]
        model = angle - residual[rest]
        drift = angle[len(rest) // 2 :].mean() - angle[: len(rest) // 2].mean()
        noise = float(np.std(np.diff(angle))) / np.sqrt(2.0)
        error = noise / np.sqrt(len(rest))
        if np.ptp(model) > moves or abs(drift) > moves + 4.0 * error:
            continue
        found.append([float(index), float(angle.mean()), error, *part.input[k].tolist()])
    return found
