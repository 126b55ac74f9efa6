"""How far each potentiometer has departed from the accelerometer's direction of gravity.

Offset and scale of an accelerometer are unknown but constant, and what motion adds to gravity
averages out: a potentiometer that drifts slowly leaves it, whatever gyro and servo do. What does
not average out is computed or bounded: angular accelerations pass through the same averages as
forces and potentiometers, times a lever that is fitted to the fast motion; what is unknown of the
lever, of both scales and of the board's mounting is independent, and adds by its squares. Forces
are averaged, not tilts, which are not linear in them.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from math import hypot, radians

from hardware.faults.evidence import POTENTIOMETERS, Prediction, Reading
from hardware.frames import Pair, Triple
from hardware.parts import ACCELEROMETER_SCALE_ERROR, STANDARD_GRAVITY, tilts

AVERAGE = 0.8  # s
LEARNED = 2.0  # s; over which the constant difference is averaged
ADAPTING = 60.0  # s; with which it follows from then on
UPRIGHT = 0.5 * STANDARD_GRAVITY  # along z; a rig on its side has no reference here
TURNED = 0.035  # of a board that is fastened by hand, 2° about z [rad]
LEVER = 0.06 / STANDARD_GRAVITY  # tilt per angular acceleration, 60 mm from the pivot [s²],
FITTED = 0.01 / STANDARD_GRAVITY  # and what is unknown of a fitted one, 10 mm
MOVING = 2.0  # rad/s²; slower motion is noise of the gyro
ENOUGH = 1000.0  # (rad/s²)² in sum; the noise of the forces leaves 6 mm of the lever
# By which potentiometers that drift have left gravity, beyond what motion does: two waves of 0.05°
# of their tracks, and 3 σ of both averages.
SHIFTED = radians(0.15)
HOLDER, BASE, TURN = slice(4, 7), slice(7, 10), slice(10, 13)  # after the potentiometers
VALUES = 13


@dataclass(slots=True)
class Gravity:
    """Averages of the potentiometers, of both accelerometers and of what falsifies them.

    Attributes
    ----------
    mean, reference : over `AVERAGE`, and the constant one (13,): potentiometers [rad], forces on
        holder and base [m/s²], angular accelerations in the order of `rate` [rad/s²]
    rate : latest of the holder about x and y, and of the base about x [rad/s]
    age : time for which they were learned [s]
    fit : sums of tilts times angular accelerations [rad²/s²], and of their squares [rad²/s⁴]
    slope : uncertainty of each potentiometer's angle per angle, 3 σ [1]
    """

    mean: list[float] = field(default_factory=lambda: [0.0] * VALUES)
    reference: list[float] = field(default_factory=lambda: [0.0] * VALUES)
    rate: list[float] = field(default_factory=lambda: [0.0] * 3)
    age: float = 0.0
    fit: list[float] = field(default_factory=lambda: [0.0] * 2)
    slope: list[float] = field(default_factory=lambda: [0.0] * POTENTIOMETERS)

    def begin(self) -> None:
        """Start again on a first frame, or after a gap."""
        self.age = 0.0

    def update(self, r: Reading, p: Prediction, *, healthy: bool) -> None:
        """Add a frame and what was predicted of it; `healthy` all of the rig."""
        rate = p.rate
        self.slope[:] = p.slope
        if not abs(r.force[2]) > UPRIGHT:
            return
        u, v, w = rate[0] + r.carried[0], rate[1] + r.carried[1], r.carried[0]
        first, dt = self.age == 0.0, r.dt
        a, b, c = self.rate
        per = 0.0 if first else 1.0 / dt
        self.rate[:] = u, v, w
        self.age += dt
        short = 1.0 if first else min(1.0, dt / min(AVERAGE, self.age))
        long = 1.0 if first else dt / (self.age if self.age < LEARNED else ADAPTING)
        mean, reference = self.mean, self.reference
        turn = (u - a) * per, (v - b) * per, (w - c) * per
        for i, value in enumerate((*r.angle, *r.force, *r.base_force, *turn)):
            mean[i] += short * (value - mean[i])
            reference[i] += long * (value - reference[i])
        if healthy:
            self._fit(r, turn[:2])

    def _fit(self, r: Reading, turn: Pair) -> None:
        """Add to the fit of the lever along z, which is the same for both axes.

        Potentiometers and base, which know nothing of it, are subtracted from the tilts.
        """
        mean = self.mean
        now = _beyond((*r.angle, *r.force, *r.base_force))
        for tilt, slow, a, b in zip(now, _beyond(mean), turn, mean[TURN], strict=False):
            if abs(a - b) > MOVING:
                self.fit[0] += (tilt - slow) * (a - b)
                self.fit[1] += (a - b) ** 2

    def departed(self, i: int) -> float:
        """How far potentiometer `i` has left gravity since it was learned; 0 before [rad]."""
        if self.age < LEARNED:
            return 0.0
        x, y, base = self._tilted()
        return self.mean[i] - self.reference[i] - (y if i > 1 else x - base)

    def left(self, axis: int, sense: float) -> bool:
        """Whether both potentiometers of an axis have left gravity, in this sense."""
        shift = 0.5 * (self.departed(2 * axis) + self.departed(2 * axis + 1))
        return shift * sense > 0 and abs(shift) > hypot(SHIFTED, self.uncertain(axis))

    def uncertain(self, axis: int) -> float:
        """How far a potentiometer of an axis may seem to have left it by motion alone [rad].

        One that is not calibrated follows motion by its nominal travel, which is some % off.
        """
        x, y, base = self._tilted()
        u, v, w = self._turned()
        own, other, turn = (y, x, v) if axis else (x, y, u)
        lever = hypot(FITTED, LEVER * ENOUGH / (ENOUGH + self.fit[1]))
        scale = ACCELEROMETER_SCALE_ERROR * own, ACCELEROMETER_SCALE_ERROR * base
        i = 2 * axis
        read = (
            s * (self.mean[k] - self.reference[k]) for k, s in enumerate(self.slope[i : i + 2], i)
        )
        return hypot(*scale, max(map(abs, read)), TURNED * other, lever * turn, LEVER * w)

    def _turned(self) -> Triple:
        """Changes of the averaged angular accelerations [rad/s²]."""
        u, v, w = (a - b for a, b in zip(self.mean[TURN], self.reference[TURN], strict=True))
        return u, v, w

    def _tilted(self) -> Triple:
        """Changes of the holder's tilt about x and y and of the base's about x [rad]."""
        x, y = _tilts(self.mean[HOLDER])
        a, b = _tilts(self.reference[HOLDER])
        base = _tilts(self.mean[BASE])[0] - _tilts(self.reference[BASE])[0]
        u, v, _ = self._turned()
        lever = self.fit[0] / (ENOUGH + self.fit[1])
        return x - a - lever * u, y - b - lever * v, base


def _tilts(force: list[float]) -> Pair:
    a, b, c = force
    return tilts((a, b, c))


def _beyond(values: Sequence[float]) -> Pair:
    """Tilts less base and potentiometers, of values in the order of `mean`; small angles [rad]."""
    a, b, c, d, fx, fy, fz, _, base, up, *_ = values
    side = 1.0 if fz > 0 else -1.0
    base = base if up > 0 else -base
    x, y = side * fy - base, -side * fx
    return x / STANDARD_GRAVITY - 0.5 * (a + b), y / STANDARD_GRAVITY - 0.5 * (c + d)
