"""Where a gimbal comes to rest, against the straight line of a linear model."""

from dataclasses import dataclass

import numpy as np

from analysis.array import Array
from analysis.identify.problem.noise import resolution
from analysis.identify.problem.problem import Problem
from analysis.plain import Plain

_REST = 3  # the last third of a hold is its rest
_FEWEST_ROWS = 4  # readings of a rest
_FEWEST = 6  # rests
_MOVES = 0.02  # of the command's range: what the model still moves within a rest
_SHARE = 0.03  # of the rests' own spread: scatter that matters to a gain
_EXPLAINED = 0.4  # of the scatter: what a drift or a jump must leave at most
_SURE = 4.0  # times what noise leaves of the mean of a rest


@dataclass(frozen=True, slots=True)
class Statics(Plain):
    """Angles at rest beside a line through them.

    Attributes
    ----------
    rests : that were compared
    scatter : of the angles at rest about the line, rms over their own spread, beside a drift and a
        jump of the offset; NaN of too few rests
    noise : what noise alone leaves of it
    small, large : gain of the smaller and the larger half of the steps; NaN where steps have one
        size
    drift : of the offset, over the range of the angles at rest [1/s]; 0 where it is not shown
    jump, jumped : of the offset, over that range, and when [s]; 0 where it is not shown
    """

    rests: int
    scatter: float
    noise: float
    small: float
    large: float
    drift: float = 0.0
    jump: float = 0.0
    jumped: float = 0.0

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
    part, angle, error, time = table[:, :4].T
    commands = table[:, 4:]
    offsets = (part[:, None] == np.unique(part)).astype(np.float64)
    columns = np.hstack([commands, offsets])
    spread = float(np.std(angle))
    if spread == 0.0 or len(found) - columns.shape[1] < 4:
        return _UNKNOWN
    noise = float(np.sqrt(np.mean(error**2))) / spread
    plain = _scatter(columns, angle)[0]
    drift = jump = jumped = 0.0
    if plain > spread * max(_SHARE, _SURE * noise):
        slanted, found_drift = _scatter(np.column_stack([columns, time]), angle)
        cuts = range(2, len(angle) - 1)
        after = np.arange(len(angle))
        tried = [_scatter(np.column_stack([columns, after >= k]), angle) for k in cuts]
        best = int(np.argmin([s for s, _ in tried]))
        if min(slanted, tried[best][0]) < _EXPLAINED * plain:
            if slanted < tried[best][0]:
                plain, drift = slanted, found_drift
            else:
                plain, jump = tried[best]
                jumped = float(time[cuts[best]])
    scatter = plain / spread
    moved = float(np.ptp(columns[:, own] * np.linalg.lstsq(columns, angle, rcond=None)[0][own]))
    drift, jump = (v / moved if moved > 0.0 else 0.0 for v in (drift, jump))
    step, answer = (np.diff(v)[np.diff(part) == 0.0] for v in (commands[:, own], angle))
    small = np.abs(step) <= 0.5 * np.abs(step).max(initial=0.0)
    gains = [_gain(step[g], answer[g]) for g in (small, ~small)]
    return Statics(len(found), scatter, noise, gains[0], gains[1], drift, jump, jumped)


def _scatter(columns: Array, angle: Array) -> tuple[float, float]:
    """What columns (n, k) leave of angles (n,), rms, and the coefficient of the last."""
    found = np.linalg.lstsq(columns, angle, rcond=None)[0]
    left = angle - columns @ found
    return float(np.sqrt(left @ left / (len(angle) - columns.shape[1]))), float(found[-1])


def _gain(step: Array, answer: Array) -> float:
    return float(step @ answer / (step @ step)) if len(step) > 2 and step.any() else float("nan")


def _rests(problem: Problem, residual: Array, index: int, own: int) -> list[list[float]]:
    """Record, angle, its error, time and all commands of every hold at whose end nothing moves."""
    part = problem.parts[index]
    rows = np.flatnonzero((problem.owner == index) & ~problem.is_rate & (problem.weight > 0.0))
    if not len(rows):
        return []
    time = problem.time[rows]
    moved = np.flatnonzero(np.diff(part.input, axis=0).any(axis=1)) + 1
    ends = [*part.input_time[moved], np.inf]
    held = [0, *moved]
    step = resolution(problem.measured[rows])  # rounding of a rest, which noise seldom averages
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
        error = float(np.hypot(noise / np.sqrt(len(rest)), step / np.sqrt(12.0)))
        if np.ptp(model) > moves or abs(drift) > moves + 4.0 * error:
            continue
        found.append(
            [
                float(index),
                float(angle.mean()),
                error,
                float(problem.time[rest].mean()),
                *part.input[k].tolist(),
            ]
        )
    return found
