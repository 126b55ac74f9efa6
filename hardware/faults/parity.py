"""Frame by frame: which potentiometers may be used, and whether the supply is at fault.

A reading further than `GATE` from the prediction is an outlier. A supply error moves all four
potentiometers by one common factor, which no other single fault does.
"""

from hardware.faults.axis import DRIFT
from hardware.faults.evidence import POTENTIOMETERS, Prediction, Reading
from hardware.faults.states import GLITCH, SUPPLY
from hardware.faults.tracks import Tracks
from hardware.parts import RAIL

GATE = 4.5  # σ; two Gaussian outliers of one sensor meet within 100 ms once in 60 hours
CERTAIN = 9.0  # σ; one is enough
GATE_2, CERTAIN_2 = GATE**2, CERTAIN**2


class Parity:
    """Judges the potentiometers of each frame by the prediction and by each other."""

    def __init__(self, tracks: Tracks) -> None:
        self._tracks = tracks

    def without_supply(self, r: Reading, p: Prediction) -> tuple[list[float], bool]:
        """Return the innovations [rad] freed of a common supply error, and whether there is one."""
        (a, b, c, d), (x, y), v = r.angle, p.angle, p.variance
        rest = [a - x, b - x, c - y, d - y]
        known = self._tracks.out[SUPPLY]
        outlying = sum([q * q > GATE_2 * w for q, w in zip(rest, v, strict=True)])
        if outlying < 2 and not known:
            return rest, False
        f = r.fraction
        wired = [
            i for i in range(POTENTIOMETERS) if not self._tracks.out[i] and RAIL < f[i] < 1 - RAIL
        ]
        if len(wired) < 3:
            return rest, False
        slope = [f * g for f, g in zip(r.fraction, r.gain, strict=True)]
        weight = sum(slope[i] ** 2 / v[i] for i in wired)
        error = sum(slope[i] * rest[i] / v[i] for i in wired) / weight
        fitted = [rest[i] - slope[i] * error for i in range(POTENTIOMETERS)]
        fits = all(fitted[i] ** 2 < GATE_2 * v[i] for i in wired)
        if fits and error * error * weight > GATE_2:
            self._tracks.accuse(SUPPLY, 0.3, "sag")
            return fitted, True
        return (fitted, True) if known else (rest, False)

    def outliers(self, r: Reading, p: Prediction, rest: list[float]) -> list[bool]:
        """Return which potentiometers may be used in this frame."""
        use = [not out for out in self._tracks.out[:POTENTIOMETERS]]
        for i, fraction in enumerate(r.fraction):
            axis, k = self._tracks.axes[i >> 1], i & 1
            railed = not RAIL < fraction < 1 - RAIL
            z2 = rest[i] * rest[i] / p.variance[i]
            bad = railed or (z2 > GATE_2 and self._alone(i, p, rest))
            if bad or axis.outlying[k]:
                axis.count(k, railed, bad, r.dt)
            if bad:
                use[i] = False
                self._tracks.accuse(i, 1.0 if z2 > CERTAIN_2 else 0.6, GLITCH)
        return use

    def _alone(self, i: int, p: Prediction, rest: list[float]) -> bool:
        """Return whether a potentiometer contradicts the other one too, not only the prediction.

        Two that agree against the prediction indicate a wrong gyro.
        """
        other = i ^ 1
        apart = rest[i] - rest[other]
        return self._tracks.out[other] or not apart * apart < GATE_2 * (
            p.variance[i] + p.variance[other]
        )

    def mute(self, r: Reading, axis: int) -> bool:
        """Return whether an axis's potentiometers cannot separate a sag from a motion now."""
        return self._tracks.out[SUPPLY] and r.gain[2 * axis] * r.gain[2 * axis + 1] > 0

    def sagging(self, r: Reading) -> bool:
        """Name a supply error that has grown slowly: one factor for all potentiometers."""
        if any(self._tracks.out[:POTENTIOMETERS]):
            return False
        apart = [*self._tracks.axes[0].distance, *self._tracks.axes[1].distance]
        slope = [f * g for f, g in zip(r.fraction, r.gain, strict=True)]
        error = sum(s * a for s, a in zip(slope, apart, strict=True)) / sum(s * s for s in slope)
        shares = [abs(s * error) for s in slope]
        left = max(abs(a - s * error) for a, s in zip(apart, slope, strict=True))
        if left > 0.5 * min(shares) or max(shares) < 0.4 * DRIFT:
            return False
        self._tracks.accuse(SUPPLY, 0.2, "sag")
        return True
