"""Which sensor or servo is wrong: parity, innovations and plausibility, and what to do about it.

Three sensors measure each axis: two potentiometers and the gyro. Two that agree against the third
name it; between both potentiometers and the gyro, the servo's command decides. A supply error moves
all four potentiometers by one common factor, which no other single fault does. Frame by frame, a
reading further than `GATE` from the prediction is an outlier; slowly, each potentiometer is
compared with an angle dead-reckoned from the gyro.
"""

from collections.abc import Callable, Mapping
from dataclasses import asdict
from math import cos, degrees, radians
from typing import Any

from hardware.faults.actuation import MISREAD, Actuation
from hardware.faults.axis import DRIFT, MOSTLY, STRANDED, Axis
from hardware.faults.drift import SETTLING, Drift
from hardware.faults.evidence import Prediction, Reading, Remedy
from hardware.faults.gravity import Gravity
from hardware.faults.memory import filled, number
from hardware.faults.states import (
    GYRO,
    NAMED,
    PAIR,
    SENSORS,
    SERVO,
    SUPPLY,
    UNNAMED,
    State,
    Track,
)
from hardware.frames import Pair, Triple
from hardware.parts import RAIL

FROZEN = 10  # equal gyro readings in a row, when its noise moves the last digit every time
FROZEN_DELAYS = 5.5  # delays of its low-pass; a healthy one at rest for 600 s stood still for 2.0
# By which both potentiometers have left gravity where they drift, and of an axis's offset: servos
# that jam or slip, and healthy ones in slews, leave at most 0.09° and 0.03; drifts at least 0.22°
# and 0.14 (up to 2 °/s; units 100 to 104, 120 and 121).
SHIFTED, AVERAGED = radians(0.15), 0.08
KNOWN = radians(0.3)  # angle of a rig without potentiometers, from which its servos are judged


class Monitor(Drift):
    """Monitors one rig; calls `listener(sensor, old, new, kind)` on every change.

    Parameters
    ----------
    listener : as above; `sensor` may be a servo
    actuation : comparison of the servos with their commands
    minimal : the rig has no potentiometers; servos and a gyro that stands still are monitored
    """

    def __init__(
        self,
        listener: Callable[[str, State, State, str], None] | None = None,
        actuation: Actuation | None = None,
        *,
        minimal: bool = False,
    ) -> None:
        super().__init__(listener, actuation)
        self._minimal = minimal
        self._last_gyro: Triple | None = None
        self._equal = 0
        self._blur = 0.0  # 3 σ of the most uncertain potentiometer map [rad]

    @property
    def note(self) -> str:
        """What uncertain maps leave undetected, in one line; "" for a calibrated rig."""
        if self._blur <= DRIFT:
            return ""
        seen = degrees(DRIFT + self._blur)
        return (
            f"not calibrated: potentiometers of an axis may part by {seen:.0f}° before health "
            "reports it, and the wrong one is not named"
        )

    def snapshot(self) -> dict[str, object]:
        """Return the whole state of this monitor, as JSON values."""
        return {
            "time": self.time,
            "running": self._running,
            "equal": self._equal,
            "last_gyro": None if self._last_gyro is None else list(self._last_gyro),
            "tracks": [asdict(track) for track in self._tracks],
            "axes": [asdict(axis) for axis in self._axes],
            "gravity": asdict(self._gravity),
            "actuation": self.actuation.snapshot(),
        }

    def restore(self, memory: Mapping[str, Any]) -> None:
        """Restore the state from a `snapshot`.

        Raises
        ------
        KeyError, TypeError, ValueError : it is not a snapshot
        """
        tracks = tuple(filled(Track, values) for values in memory["tracks"])
        # Recordings of earlier versions hold no `wandering`.
        x, y = (filled(Axis, {"wandering": 0.0, **values}) for values in memory["axes"])
        if [track.index for track in tracks] != list(range(len(SENSORS))):
            raise ValueError("tracks of other sensors")
        gravity = filled(Gravity, memory["gravity"])
        self.actuation.restore(memory["actuation"])
        self._gravity = gravity
        self._tracks, self._axes = tracks, (x, y)
        self.time, self._running = number(memory["time"]), number(memory["running"])
        self._equal = int(number(memory["equal"]))
        gyro = memory["last_gyro"]
        if gyro is not None:
            a, b, c = (number(v) for v in gyro)
            gyro = a, b, c
        self._last_gyro = gyro
        self._out = [track.state in NAMED for track in tracks]

    def begin(self, reading: Reading) -> tuple[bool, bool, bool, bool]:
        """Start again on a first frame, or after a gap; return which potentiometers are wired."""
        a, b, c, d = (self._minimal or RAIL < f < 1 - RAIL for f in reading.fraction)
        self._running = 0.0
        self._last_gyro, self._equal = None, 0
        for axis in self._axes:
            axis.begin()
        self.actuation.begin()
        self._gravity.begin()
        return (a, b, c, d)

    def inspect(self, reading: Reading, prediction: Prediction) -> Remedy:
        """Judge one frame before the filter applies it."""
        dt = reading.dt
        self.time += dt
        self._running += dt
        self._blur = max(prediction.tolerance)
        self._fade(dt)
        if self._minimal:
            return self._by_imu(reading, prediction)
        rest, supply = self._without_supply(reading, prediction)
        use = self._outliers(reading, prediction, rest)
        self._frozen(reading, prediction)
        self.actuation.advance(reading.command, prediction.angle, dt)
        if reading.fresh:
            self._gravity.update(reading.angle, reading.force, reading.base_force, dt)
        self._dead_reckon(reading, prediction, rest, use)
        if self._running > SETTLING:
            self._compare(reading, prediction)
        self._watch_servos(reading, prediction)
        named = self._advance(prediction.angle, dt)
        lost = (self._lost(0), self._lost(1)) if named else (None, None)
        usable = reading.fresh and not (self._out[GYRO] and self._is_frozen())
        marginal = supply or self._out[SUPPLY]
        x, y = (self._contradicted(k, reading, prediction, rest, use) for k in (0, 1))
        return Remedy(
            (use[0], use[1], use[2], use[3]),
            (usable, usable),
            1.0 if marginal else 0.0,
            (lost[0] or x, lost[1] or y),
        )

    def _by_imu(self, r: Reading, p: Prediction) -> Remedy:
        """Judge a frame of a rig without potentiometers: one witness, and the servos' commands."""
        self._frozen(r, p)
        self.actuation.advance(r.command, p.angle, r.dt)
        for axis, bias in zip(self._axes, p.bias, strict=True):
            axis.bias = bias
        if max(p.variance) > KNOWN**2:  # not yet at rest since the start
            self.actuation.begin()
        else:
            self._watch_servos(r, p)
        self._advance(p.angle, r.dt)
        usable = r.fresh and not (self._out[GYRO] and self._is_frozen())
        return Remedy((usable, False, usable, False), (usable, usable))

    def _frozen(self, r: Reading, p: Prediction) -> None:
        self._equal = self._equal + 1 if r.gyro == self._last_gyro or not r.fresh else 0
        self._last_gyro = r.gyro
        slow = self._equal * r.dt < FROZEN_DELAYS * p.gyro_delay
        self._stands = self._equal >= FROZEN and not slow
        if self._stands:
            self._accuse(GYRO, 1.0, "frozen")

    def _contradicted(
        self, k: int, r: Reading, p: Prediction, rest: list[float], use: list[bool]
    ) -> Pair | None:
        """Return what one filter should forget because all its potentiometers contradict it."""
        axis, i = self._axes[k], 2 * k
        if self._mute(r, k):
            axis.innovation = 0.0
            return None
        if used := [rest[n] for n in (i, i + 1) if use[n]]:
            return axis.contradicted(used, p.rate[k], r.dt)
        wired = [n for n in (0, 1) if not self._out[i + n] and axis.railed[n] < 0.5]
        stranded = wired and all(axis.outlying[n] > MOSTLY for n in wired)
        return STRANDED if stranded else None

    def _watch_servos(self, r: Reading, p: Prediction) -> None:
        """Name servos that do not obey, or the potentiometers that only make it look so."""
        actuation = self.actuation
        turned = None
        if not self._out[GYRO]:
            u, v = (rate - axis.bias for rate, axis in zip(r.rate, self._axes, strict=True))
            turned = (u / cos(p.angle[1]) * r.dt, v * r.dt)
        actuation.inspect(p.angle, p.rate, turned, r.dt, r.switches)
        for k, kind in enumerate(actuation.kinds):
            if not kind:
                continue
            # A horn that slips takes the holder along, and gravity shows it too.
            shift = 0.5 * (self._gravity.departed(2 * k) + self._gravity.departed(2 * k + 1))
            offset = p.angle[k] - actuation.axes[k].model
            slow = kind == UNNAMED or kind.startswith("offset")
            drifted = slow and shift * offset > 0
            drifted = drifted and abs(shift) > max(SHIFTED, AVERAGED * abs(offset))
            if self._minimal and kind == MISREAD:
                self._accuse(GYRO, 1.0, "bias")
            elif drifted or kind == MISREAD or self._out[PAIR + k]:
                self._accuse(PAIR + k, 1.0, "deviating")
            else:
                self._accuse(SERVO + k, 1.0, kind)
