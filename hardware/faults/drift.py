"""Slowly: each potentiometer against an angle dead-reckoned from the gyro, and what that shows.

Two that agree against the third name it; between both potentiometers and the gyro, gravity and the
servo's command decide.
"""

from math import cos, hypot, radians

from hardware.faults.actuation import Actuation
from hardware.faults.axis import DRIFT, FADING, LAG, LEAK, MOSTLY, SMOOTHING
from hardware.faults.evidence import Prediction, Reading
from hardware.faults.gravity import Gravity
from hardware.faults.parity import Parity
from hardware.faults.states import GYRO, PAIR
from hardware.faults.tracks import DOUBTFUL, Tracks
from hardware.frames import Pair

SETTLING = 1.5  # s; the gyro's bias is not yet known before
LEARNING = 0.4  # s; over which it is averaged at first
COMMON_DRIFT = radians(0.3)  # of both potentiometers of an axis together, when at rest
COMMON_LAG = 1.6e-3  # s; of that drift while moving: healthy units in slews of 280 °/s reach 0.7°
DEPARTED = radians(0.25)  # from gravity, 10 σ of its average
UNDECIDED = 0.2  # s of disagreement with the gyro that the servo's command does not decide


class Drift:
    """Judges gyro and potentiometers by how they part over many frames.

    Attributes
    ----------
    running : time since the first frame [s]
    """

    def __init__(
        self, tracks: Tracks, parity: Parity, actuation: Actuation, gravity: Gravity
    ) -> None:
        self._tracks, self._parity = tracks, parity
        self._actuation, self._gravity = actuation, gravity
        self.running = 0.0

    def dead_reckon(self, r: Reading, p: Prediction, rest: list[float], use: list[bool]) -> None:
        """Update both dead-reckoned angles and every potentiometer's distance from them."""
        dt, first, out = r.dt, self.running <= r.dt, self._tracks.out
        smooth = min(1.0, dt / SMOOTHING)
        wrong_gyro = out[GYRO]
        leak = 0.1 * LEAK if wrong_gyro else LEAK
        for k, axis in enumerate(self._tracks.axes):
            if first or wrong_gyro:
                axis.bias = p.bias[k]
            elif self.running < SETTLING:  # the filter's wanders by some °/s in fast motion
                axis.bias += (p.bias[k] - axis.bias) * dt / (dt + min(self.running, LEARNING))
            cosine = 1.0 if k else cos(p.angle[1])
            axis.free += (r.rate[k] - axis.bias) / cosine * dt
            # Two gyros that sample 1 ms apart, and are read in turn, differ while the base turns.
            pace = abs(p.rate[k]) + abs(r.carried[k])
            axis.pace = max(pace, axis.pace * (1.0 - min(1.0, dt / FADING)))
            axis.carried = max(abs(r.carried[k]), axis.carried * (1.0 - min(1.0, dt / LEAK)))
            offset = p.angle[k] - (axis.free + p.rate[k] * p.gyro_delay)
            if first:
                axis.free += offset
                offset = 0.0
            distance = axis.distance
            for n, i in ((0, 2 * k), (1, 2 * k + 1)):
                # Single wrong readings are outliers; they must not look like a drift.
                if use[i] or axis.outlying[n] >= MOSTLY or out[i]:
                    distance[n] += smooth * (rest[i] + offset - distance[n])
            # While they part, the angle stays with the gyro: the estimate follows their mean.
            named = out[2 * k] or out[2 * k + 1]
            if named or abs(distance[0] - distance[1]) < 0.5 * DRIFT:
                axis.free += offset * min(1.0, dt / leak)
                if axis.wandering <= 0.0:  # a filter that has just forgotten is off by 10 °/s
                    axis.bias += (p.bias[k] - axis.bias) * min(1.0, dt)
            axis.wandering = max(0.0, axis.wandering - dt)

    def compare(self, r: Reading, p: Prediction) -> None:
        """Detect potentiometers that drift apart, and both drifting from the gyro.

        The second only with calibrated maps: without, the gyro's bias is not known either.
        """
        for k, axis in enumerate(self._tracks.axes):
            a, b = axis.distance
            if axis.doubtful:
                axis.doubtful = min(max(0.0, axis.doubtful - r.dt), 2 * DOUBTFUL)
            uncertain = max(p.tolerance[2 * k], p.tolerance[2 * k + 1])
            moving = LAG * abs(p.rate[k]) + uncertain
            common = (min(abs(a), abs(b)) if a * b > 0 else 0.0) - COMMON_DRIFT
            common -= COMMON_LAG * axis.pace + LEAK * p.scale * axis.carried + uncertain
            if abs(a - b) > DRIFT + moving:
                if not self._parity.sagging(r):
                    self._disagree(k, a, b, DRIFT + moving, r.dt, uncertain <= DRIFT)
            elif common > 0 and uncertain <= DRIFT and not self._parity.mute(r, k):
                self._part(k, p.angle[k], 0.5 * (a + b), r.dt)
            elif axis.common:
                axis.common = max(0.0, axis.common - r.dt)

    def _part(self, k: int, angle: float, apart: float, dt: float) -> None:
        """Name gyro or both potentiometers of an axis, whichever gravity or command contradicts.

        Parameters
        ----------
        angle : of the potentiometers [rad]
        apart : how far it is from the angle dead-reckoned by the gyro [rad]
        """
        axis = self._tracks.axes[k]
        axis.common += dt
        by_gyro = abs(self._actuation.excess(k, angle - apart))
        excess = abs(self._actuation.excess(k, angle))
        left = self._gravity.left(k, apart)
        if self._tracks.out[PAIR + k] or excess > 2 * by_gyro or left:
            self._tracks.accuse(PAIR + k, 0.2, "deviating")
        elif self._tracks.out[GYRO] or by_gyro > 2 * excess or axis.common > UNDECIDED:
            self._tracks.accuse(GYRO, 0.2, "bias")

    def _disagree(
        self, index: int, a: float, b: float, margin: float, dt: float, separable: bool
    ) -> None:
        """Name the one further off; if the maps are too uncertain, doubt the axis."""
        u, v = (abs(self._gravity.departed(2 * index + n)) for n in (0, 1))
        left = max(u, v) > hypot(DEPARTED, self._gravity.uncertain(index))
        if separable and left:  # slow, and the estimate has followed half of it
            a, b = u, v
        if not separable:
            self._doubt(index, dt)
        elif abs(a) > abs(b) + 0.5 * margin:
            self._tracks.accuse(2 * index, 0.2, "deviating")
        elif abs(b) > abs(a) + 0.5 * margin:
            self._tracks.accuse(2 * index + 1, 0.2, "deviating")
        else:
            self._doubt(index, dt)

    def _doubt(self, index: int, dt: float) -> None:
        if not (self._tracks.out[2 * index] or self._tracks.out[2 * index + 1]):
            self._tracks.axes[index].doubtful += 2 * dt

    def lost(self, index: int) -> Pair:
        """What the filter of an axis should forget when its gyro is named [rad], [rad/s]."""
        a, b = self._tracks.axes[index].distance
        return abs(a + b) / 2 + DRIFT, radians(30.0)
