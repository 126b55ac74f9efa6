"""Which sensor or servo is wrong: parity, innovations and plausibility, and what to do about it.

Three sensors measure each axis: two potentiometers and the gyro. Two that agree against the third
name it; between both potentiometers and the gyro, the servo's command decides. A supply error moves
all four potentiometers by one common factor, which no other single fault does. Frame by frame, a
reading further than `GATE` from the prediction is an outlier; slowly, each potentiometer is
compared with an angle dead-reckoned from the gyro.
"""

from collections.abc import Callable, Mapping
from dataclasses import asdict
from math import degrees, radians
from typing import Any

from hardware.faults.actuation import Actuation
from hardware.faults.attribution import Attribution
from hardware.faults.axis import DRIFT, MOSTLY, STRANDED, Axis
from hardware.faults.drift import SETTLING, Drift
from hardware.faults.evidence import POTENTIOMETERS, Prediction, Reading, Remedy
from hardware.faults.gravity import Gravity
from hardware.faults.memory import filled, number
from hardware.faults.parity import Parity
from hardware.faults.states import GYRO, NAMED, SENSORS, SUPPLY, Fault, State, Track
from hardware.faults.tracks import Tracks
from hardware.frames import Pair, Triple
from hardware.parts import RAIL

FROZEN = 10  # equal gyro readings in a row, when its noise moves the last digit every time
FROZEN_DELAYS = 5.5  # delays of its low-pass; a healthy one at rest for 600 s stood still for 2.0
KNOWN = radians(0.3)  # angle of a rig without potentiometers, from which its servos are judged
Listener = Callable[[str, State, State, str], None]


class Monitor:
    """Monitors one rig; calls `listener(sensor, old, new, kind)` on every change.

    Parameters
    ----------
    listener : as above; `sensor` may be a servo
    actuation : comparison of the servos with their commands
    minimal : the rig has no potentiometers; servos and a gyro that stands still are monitored
    """

    def __init__(
        self,
        listener: Listener | None = None,
        actuation: Actuation | None = None,
        *,
        minimal: bool = False,
    ) -> None:
        self.actuation = actuation or Actuation()
        self._minimal = minimal
        self._tracks = Tracks(listener)
        self._assemble(Gravity())
        self._last_gyro: Triple | None = None
        self._equal = 0
        self._blur = 0.0  # 3 σ of the most uncertain potentiometer map [rad]

    def _assemble(self, gravity: Gravity) -> None:
        tracks, actuation = self._tracks, self.actuation
        self._gravity, self._parity = gravity, Parity(tracks)
        self._drift = Drift(tracks, self._parity, actuation, gravity)
        self._attribution = Attribution(tracks, actuation, gravity, minimal=self._minimal)

    @property
    def listener(self) -> Listener | None:
        """Called on every change."""
        return self._tracks.listener

    @listener.setter
    def listener(self, listener: Listener | None) -> None:
        self._tracks.listener = listener

    @property
    def healthy(self) -> bool:
        """No sensor or servo is named and no axis is in doubt."""
        return self._tracks.healthy

    @property
    def faults(self) -> tuple[Fault, ...]:
        """The sensors and servos that are named."""
        return self._tracks.faults

    @property
    def states(self) -> dict[str, State]:
        """State of every sensor and servo by name."""
        return self._tracks.states

    def describe(self) -> str:
        """Return the health in one line."""
        return self._tracks.describe()

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
            "time": self._tracks.time,
            "running": self._drift.running,
            "equal": self._equal,
            "last_gyro": None if self._last_gyro is None else list(self._last_gyro),
            "tracks": [asdict(track) for track in self._tracks.tracks],
            "axes": [asdict(axis) for axis in self._tracks.axes],
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
        # Recordings of earlier versions hold neither these three nor all averages of gravity.
        later = {"wandering": 0.0, "carried": 0.0}
        x, y = (filled(Axis, {**later, **values}) for values in memory["axes"])
        if [track.index for track in tracks] != list(range(len(SENSORS))):
            raise ValueError("tracks of other sensors")
        slope = {"slope": [0.0] * POTENTIOMETERS}
        kept = {**slope, **memory["gravity"]}
        gravity = filled(Gravity, kept) if "fit" in kept else Gravity()
        self.actuation.restore(memory["actuation"])
        self._assemble(gravity)
        self._tracks.tracks, self._tracks.axes = tracks, (x, y)
        self._tracks.time, self._drift.running = number(memory["time"]), number(memory["running"])
        self._equal = int(number(memory["equal"]))
        gyro = memory["last_gyro"]
        if gyro is not None:
            a, b, c = (number(v) for v in gyro)
            gyro = a, b, c
        self._last_gyro = gyro
        self._tracks.out = [track.state in NAMED for track in tracks]

    def begin(self, reading: Reading) -> tuple[bool, bool, bool, bool]:
        """Start again on a first frame, or after a gap; return which potentiometers are wired."""
        a, b, c, d = (self._minimal or RAIL < f < 1 - RAIL for f in reading.fraction)
        self._drift.running = 0.0
        self._last_gyro, self._equal = None, 0
        for axis in self._tracks.axes:
            axis.begin()
        self.actuation.begin()
        self._gravity.begin()
        return (a, b, c, d)

    def inspect(self, reading: Reading, prediction: Prediction) -> Remedy:
        """Judge one frame before the filter applies it."""
        dt, tracks = reading.dt, self._tracks
        tracks.time += dt
        self._drift.running += dt
        self._blur = max(prediction.tolerance)
        tracks.fade(dt)
        if self._minimal:
            return self._by_imu(reading, prediction)
        rest, supply = self._parity.without_supply(reading, prediction)
        use = self._parity.outliers(reading, prediction, rest)
        self._frozen(reading, prediction)
        self.actuation.advance(reading.command, prediction.angle, dt, reading.carried, reading.turn)
        if reading.fresh:
            self._gravity.update(reading, prediction, healthy=tracks.healthy)
        self._drift.dead_reckon(reading, prediction, rest, use)
        if self._drift.running > SETTLING:
            self._drift.compare(reading, prediction)
        self._attribution.judge(reading, prediction)
        named = tracks.advance(prediction.angle, dt)
        lost = (self._drift.lost(0), self._drift.lost(1)) if named else (None, None)
        usable = reading.fresh and not (tracks.out[GYRO] and tracks.frozen)
        marginal = supply or tracks.out[SUPPLY]
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
        for axis, bias in zip(self._tracks.axes, p.bias, strict=True):
            axis.bias = bias
        if max(p.variance) > KNOWN**2:  # not yet at rest since the start
            self.actuation.begin()
        else:
            self._attribution.judge(r, p)
        self._tracks.advance(p.angle, r.dt)
        usable = r.fresh and not (self._tracks.out[GYRO] and self._tracks.frozen)
        return Remedy((usable, False, usable, False), (usable, usable))

    def _frozen(self, r: Reading, p: Prediction) -> None:
        self._equal = self._equal + 1 if r.gyro == self._last_gyro or not r.fresh else 0
        self._last_gyro = r.gyro
        slow = self._equal * r.dt < FROZEN_DELAYS * p.gyro_delay
        self._tracks.stands = self._equal >= FROZEN and not slow
        if self._tracks.stands:
            self._tracks.accuse(GYRO, 1.0, "frozen")

    def _contradicted(
        self, k: int, r: Reading, p: Prediction, rest: list[float], use: list[bool]
    ) -> Pair | None:
        """Return what one filter should forget because all its potentiometers contradict it."""
        axis, i = self._tracks.axes[k], 2 * k
        if self._parity.mute(r, k):
            axis.innovation = 0.0
            return None
        if used := [rest[n] for n in (i, i + 1) if use[n]]:
            return axis.contradicted(used, p.rate[k], r.dt)
        wired = [n for n in (0, 1) if not self._tracks.out[i + n] and axis.railed[n] < 0.5]
        stranded = wired and all(axis.outlying[n] > MOSTLY for n in wired)
        return STRANDED if stranded else None
