"""Evidence on one axis: its dead-reckoned angle, and how far each potentiometer is from it."""

from dataclasses import dataclass, field
from math import radians

from hardware.frames import Pair

SMOOTHING = 0.016  # s; of the potentiometers' distance from the dead-reckoned angle
LEAK = 0.25  # s; time constant with which the dead-reckoned angle returns to the estimate
DRIFT = radians(0.45)  # distance that counts when at rest: 6 σ plus potentiometer linearity
LAG = 0.8e-3  # s; what stays of the gyro's delay while moving
FADING = 0.1  # s; errors of a fast motion outlast it by as much
QUICK = 0.008  # s; smoothing of the innovations that make a filter distrust its gyro
DOUBT = radians(0.17)  # 4 σ of them, both potentiometers in use
HABIT = 0.025  # s; over which a potentiometer's share of outliers is averaged
FORGOTTEN = 1e-9  # share or score below which there is no evidence
STRANDED = (radians(3.0), radians(30.0))  # to forget when every potentiometer was refused
MOSTLY = 0.6  # share of outliers above which it is wrong, not glitching


@dataclass(slots=True)
class Axis:
    """What the monitor keeps of one axis.

    Attributes
    ----------
    free, bias : dead-reckoned angle [rad] and the gyro bias [rad/s] it uses
    distance : smoothed distance of each potentiometer from it [rad]
    outlying, railed : share of each potentiometer's readings that are outliers, or at a rail [1]
    innovation : smoothed mean innovation [rad]
    doubtful : time for which the potentiometers disagree and neither can be named [s]
    common : time for which both disagree with the gyro and neither side can be named [s]
    pace : largest rate of gimbal and base of late [rad/s], fading with `FADING`
    carried : largest rate of the base of late [rad/s], fading with `LEAK`
    wandering : time for which the filter's bias is not believed, after it was made to forget [s]
    """

    free: float = 0.0
    bias: float = 0.0
    distance: list[float] = field(default_factory=lambda: [0.0, 0.0])
    outlying: list[float] = field(default_factory=lambda: [0.0, 0.0])
    railed: list[float] = field(default_factory=lambda: [0.0, 0.0])
    innovation: float = 0.0
    doubtful: float = 0.0
    common: float = 0.0
    pace: float = 0.0
    carried: float = 0.0
    wandering: float = 0.0

    def begin(self) -> None:
        """Start again on a first frame, or after a gap."""
        self.distance = [0.0, 0.0]
        self.innovation = self.doubtful = self.common = 0.0
        self.pace = self.carried = self.wandering = 0.0

    def count(self, k: int, railed: bool, bad: bool, dt: float) -> None:
        """Update the shares of bad readings of potentiometer `k`; `bad` includes `railed`."""
        habit = min(1.0, dt / HABIT)
        self.railed[k] += habit * (railed - self.railed[k])
        self.outlying[k] += habit * (bad - self.outlying[k])
        if self.outlying[k] < FORGOTTEN:
            self.railed[k] = self.outlying[k] = 0.0

    def contradicted(self, used: list[float], rate: float, dt: float) -> Pair | None:
        """Return what the filter should forget when its potentiometers contradict the gyro.

        This costs a little noise and names no sensor, so it may come sooner than a name.

        Parameters
        ----------
        used : innovations of the potentiometers in use, at least one [rad]
        rate : predicted [rad/s]
        dt : time since the previous frame [s]
        """
        count = len(used)
        self.innovation += min(1.0, dt / QUICK) * (sum(used) / count - self.innovation)
        size = abs(self.innovation)
        if size > DOUBT * (2 / count) ** 0.5 + LAG * abs(rate):
            self.wandering = LEAK
            return size, radians(10.0)
        return None
