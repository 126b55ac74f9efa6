"""Whether an axis that leaves its command shows a fault of its servo, or of its potentiometers."""

from math import cos

from hardware.faults.actuation import MISREAD, Actuation
from hardware.faults.evidence import Prediction, Reading
from hardware.faults.gravity import Gravity
from hardware.faults.states import GYRO, PAIR, SERVO, UNNAMED
from hardware.faults.tracks import Tracks


class Attribution:
    """Names servos that do not obey, or the potentiometers that only make it look so."""

    def __init__(
        self, tracks: Tracks, actuation: Actuation, gravity: Gravity, *, minimal: bool
    ) -> None:
        self._tracks, self._actuation, self._gravity = tracks, actuation, gravity
        self._minimal = minimal

    def judge(self, r: Reading, p: Prediction) -> None:
        """Compare both axes with their commands, and accuse what explains a difference."""
        tracks, actuation = self._tracks, self._actuation
        turned = None
        if not tracks.out[GYRO]:
            u, v = (rate - axis.bias for rate, axis in zip(r.rate, tracks.axes, strict=True))
            turned = (u / cos(p.angle[1]) * r.dt, v * r.dt)
        actuation.inspect(p.angle, p.rate, turned, r.dt, r.switches)
        for k, kind in enumerate(actuation.kinds):
            if not kind:
                continue
            if self._minimal and kind == MISREAD:
                tracks.accuse(GYRO, 1.0, "bias")
            elif kind == MISREAD or tracks.out[PAIR + k] or self._drifted(k, kind, p):
                tracks.accuse(PAIR + k, 1.0, "deviating")
            else:
                tracks.accuse(SERVO + k, 1.0, kind)

    def _drifted(self, k: int, kind: str, p: Prediction) -> bool:
        """Return whether both potentiometers have left gravity in the sense of the fault.

        A horn that slips takes the holder along, and gravity shows it too.
        """
        if kind != UNNAMED and not kind.startswith("offset"):
            return False
        return self._gravity.left(k, p.angle[k] - self._actuation.axes[k].model)
