"""Switch events of one axis to its maps: a weighted least-squares problem with a prior.

At an event of switch s the axis stands at θ = ±(α_s + ε_s), less the switch's differential travel
δ when it opened. With h the linearisation at the angle of the other axis, d the direction of
motion, M a row of the command matrix and c its offset, command and each potentiometer f obey

    M p − c − d H/2 = h(θ)        f = o + k h⁻¹(M p' − c − d H/2)

with hysteresis H and the pulses p' at which the servo came to rest behind the switch: where in its
last step the servo met the switch does not show in a potentiometer. The angles ε are held by how
well the calibration rig was built.
"""

from dataclasses import dataclass
from math import radians, sqrt

import numpy as np
from numpy.typing import NDArray

from hardware.calibration.log import CalibrationRig, Event, Log
from hardware.frames import Pair

Array = NDArray[np.float64]

COARSE_SIGMA = radians(0.1)
M1, M2, C, H, DELTA, PLUS, MINUS, OA, KA, OB, KB = range(11)
PARAMETERS = 11


@dataclass(frozen=True, slots=True)
class Axis:
    """Solution of one axis.

    Attributes
    ----------
    value : parameters in the order of the constants above (11,)
    covariance : (11, 11)
    scatter : residual of the command equation per event (n,) [rad]
    repeatability : their standard deviation [rad]
    """

    value: Array
    covariance: Array
    scatter: Array
    repeatability: float


@dataclass(frozen=True, slots=True)
class Table:
    """Events of one axis as arrays (n,) or (n, 2).

    Attributes
    ----------
    axis : 0 for x, 1 for y
    rig : switches and linearisation
    sign : +1 at the positive switch, −1 at the negative one (n,)
    opened : 1 where the switch opened (n,)
    pulses, settled : at the switch, and at rest behind it (n, 2) [s]
    readings : of both potentiometers at rest (n, 2) [1]
    nominal : closing angle of the switch (n,) [rad]
    """

    axis: int
    rig: CalibrationRig
    sign: Array
    opened: Array
    pulses: Array
    settled: Array
    readings: Array
    nominal: Array


def events_of(log: Log, axis: int) -> list[Event]:
    """Return the events of an axis's two switches."""
    return [e for e in log.events if e.switch // 2 == axis]


def tabulate(log: Log, rig: CalibrationRig, axis: int) -> Table:
    """Return the events of an axis."""
    events = events_of(log, axis)
    return Table(
        axis=axis,
        rig=rig,
        sign=np.array([1.0 if e.switch % 2 == 0 else -1.0 for e in events]),
        opened=np.array([0.0 if e.closed else 1.0 for e in events]),
        pulses=np.array([e.pulses for e in events]),
        settled=np.array([e.settled for e in events]),
        readings=np.array([e.potentiometer[2 * axis : 2 * axis + 2] for e in events]),
        nominal=np.array([rig.switch_angle[e.switch] for e in events]),
    )


def stand(event: Event, values: tuple[Array, Array]) -> Pair:
    """Return both angles at an event by the potentiometers [rad].

    Parameters
    ----------
    values : parameters of both axes, each (11,)
    """
    angles = []
    for k, v in enumerate(values):
        a, b = event.potentiometer[2 * k], event.potentiometer[2 * k + 1]
        angles.append(((a - v[OA]) / v[KA] + (b - v[OB]) / v[KB]) / 2)
    return angles[0], angles[1]


def first_guess(t: Table) -> Array:
    """Return straight lines through the switches as parameters (11,)."""
    v = np.zeros(PARAMETERS)
    centre = np.array(t.rig.neutral)
    A = np.column_stack([t.pulses - centre, -np.ones(len(t.sign))])
    size = np.array([1e-4, 1e-4, 1.0])  # columns of equal order
    v[[M1, M2, C]] = np.linalg.lstsq(A * [1e4, 1e4, 1], t.nominal, rcond=None)[0] / size
    for o, k, column in ((OA, KA, 0), (OB, KB, 1)):
        k_value, o_value = np.polyfit(t.nominal, t.readings[:, column], 1)
        v[o], v[k] = o_value, k_value
    return v


def solve_axis(t: Table, guess: Array, other: Array) -> Axis:
    """Return an axis's parameters; `c` belongs to zero pulse width.

    Parameters
    ----------
    guess : parameters to start from (11,)
    other : angle of the other axis at each event (n,) [rad]
    """
    rig, v = t.rig, guess
    problem = _Problem(t, other)
    sigma = np.array([COARSE_SIGMA, 5e-4, 5e-4])
    n, dof = len(t.sign), max(1.0, len(t.sign) - 4.0)
    # both columns of a rig without potentiometers are one accelerometer: the second hardly counts
    share = np.array([1.0, 1.0, 1e-3 if rig.minimal else 1.0])
    covariance = np.eye(PARAMETERS)
    for _ in range(6):
        scale = np.repeat(share / sigma, n)
        r = np.concatenate(problem.residuals(v)) * scale
        J = problem.jacobian(v) * scale[:, None]
        prior = np.zeros((2, PARAMETERS))
        prior[0, PLUS] = prior[1, MINUS] = 1 / rig.switch_sigma
        J, r = np.vstack([J, prior]), np.concatenate([r, prior @ v])
        # Columns differ by orders of magnitude: scaled, or the rank is misjudged.
        size = np.linalg.norm(J, axis=0)
        v = v - np.linalg.lstsq(J / size, r, rcond=None)[0] / size
        inverse = np.linalg.pinv((J / size).T @ (J / size))
        covariance = inverse / np.outer(size, size)
        parts = problem.residuals(v)
        floor = (rig.fine * abs(v[M1 + t.axis]) / sqrt(12.0), 1e-5, 1e-5)
        sigma = np.array([max(f, sqrt(p @ p / dof)) for p, f in zip(parts, floor, strict=True)])
    # c was measured about the neutral pulses; bring it to zero pulse width.
    shift = np.eye(PARAMETERS)
    shift[C, [M1, M2]] = rig.neutral
    v, covariance = shift @ v, shift @ covariance @ shift.T
    return Axis(v, covariance, parts[0], float(sigma[0]))


class _Problem:
    """Residuals and their derivatives; `c` is taken about the neutral pulses."""

    def __init__(self, t: Table, other: Array) -> None:
        self.t = t
        self.other = other.tolist()
        self.met = t.pulses - np.array(t.rig.neutral)
        self.rest = t.settled - np.array(t.rig.neutral)

    def residuals(self, v: Array) -> tuple[Array, Array, Array]:
        """Return command residuals [rad] and both potentiometers' [1], each (n,)."""
        t = self.t
        rest, _ = self._at_rest(v)
        return (
            self._follow(v, self.met) - self._linearised(self._angles(v))[0],
            t.readings[:, 0] - v[OA] - v[KA] * rest,
            t.readings[:, 1] - v[OB] - v[KB] * rest,
        )

    def jacobian(self, v: Array) -> Array:
        """Return the derivative of the stacked residuals (3n, 11)."""
        t = self.t
        angle = np.zeros((len(t.sign), PARAMETERS))
        angle[:, PLUS], angle[:, MINUS] = t.sign > 0, t.sign < 0
        angle[:, DELTA] = -t.sign * t.opened
        _, slope = self._linearised(self._angles(v))
        stacked = [self._follow_slope(self.met) - slope[:, None] * angle]
        rest, slope = self._at_rest(v)
        rest_slope = self._follow_slope(self.rest) / slope[:, None]
        for o, k in ((OA, KA), (OB, KB)):
            rows = -v[k] * rest_slope
            rows[:, o], rows[:, k] = -1, -rest
            stacked.append(rows)
        return np.vstack(stacked)

    def _angles(self, v: Array) -> Array:
        """Angles at which the switches moved (n,) [rad]."""
        t = self.t
        error = np.where(t.sign > 0, v[PLUS], v[MINUS])
        angles: Array = t.nominal + error - t.sign * t.opened * v[DELTA]
        return angles

    def _follow(self, v: Array, pulses: Array) -> Array:
        """Linearised angles (n,) [rad] that pulses (n, 2) lead to, hysteresis included."""
        t = self.t
        way = t.sign * (1 - 2 * t.opened)  # direction of motion along the axis
        angles: Array = pulses @ v[[M1, M2]] - v[C] - way * v[H] / 2
        return angles

    def _follow_slope(self, pulses: Array) -> Array:
        """Return the derivative of `_follow` (n, 11)."""
        t = self.t
        rows = np.zeros((len(t.sign), PARAMETERS))
        rows[:, [M1, M2]], rows[:, C] = pulses, -1
        rows[:, H] = -t.sign * (1 - 2 * t.opened) / 2
        return rows

    def _linearised(self, angles: Array) -> tuple[Array, Array]:
        """Linearised angles of the axis and their slope along it, each (n,)."""
        axis, map_ = self.t.axis, self.t.rig.linearisation
        if map_.straight:
            return angles, np.ones(len(angles))
        own = angles.tolist()
        both = zip(own, self.other, strict=True) if axis == 0 else zip(self.other, own, strict=True)
        pairs = list(both)
        values = np.array([map_.linearised(p)[axis] for p in pairs])
        return values, np.array([map_.slope(p)[axis][axis] for p in pairs])

    def _at_rest(self, v: Array) -> tuple[Array, Array]:
        """Angles behind the switches (n,) [rad], and the slope of the linearisation there."""
        target = self._follow(v, self.rest)
        angles = self._angles(v)
        for _ in range(3):  # within 1° of the switch the slope changes by 5 %
            values, slope = self._linearised(angles)
            angles = angles + (target - values) / slope
        return angles, slope
