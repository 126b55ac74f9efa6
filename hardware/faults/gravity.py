"""How far each potentiometer has departed from the accelerometer's direction of gravity.

Offset and scale of an accelerometer are unknown but constant, and what motion adds to gravity
averages out: a potentiometer that drifts slowly leaves it, whatever gyro and servo do. What does
not average out is bounded: angular accelerations pass through the same averages as forces and
potentiometers, times the longest lever, and tilts count with the data sheet's scale error. Forces
are averaged, not tilts, which are not linear in them.
"""

from dataclasses import dataclass, field

from hardware.faults.evidence import Reading
from hardware.frames import Pair, Triple
from hardware.parts import ACCELEROMETER_SCALE_ERROR, STANDARD_GRAVITY, tilts

AVERAGE = 1.5  # s
LEARNED = 2.0  # s; over which the constant difference is averaged
ADAPTING = 60.0  # s; with which it follows from then on
UPRIGHT = 0.5 * STANDARD_GRAVITY  # along z; a rig on its side has no reference here
TURNED = 0.035  # of a board that is fastened by hand, 2° about z [rad]
LEVER = 0.06 / STANDARD_GRAVITY  # tilt per angular acceleration, 60 mm from the pivot [s²]
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
    """

    mean: list[float] = field(default_factory=lambda: [0.0] * VALUES)
    reference: list[float] = field(default_factory=lambda: [0.0] * VALUES)
    rate: list[float] = field(default_factory=lambda: [0.0] * 3)
    age: float = 0.0

    def begin(self) -> None:
        """Start again on a first frame, or after a gap."""
        self.age = 0.0

    def update(self, r: Reading, rate: Pair) -> None:
        """Add a frame; `rate` is that of the gimbal [rad/s]."""
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

    def departed(self, i: int) -> float:
        """How far potentiometer `i` has left gravity since it was learned; 0 before [rad]."""
        if self.age < LEARNED:
            return 0.0
        x, y, base = self._tilted()
        return self.mean[i] - self.reference[i] - (y if i > 1 else x - base)

    def uncertain(self, axis: int) -> float:
        """How far a potentiometer of an axis may seem to have left it by motion alone [rad]."""
        x, y, base = (abs(tilt) for tilt in self._tilted())
        pairs = zip(self.mean[TURN], self.reference[TURN], strict=True)
        u, v, w = (abs(now - before) for now, before in pairs)
        own, other, turn = (y, x, v) if axis else (x, y, u)
        return ACCELEROMETER_SCALE_ERROR * (own + base) + TURNED * other + LEVER * (turn + w)

    def _tilted(self) -> Triple:
        """Changes of the holder's tilt about x and y and of the base's about x [rad]."""
        x, y = _tilts(self.mean[HOLDER])
        u, v = _tilts(self.reference[HOLDER])
        return x - u, y - v, _tilts(self.mean[BASE])[0] - _tilts(self.reference[BASE])[0]


def _tilts(force: list[float]) -> Pair:
    a, b, c = force
    return tilts((a, b, c))
