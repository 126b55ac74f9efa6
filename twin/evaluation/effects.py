"""Effects in which a gimbal may differ from its model, and the motion that each makes."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.estimate import Property
from hardware.frames import AXES
from twin.evaluation.motions import LATER, lagging, later
from twin.hil.resimulation import Resimulation, Variant

Array = NDArray[np.float64]

DEGREES = 180.0 / math.pi
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


class Motions:
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


def derivatives(motions: Motions, level: Array, columns: Sequence[int]) -> tuple[Array, Array]:
    """Motion (n, 2) and its derivatives (n, 2, k) by some columns."""
    steps = [COLUMNS[c].step for c in columns]
    changed = [level.copy() for _ in columns]
    for v, c, s in zip(changed, columns, steps, strict=True):
        v[c] += s
    base, *others = motions([level, *changed])
    return base, np.stack([(m - base) / s for m, s in zip(others, steps, strict=True)], axis=-1)
