"""`twin compare RIG.rrd --explain`: which effect explains how much of the difference."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from analysis.comparison.explanation import (
    Explanation,
    Share,
    candidates,
    deviations,
    jackknife,
    shapley,
    subsets,
)
from analysis.estimate import Information, fitted, information
from analysis.recording import Recording
from hardware.frames import AXES
from twin.config.result import Rows
from twin.evaluation.effects import (
    COLUMNS,
    DEGREES,
    FRAME,
    GROUPS,
    LOWEST,
    PRIOR,
    Motions,
    derivatives,
)
from twin.hil.resimulation import Resimulation
from twin.plant.compiled import compiled

Array = NDArray[np.float64]

LONGEST = 15.0  # s that are simulated again
MOST = 6  # effects of one axis
# effects that are fitted before one is chosen: to first order one that bounds the motion, as a
# slew limit does, promises less than it explains
TRIED = 6
REFINED = 4  # Gauss-Newton steps
STARTS = (0.0, 1.0, 2.0)  # steps of the derivatives, at which a fit of an effect may begin
PARTS = (1.0, 0.4)  # of a Gauss-Newton step
ENDED = 0.01  # gain of a step after which no other is taken
LEAST = 0.02  # of the mean square, which an effect must explain
BLOCKS = 10  # of a run, each left out once for the intervals
SURE = 2.26  # deviations of a 95 % interval from ten blocks (Student's t)


@dataclass(frozen=True)
class RunExplanation:
    """Explanations by axis; `seconds` of the run were simulated again."""

    axes: tuple[Explanation, ...]
    seconds: float

    def as_dict(self) -> dict[str, object]:
        """JSON values in SI."""
        return {"seconds": self.seconds, "axes": [a.to_dict() for a in self.axes]}

    def rows(self) -> Rows:
        """Effects with their shares of what is explained, and what no effect explains."""
        rows = []
        for a in self.axes:
            rms, rest, noise = (f"{v * DEGREES:.3f}°" for v in (a.rms, a.rest, a.noise))
            text = f"{rms} rms, {100 * a.explained:.0f} % of its square explained"
            rows.append((f"{a.axis} difference", text))
            for s in a.shares:
                part, whole = 100 * s.share, 100 * s.share * a.explained
                half = f" ± {100 * s.half:.0f}" if math.isfinite(s.half) else ""
                found = s.text
                if s.alike:
                    others = " or ".join(s.alike)
                    found = f"not determined: not told apart from {others}"
                text = f"{part:.0f} % of that, {whole:.0f}{half} % of the whole: {found}"
                rows.append((f"{a.axis} {s.effect}", text))
            rows.append(
                (f"{a.axis} unexplained", f"{rest} rms; the readings have {noise} of noise")
            )
        return rows


def explain(
    recording: Recording,
    mechanism: Path | None = None,
    parameters: Mapping[str, float] | None = None,
) -> RunExplanation:
    """Share out the difference between measured and simulated angle among the model's effects.

    Each effect's parameters are fitted to the difference; the run is then simulated with every set
    of the effects corrected. An effect's share is its mean contribution over all orders.

    Parameters
    ----------
    mechanism, parameters : see `Resimulation`

    Raises
    ------
    TwinError, AnalysisError : a recording that lacks what this needs, or is too short
    """
    command, measured = recording["gimbal/command"], recording["gimbal/measured"].known()
    moved = [k for k in range(len(AXES)) if len(command.changes(k))]
    with compiled():
        run = Resimulation(recording, mechanism, parameters, longest=LONGEST)
        motions = Motions(run)
        rows = measured.time <= run.time[-1]
        time, values = np.asarray(measured.time[rows]), np.asarray(measured.values[rows])
        axes = tuple(_Axis(k, motions, run.time, time, values[:, k]).explanation() for k in moved)
    return RunExplanation(axes, float(run.time[-1] - run.time[0]))


class _Axis:
    """Effects of one axis, fitted to its readings.

    Parameters
    ----------
    k : index of the axis
    time, angle : readings (n,) [s], [rad]
    """

    def __init__(self, k: int, motions: Motions, stamps: Array, time: Array, angle: Array) -> None:
        self._k, self._motions, self._stamps = k, motions, stamps
        self._time, self._angle = time, angle

    def explanation(self) -> Explanation:
        """Effects one after the other, the best first, then their shares."""
        nominal, level = self._motions.level, self._motions.level
        chosen: list[str] = []
        alike: dict[str, tuple[str, ...]] = {}
        error = np.inf
        while len(chosen) < MOST:
            info, now = self._shown(level, range(len(COLUMNS)))
            error = min(error, now)
            tried = candidates(info, GROUPS, PRIOR, chosen)[:TRIED]
            fits = {e: self._fitted(level, [*chosen, e]) for e in tried}
            best = min(fits, key=lambda e: fits[e][1], default=None)
            if best is None or fits[best][1] > (1.0 - LEAST) * error:
                break
            chosen.append(best)
            alike[best] = self._alike(fits, best)
            level, error = fits[best]
        while True:
            sets = subsets(chosen)
            moved = self._motions([_with(nominal, level, s) for s in sets])
            blocks = {s: self._blocks(m) for s, m in zip(sets, moved, strict=True)}
            errors = {s: float(b.mean()) for s, b in blocks.items()}
            shares = shapley({s: -e for s, e in errors.items()}, chosen)
            # alike effects may counteract each other; the one that explains nothing is left out
            worst = min(chosen, key=lambda e: shares[e], default=None)
            if worst is None or shares[worst] >= 0.0:
                break
            chosen.remove(worst)
            level, _ = self._fitted(nominal, chosen)
        before, after = errors[frozenset()], errors[frozenset(chosen)]
        halves = jackknife(blocks, chosen)
        sigma = deviations(self._shown(level, range(len(COLUMNS)))[0], PRIOR)
        return Explanation(
            AXES[self._k],
            math.sqrt(before),
            math.sqrt(after),
            info.noise,
            tuple(
                Share(
                    e,
                    shares[e] / max(before - after, 1e-300),
                    _text(e, nominal, level, sigma),
                    halves[e],
                    tuple(a for a in alike[e] if a not in chosen),
                )
                for e in sorted(chosen, key=lambda e: -shares[e])
            ),
        )

    def _seen(self, motion: Array) -> Array:
        return np.interp(self._time, self._stamps, motion[:, self._k])

    def _error(self, motion: Array) -> float:
        """Mean square of what is left [rad²]."""
        return float(np.mean((self._angle - self._seen(motion)) ** 2))

    def _blocks(self, motion: Array) -> Array:
        """Mean square of what is left in each of equal parts of the run (blocks,) [rad²]."""
        square = (self._angle - self._seen(motion)) ** 2
        whole = square[: len(square) // BLOCKS * BLOCKS].reshape(BLOCKS, -1)
        return np.asarray(whole.mean(axis=1))

    def _alike(self, fits: Mapping[str, tuple[Array, float]], best: str) -> tuple[str, ...]:
        """Effects that leave no more than the best one, by what the blocks scatter."""
        names = [best, *(e for e in fits if e != best)]
        left = [self._blocks(m) for m in self._motions([fits[e][0] for e in names])]
        return tuple(
            e
            for e, b in zip(names[1:], left[1:], strict=True)
            if (b - left[0]).mean() < SURE * (b - left[0]).std(ddof=1) / math.sqrt(BLOCKS)
        )

    def _shown(self, level: Array, columns: Sequence[int]) -> tuple[Information, float]:
        """What the readings show of some columns, and the mean square that is left."""
        base, slopes = derivatives(self._motions, level, columns)
        slope = np.column_stack([self._seen(s) for s in np.moveaxis(slopes, -1, 0)])
        residual = self._angle - self._seen(base)
        return information(self._time, residual, slope), float(np.mean(residual**2))

    def _fitted(self, level: Array, effects: Sequence[str]) -> tuple[Array, float]:
        """Parameters with those of some effects fitted, and the mean square that is left.

        Gauss-Newton from the best of some values of the last effect, whose response is not linear.
        """
        columns = [c for effect in effects for c in GROUPS[effect]]
        starts = [level.copy() for _ in STARTS] if columns else [level]
        for start, times in zip(starts, STARTS, strict=False):
            start[columns[-1]] += times * COLUMNS[columns[-1]].step
        errors = [self._error(m) for m in self._motions(starts)]
        best, error = starts[int(np.argmin(errors))], min(errors)
        for _ in range(REFINED if columns else 0):
            info, _ = self._shown(best, columns)
            step = np.zeros(len(best))
            step[columns] = fitted(info, slice(None), PRIOR[columns])[0]
            tried = [np.maximum(best + part * step, LOWEST) for part in PARTS]
            for new in tried:
                new[FRAME] = float(new[FRAME] > 0.5)
            errors = [self._error(m) for m in self._motions(tried)]
            if min(errors) >= (1.0 - ENDED) * error:
                break
            best, error = tried[int(np.argmin(errors))], min(errors)
        return best, error


def _with(nominal: Array, level: Array, effects: frozenset[str]) -> Array:
    """Parameters with those of some effects corrected."""
    out = nominal.copy()
    for effect in effects:
        out[GROUPS[effect]] = level[GROUPS[effect]]
    return out


def _text(effect: str, before: Array, after: Array, sigma: Array) -> str:
    if effect == COLUMNS[FRAME].effect:
        return "commands act without it"
    return ", ".join(
        f"{p.name} {p.text(before[c])} → {p.text(after[c])} ± {1.96 * sigma[c] * p.scale:.2g}"
        for c, p in ((c, COLUMNS[c].what) for c in GROUPS[effect])
    )
