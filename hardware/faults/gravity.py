"""How far each potentiometer has departed from the accelerometer's direction of gravity.

Offset and scale of an accelerometer are unknown but constant, and what motion adds to gravity
averages out: a potentiometer that drifts slowly leaves it, whatever gyro and servo do.
"""

from dataclasses import dataclass, field

from hardware.frames import Triple
from hardware.parts import STANDARD_GRAVITY, tilts

AVERAGE = 1.5  # s
LEARNING, ADAPTING = 1.0, 60.0  # s; of the constant difference, at first and later
LEARNED = 2.0  # s
UPRIGHT = 0.5 * STANDARD_GRAVITY  # along z; a rig on its side has no reference here


@dataclass(slots=True)
class Gravity:
    """Smoothed differences of the four potentiometers from gravity.

    Attributes
    ----------
    mean, reference : over `AVERAGE`, and the constant one (4,) [rad]
    age : time for which they were learned [s]
    """

    mean: list[float] = field(default_factory=lambda: [0.0] * 4)
    reference: list[float] = field(default_factory=lambda: [0.0] * 4)
    age: float = 0.0

    def begin(self) -> None:
        """Start again on a first frame, or after a gap."""
        self.age = 0.0

    def update(self, angle: tuple[float, ...], force: Triple, base: Triple, dt: float) -> None:
        """Add a frame.

        Parameters
        ----------
        angle : of the potentiometers [rad]
        force, base : readings of the accelerometers on holder and base [m/s²]
        dt : time since the previous frame [s]
        """
        if not abs(force[2]) > UPRIGHT:
            return
        x, y = tilts(force)
        x -= tilts(base)[0]
        first = self.age == 0.0
        self.age += dt
        short = 1.0 if first else min(1.0, dt / min(AVERAGE, self.age))
        long = 1.0 if first else dt / (LEARNING if self.age < LEARNED else ADAPTING)
        mean, reference = self.mean, self.reference
        for i, tilt in ((0, x), (1, x), (2, y), (3, y)):
            mean[i] += short * (angle[i] - tilt - mean[i])
            reference[i] += long * (mean[i] - reference[i])

    def departed(self, i: int) -> float:
        """How far potentiometer `i` has left gravity since it was learned; 0 before [rad]."""
        return self.mean[i] - self.reference[i] if self.age > LEARNED else 0.0
