"""What kind of servo fault the motion of both axes shows: hypotheses compared by likelihood.

Each hypothesis predicts how the axes move from the commands of both: a jammed servo stands still, a
reversed one mirrors its command, exchanged plugs follow the other axis's, a slipped horn follows
its own at another angle. Errors are Gaussian, with a standard deviation that grows with the speed.
"""

from dataclasses import dataclass, field
from math import log, radians

from hardware.frames import Pair

STILL, REVERSED, SWAPPED, HEALTHY = range(4)  # hypotheses
SIGMA = (radians(0.1), radians(0.35), radians(0.35), radians(0.35))  # of their errors
UNKNOWN = 0.15  # s; the constant part of an error counts less in a motion that is shorter
LATE = 0.02  # s; by which expected and true motion may be apart in time
CORRELATED = 0.05  # s; errors closer together are one
RECENT = 0.1  # s
CLEARLY = 10.0  # of a log-likelihood
POOR = 2.5  # σ; a hypothesis with larger errors explains nothing


@dataclass(slots=True)
class Motion:
    """Errors of the hypotheses on one axis, and of two on the other one, since an instant.

    Attributes
    ----------
    start : angles and expected angles of this axis and the other one, then [rad]
    gyro : integral of the gyro since then [rad]
    time : that the errors are weighted with [s]
    sums, squares : of this axis's errors in the order above, then of the other one's when healthy
        and when swapped (6,) [rad·s], [rad²·s]
    lowest, highest : expected angle of this axis since then [rad]
    pace, jump : fastest expected rate of late, and by how much the measured one exceeded it [rad/s]
    """

    start: list[float] = field(default_factory=lambda: [0.0] * 4)
    gyro: float = 0.0
    time: float = 0.0
    sums: list[float] = field(default_factory=lambda: [0.0] * 6)
    squares: list[float] = field(default_factory=lambda: [0.0] * 6)
    lowest: float = 0.0
    highest: float = 0.0
    pace: float = 0.0
    jump: float = 0.0

    def begin(self, angle: Pair, model: Pair) -> None:
        """Start again from here; this axis first in each pair."""
        self.start[:] = *angle, *model
        self.gyro = self.time = self.jump = 0.0
        self.lowest = self.highest = model[0]
        self.sums[:] = self.squares[:] = (0.0,) * 6

    def add(
        self, angle: Pair, model: Pair, rate: float, speed: float, dt: float, fading: float
    ) -> None:
        """Add the errors of a frame.

        Parameters
        ----------
        angle, model : measured and expected, this axis first [rad]
        rate, speed : measured, and largest expected rate of both axes [rad/s]
        dt : time since the previous frame [s]
        fading : time constant with which earlier frames are forgotten, 0 for never [s]
        """
        a, b, m, n = (v - s for v, s in zip((*angle, *model), self.start, strict=True))
        self.pace = max(speed, self.pace * (1.0 - dt / RECENT))
        if fading:
            self.jump = max(self.jump, abs(rate) - self.pace)
        weight = dt / (1.0 + (LATE * speed / SIGMA[HEALTHY]) ** 2)
        kept = 1.0 - dt / fading if fading else 1.0
        self.time = kept * self.time + weight
        self.lowest, self.highest = min(self.lowest, model[0]), max(self.highest, model[0])
        for i, e in enumerate((a, a + m, a - n, a - m, b - n, b - m)):
            self.sums[i] = kept * self.sums[i] + weight * e
            self.squares[i] = kept * self.squares[i] + weight * e * e

    def error(self, i: int) -> float:
        """Return the mean squared error `i`, freed of a part of its mean [rad²]."""
        if not self.time:
            return 0.0
        mean = self.sums[i] ** 2 / (self.time + UNKNOWN)
        return max(0.0, self.squares[i] - mean) / self.time

    def costs(self) -> list[float]:
        """Return the negative log-likelihood of each hypothesis on both axes."""
        count = max(1.0, self.time / CORRELATED)
        own = [
            count * (0.5 * self.error(i) / SIGMA[i] ** 2 + log(SIGMA[i])) for i in range(len(SIGMA))
        ]
        others = [0.5 * count * self.error(i) / SIGMA[HEALTHY] ** 2 for i in (4, 5)]
        return [cost + others[i == SWAPPED] for i, cost in enumerate(own)]

    def likeliest(self) -> int | None:
        """Return which hypothesis on a servo at fault explains the motion, None if none does."""
        *faulty, healthy = self.costs()
        best = faulty.index(min(faulty))
        if not self.explained(best) or (best != STILL and faulty[best] > healthy + CLEARLY):
            return None
        return best

    def explained(self, i: int) -> bool:
        """Return whether hypothesis `i` leaves errors of a usual size."""
        return self.error(i) < (POOR * SIGMA[HEALTHY]) ** 2
