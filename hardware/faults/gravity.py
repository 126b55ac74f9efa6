"""How far each potentiometer has departed from the accelerometer's direction of gravity.

Offset and scale of an accelerometer are unknown but constant, and what motion adds to gravity
averages out: a potentiometer that drifts slowly leaves it, whatever gyro and servo do. What does
not average out is bounded: tilts and accelerations pass through the same averages as the
potentiometers, times the data sheet's scale error and the longest lever.
"""

from dataclasses import dataclass, field

from hardware.faults.evidence import POTENTIOMETERS, Reading
from hardware.frames import Pair
from hardware.parts import ACCELEROMETER_SCALE_ERROR, STANDARD_GRAVITY, tilts

AVERAGE = 1.5  # s
LEARNED = 2.0  # s; over which the constant difference is averaged
ADAPTING = 60.0  # s; with which it follows from then on
UPRIGHT = 0.5 * STANDARD_GRAVITY  # along z; a rig on its side has no reference here
TURNED = 0.035  # of a board that is fastened by hand, 2° about z [rad]
LEVER = 0.06 / STANDARD_GRAVITY  # tilt per angular acceleration, 60 mm from the pivot [s²]
# After the potentiometers: tilts of holder about x and y and of base about x [rad], their second
# derivatives [rad/s²].
TILT_X, TILT_Y, TILT_BASE, TURN_X, TURN_Y, TURN_BASE = range(POTENTIOMETERS, POTENTIOMETERS + 6)
VALUES = TURN_BASE + 1


@dataclass(slots=True)
class Gravity:
    """Smoothed differences of the four potentiometers from gravity, and of what falsifies them.

    Attributes
    ----------
    mean, reference : over `AVERAGE`, and the constant one (10,) [rad], [rad/s²]
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
        x, y = tilts(r.force)
        base = tilts(r.base_force)[0]
        u, v, w = rate[0] + r.carried[0], rate[1] + r.carried[1], r.carried[0]
        first, dt = self.age == 0.0, r.dt
        a, b, c = self.rate
        per = 0.0 if first else 1.0 / dt
        self.rate[:] = u, v, w
        self.age += dt
        short = 1.0 if first else min(1.0, dt / min(AVERAGE, self.age))
        long = 1.0 if first else dt / (self.age if self.age < LEARNED else ADAPTING)
        mean, reference, own = self.mean, self.reference, x - base
        p, q, s, t = r.angle
        apart = p - own, q - own, s - y, t - y
        turned = (u - a) * per, (v - b) * per, (w - c) * per
        for i, value in enumerate((*apart, x, y, base, *turned)):
            mean[i] += short * (value - mean[i])
            reference[i] += long * (value - reference[i])

    def departed(self, i: int) -> float:
        """How far potentiometer `i` has left gravity since it was learned; 0 before [rad]."""
        return self.mean[i] - self.reference[i] if self.age > LEARNED else 0.0

    def uncertain(self, axis: int) -> float:
        """How far a potentiometer of an axis may seem to have left it by motion alone [rad]."""
        own, other, turn = (TILT_X, TILT_Y, TURN_X) if axis == 0 else (TILT_Y, TILT_X, TURN_Y)
        tilt = self._left(own) + self._left(TILT_BASE)
        turned = self._left(turn) + self._left(TURN_BASE)
        return ACCELEROMETER_SCALE_ERROR * tilt + TURNED * self._left(other) + LEVER * turned

    def _left(self, i: int) -> float:
        return abs(self.mean[i] - self.reference[i])
