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
    shapley,
    subsets,
)
from analysis.estimate import Information, Property, fitted, information
from analysis.recording import Recording
from hardware.frames import AXES
from twin.config.result import Rows
from twin.evaluation.motions import LATER, lagging, later
from twin.hil.resimulation import Resimulation, Variant
from twin.plant.compiled import compiled

Array = NDArray[np.float64]

DEGREES = 180.0 / math.pi
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
SLEW, STIFFNESS = "gimbal_servo_slew", "gimbal_servo_gain"
BACKLASH, DEAD_BAND = "gimbal_backlash", "gimbal_servo_dead_band"
LOAD = "gimbal_motor.mass"
FRICTION = tuple(f"gimbal_servo_{a}.frictionloss" for a in AXES)


@dataclass(frozen=True)
class _Column:
    """A parameter of an effect: of which, over what difference, and how uncertain."""

    effect: str
    what: Property
    step: float


def _column(effect: str, name: str, unit: str, scale: float, value: float, step: float,
            sigma: float) -> _Column:  # fmt: skip
    return _Column(effect, Property(name, unit, scale, value, sigma), step)


# Deviations that a hobby servo or a calibration may have, and the steps of the derivatives.
COLUMNS = (
    _column("calibration error", "gain", "", 1.0, 1.0, 0.05, 0.1),
    _column("calibration error", "zero", "° of the shaft", DEGREES, 0.0, 0.0175, 0.05),
    _column("delay", "delay", "ms", 1e3, 0.0, LATER, 0.02),
    _column("sensor lag", "lag", "ms", 1e3, 0.0, LATER, 0.02),
    _column("slew limit", "speed", "", 1.0, 1.0, -0.25, 0.4),
    _column("servo gain", "gain", "", 1.0, 1.0, -0.2, 0.4),
    _column("backlash", "backlash", "°", DEGREES, 0.0, 0.0087, 0.02),
    _column("friction", "friction", "", 1.0, 1.0, 1.0, 2.0),
    _column("dead band", "dead band", "° either way", DEGREES, 0.0, 0.0044, 0.01),
    _column("wait for the pulse frame", "without the wait", "", 1.0, 0.0, 1.0, 1.0),
    _column("load", "mass", "", 1.0, 1.0, 0.3, 0.4),
)
PRIOR = np.array([c.what.sigma for c in COLUMNS])
GAIN, ZERO, DELAY, LAG, SPEED, STIFF, PLAY, RUB, BAND, FRAME, MASS = range(len(COLUMNS))
# a derivative of the speed takes another 0.25 away, one of the servo's gain another 0.2
LOWEST = np.array([0.1, -1.0, -1.0, -1.0, 0.27, 0.22, 1e-6, 0.0, 0.0, 0.0, 0.1])
SIMULATED = [ZERO, SPEED, STIFF, PLAY, RUB, BAND, FRAME, MASS]  # the others need no simulation
GROUPS = {
    effect: [k for k, c in enumerate(COLUMNS) if c.effect == effect]
    for effect in dict.fromkeys(c.effect for c in COLUMNS)
}


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
                text = f"{part:.0f} % of that, {whole:.0f} % of the whole: {s.text}"
                rows.append((f"{a.axis} {s.effect}", text))
            rows.append(
                (f"{a.axis} unexplained", f"{rest} rms; the readings have {noise} of noise")
            )
        return rows


class _Motions:
    """Motion of both axes by the parameters of all effects."""

    def __init__(self, run: Resimulation) -> None:
        self._run = run
        names = (SLEW, STIFFNESS, BACKLASH, DEAD_BAND, LOAD, *FRICTION)
        self._values = {name: run.value(name) for name in names}
        level = np.array([c.what.value for c in COLUMNS])
        level[PLAY], level[BAND] = self._values[BACKLASH], self._values[DEAD_BAND]
        self.level = level
        self._known: dict[tuple[float, ...], Array] = {}

    def __call__(self, levels: Sequence[Array]) -> list[Array]:
        """Angles (n, 2) for each of the levels [rad]."""
        time, keys = self._run.time, [tuple(v[SIMULATED].tolist()) for v in levels]
        new = [k for k in dict.fromkeys(keys) if k not in self._known]
        variants = [self._variant(v) for k, v in dict(zip(keys, levels, strict=True)).items()
                    if k in new]  # fmt: skip
        if new:
            self._known |= zip(new, self._run.motions(variants), strict=True)
        period = float(np.median(np.diff(time)))
        return [
            v[GAIN] * lagging(later(time, self._known[k], v[DELAY]), v[LAG], period)
            for v, k in zip(levels, keys, strict=True)
        ]

    def _variant(self, v: Array) -> Variant:
        values = self._values
        own = {n: float(v[RUB]) * values[n] for n in FRICTION}
        return Variant(
            {
                SLEW: values[SLEW] * float(v[SPEED]),
                STIFFNESS: values[STIFFNESS] * float(v[STIFF]),
                BACKLASH: float(v[PLAY]),
                DEAD_BAND: float(v[BAND]),
                LOAD: values[LOAD] * float(v[MASS]),
                **own,
            },
            shaft=float(v[ZERO]),
            at_once=bool(v[FRAME] > 0.5),
        )


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
        motions = _Motions(run)
        rows = measured.time <= run.time[-1]
        time, values = np.asarray(measured.time[rows]), np.asarray(measured.values[rows])
        axes = tuple(_Axis(k, motions, run.time, time, values[:, k]).explanation() for k in moved)
    return RunExplanation(axes, float(run.time[-1] - run.time[0]))


def _derivatives(motions: _Motions, level: Array, columns: Sequence[int]) -> tuple[Array, Array]:
    """Motion (n, 2) and its derivatives (n, 2, k) by some columns."""
    steps = [COLUMNS[c].step for c in columns]
    changed = [level.copy() for _ in columns]
    for v, c, s in zip(changed, columns, steps, strict=True):
        v[c] += s
    base, *others = motions([level, *changed])
    return base, np.stack([(m - base) / s for m, s in zip(others, steps, strict=True)], axis=-1)


class _Axis:
    """Effects of one axis, fitted to its readings.

    Parameters
    ----------
    k : index of the axis
    time, angle : readings (n,) [s], [rad]
    """

    def __init__(self, k: int, motions: _Motions, stamps: Array, time: Array, angle: Array) -> None:
        self._k, self._motions, self._stamps = k, motions, stamps
        self._time, self._angle = time, angle

    def explanation(self) -> Explanation:
        """Effects one after the other, the best first, then their shares."""
        nominal, level = self._motions.level, self._motions.level
        chosen: list[str] = []
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
            level, error = fits[best]
        while True:
            sets = subsets(chosen)
            moved = self._motions([_with(nominal, level, s) for s in sets])
            errors = {s: self._error(m) for s, m in zip(sets, moved, strict=True)}
            shares = shapley({s: -e for s, e in errors.items()}, chosen)
            # alike effects may counteract each other; the one that explains nothing is left out
            worst = min(chosen, key=lambda e: shares[e], default=None)
            if worst is None or shares[worst] >= 0.0:
                break
            chosen.remove(worst)
            level, _ = self._fitted(nominal, chosen)
        before, after = errors[frozenset()], errors[frozenset(chosen)]
        return Explanation(
            AXES[self._k],
            math.sqrt(before),
            math.sqrt(after),
            info.noise,
            tuple(
                Share(e, shares[e] / max(before - after, 1e-300), _text(e, nominal, level))
                for e in sorted(chosen, key=lambda e: -shares[e])
            ),
        )

    def _seen(self, motion: Array) -> Array:
        return np.interp(self._time, self._stamps, motion[:, self._k])

    def _error(self, motion: Array) -> float:
        """Mean square of what is left [rad²]."""
        return float(np.mean((self._angle - self._seen(motion)) ** 2))

    def _shown(self, level: Array, columns: Sequence[int]) -> tuple[Information, float]:
        """What the readings show of some columns, and the mean square that is left."""
        base, slopes = _derivatives(self._motions, level, columns)
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


def _text(effect: str, before: Array, after: Array) -> str:
    if effect == COLUMNS[FRAME].effect:
        return "commands act without it"
    return ", ".join(
        f"{p.name} {p.text(before[c])} → {p.text(after[c])}"
        for c, p in ((c, COLUMNS[c].what) for c in GROUPS[effect])
    )
