"""Which sensor is wrong: parity, innovations and plausibility, and what to do about it.

Three witnesses stand by each axis: two potentiometers and the gyro. Two that agree against the
third name it. A supply error moves all four potentiometers by one common factor, which no other
single fault does. Frame by frame, a reading further than `GATE` from the prediction is an outlier;
slowly, each potentiometer is compared with an angle dead-reckoned from the gyro.
"""

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field
from math import cos, degrees, exp, radians
from typing import Any

from hardware.faults.evidence import POTENTIOMETERS, Prediction, Reading, Remedy
from hardware.faults.memory import filled, number
from hardware.faults.states import (
    GYRO,
    NAMED,
    ODD_SCORE,
    SCORE_TIME,
    SENSORS,
    SUPPLY,
    TRANSITIONS,
    Fault,
    State,
    Track,
)
from hardware.frames import AXES, Pair, Triple

GATE = 4.5  # σ; two Gaussian outliers of one sensor meet within 100 ms once in 60 hours
CERTAIN = 9.0  # σ; one is enough
RAIL = 0.02  # fraction of the supply no wired potentiometer reaches within ±10° of mid-travel
SMOOTHING = 0.016  # s; of the potentiometers' distance from the dead-reckoned angle
LEAK = 0.25  # s; with which the dead-reckoned angle is drawn to the estimate
SETTLING = 1.5  # s; the gyro's bias is not yet known before
FROZEN = 10  # equal gyro readings in a row, when its noise moves the last digit every time
FROZEN_DELAYS = 5.5  # delays of its low-pass; over 600 s at rest a sound one stood still for 2.0
DRIFT = radians(0.45)  # distance that counts when at rest: 6 σ plus potentiometer linearity
COMMON_DRIFT = radians(0.3)  # the same for both potentiometers of an axis together
LAG = 0.8e-3  # s; what stays of the gyro's delay while moving
QUICK = 0.008  # s; smoothing of the innovations that make a filter doubt its gyro
DOUBT = radians(0.17)  # 4 σ of them, both potentiometers in use
HABIT = 0.025  # s; over which a potentiometer's share of outliers is taken
STRANDED = (radians(3.0), radians(30.0))  # to forget when every potentiometer was refused
DOUBTFUL = 0.5  # s of disagreement that nobody can be named for, until health says so
MOSTLY = 0.6  # share of outliers above which it is wrong, not glitching


@dataclass(slots=True)
class _Axis:
    """Dead-reckoned angle of one axis and each potentiometer's smoothed distance from it."""

    free: float = 0.0
    bias: float = 0.0
    distance: list[float] = field(default_factory=lambda: [0.0, 0.0])
    outlying: list[float] = field(default_factory=lambda: [0.0, 0.0])  # share of readings
    railed: list[float] = field(default_factory=lambda: [0.0, 0.0])
    innovation: float = 0.0
    doubtful: float = 0.0  # s for which the potentiometers disagree and none can be named


class Monitor:
    """Watches the sensors of one rig; `listener(sensor, old, new, kind)` hears every change."""

    def __init__(self, listener: Callable[[str, State, State, str], None] | None = None) -> None:
        self.listener = listener
        self.time = 0.0
        self._tracks = tuple(Track(i) for i in range(len(SENSORS)))
        self._axes = (_Axis(), _Axis())
        self._running = 0.0  # s since `begin`
        self._last_gyro: Triple | None = None
        self._equal = 0
        self._named = 0
        self._blur = 0.0  # what the vaguest potentiometer map leaves open [rad]
        self._stands = False  # the gyro has given one reading for too long

    @property
    def healthy(self) -> bool:
        """No sensor is named and no axis is in doubt."""
        return self._named == 0 and all(a.doubtful < DOUBTFUL for a in self._axes)

    @property
    def faults(self) -> tuple[Fault, ...]:
        """The sensors that are named."""
        return tuple(
            Fault(SENSORS[t.index], t.kind, t.since) for t in self._tracks if t.state in NAMED
        )

    @property
    def states(self) -> dict[str, State]:
        """State of every sensor by name."""
        return {SENSORS[t.index]: t.state for t in self._tracks}

    def describe(self) -> str:
        """Return the health in one line."""
        parts = [f"{f.sensor} {f.kind}" for f in self.faults]
        parts += [
            f"potentiometers of {name} disagree"
            for name, axis in zip(AXES, self._axes, strict=True)
            if axis.doubtful >= DOUBTFUL and not parts
        ]
        return ", ".join(parts) or "ok"

    @property
    def note(self) -> str:
        """What the maps are too vague to show, in one line; "" where they are good enough."""
        if self._blur <= DRIFT:
            return ""
        seen = degrees(DRIFT + self._blur)
        return (
            f"not calibrated: potentiometers of an axis may part by {seen:.0f}° before health "
            "says so, and it cannot tell which one is wrong"
        )

    def snapshot(self) -> dict[str, object]:
        """Return everything this monitor remembers, as JSON values."""
        return {
            "time": self.time,
            "running": self._running,
            "equal": self._equal,
            "last_gyro": None if self._last_gyro is None else list(self._last_gyro),
            "tracks": [asdict(track) for track in self._tracks],
            "axes": [asdict(axis) for axis in self._axes],
        }

    def restore(self, memory: Mapping[str, Any]) -> None:
        """Take up what `snapshot` gave.

        Raises
        ------
        KeyError, TypeError, ValueError : it is no such memory
        """
        tracks = tuple(filled(Track, values) for values in memory["tracks"])
        x, y = (filled(_Axis, values) for values in memory["axes"])
        if [track.index for track in tracks] != list(range(len(SENSORS))):
            raise ValueError("tracks of other sensors")
        self._tracks, self._axes = tracks, (x, y)
        self.time, self._running = number(memory["time"]), number(memory["running"])
        self._equal = int(number(memory["equal"]))
        gyro = memory["last_gyro"]
        if gyro is not None:
            a, b, c = (number(v) for v in gyro)
            gyro = a, b, c
        self._last_gyro = gyro
        self._named = sum(track.state in NAMED for track in tracks)

    def begin(self, reading: Reading) -> tuple[bool, bool, bool, bool]:
        """Start afresh on a first frame, or after a gap; tell which potentiometers are wired."""
        a, b, c, d = (RAIL < f < 1 - RAIL for f in reading.fraction)
        self._running = 0.0
        self._last_gyro, self._equal = None, 0
        for axis in self._axes:
            axis.distance = [0.0, 0.0]
            axis.innovation = 0.0
            axis.doubtful = 0.0
        return (a, b, c, d)

    def inspect(self, reading: Reading, prediction: Prediction) -> Remedy:
        """Judge one frame before the filters take it in."""
        dt = reading.dt
        self.time += dt
        self._running += dt
        self._blur = max(prediction.tolerance)
        fade = exp(-dt / SCORE_TIME)
        for track in self._tracks:
            track.score *= fade
        rest, supply = self._without_supply(reading, prediction)
        use = self._outliers(reading, prediction, rest)
        self._frozen(reading, prediction)
        self._dead_reckon(reading, prediction, rest, use)
        if self._running > SETTLING:
            self._compare(reading, prediction)
        forget = self._advance(prediction, dt)
        gyro = self._tracks[GYRO]
        doubts = self._doubts(reading, prediction, rest, use)
        forget = (forget[0] or doubts[0], forget[1] or doubts[1])
        usable = reading.fresh and not (gyro.state is State.FAULTY and gyro.kind == "frozen")
        marginal = supply or self._tracks[SUPPLY].state in NAMED
        return Remedy(
            use=(use[0], use[1], use[2], use[3]),
            use_gyro=(usable, usable),
            supply_sigma=1.0 if marginal else 0.0,
            forget=forget,
        )

    def _accuse(self, index: int, weight: float, kind: str) -> None:
        track = self._tracks[index]
        track.score = min(track.score + weight, 2.0)
        if index < GYRO:
            axis, k = self._axes[index // 2], index % 2
            if axis.railed[k] > MOSTLY:
                kind = "open"
            elif axis.outlying[k] > MOSTLY:
                kind = "deviating"
        elif index == GYRO and self._stands:
            kind = "frozen"
        track.kind = kind

    def _without_supply(self, r: Reading, p: Prediction) -> tuple[list[float], bool]:
        """Return the innovations [rad] freed of a common supply error, and whether there is one."""
        rest = [r.angle[i] - p.angle[i // 2] for i in range(POTENTIOMETERS)]
        known = self._tracks[SUPPLY].state in NAMED
        outlying = sum(rest[i] ** 2 > GATE**2 * p.variance[i] for i in range(POTENTIOMETERS))
        if outlying < 2 and not known:
            return rest, False
        wired = [
            i
            for i in range(POTENTIOMETERS)
            if self._tracks[i].state not in NAMED and RAIL < r.fraction[i] < 1 - RAIL
        ]
        if len(wired) < 3:
            return rest, False
        slope = [f * g for f, g in zip(r.fraction, r.gain, strict=True)]
        weight = sum(slope[i] ** 2 / p.variance[i] for i in wired)
        error = sum(slope[i] * rest[i] / p.variance[i] for i in wired) / weight
        fitted = [rest[i] - slope[i] * error for i in range(POTENTIOMETERS)]
        fits = all(fitted[i] ** 2 < GATE**2 * p.variance[i] for i in wired)
        if fits and error * error * weight > GATE**2:
            self._accuse(SUPPLY, 0.3, "sag")
            return fitted, True
        return (fitted, True) if known else (rest, False)

    def _outliers(self, r: Reading, p: Prediction, rest: list[float]) -> list[bool]:
        """Return which potentiometers may be used in this frame."""
        use = [True] * POTENTIOMETERS
        habit = min(1.0, r.dt / HABIT)
        for i in range(POTENTIOMETERS):
            axis, k, other = self._axes[i // 2], i % 2, i ^ 1
            railed = not RAIL < r.fraction[i] < 1 - RAIL
            z2 = rest[i] ** 2 / p.variance[i]
            pair = p.variance[i] + p.variance[other]
            agree = (rest[i] - rest[other]) ** 2 < GATE**2 * pair
            # Potentiometers that agree against the prediction speak of the gyro, not of one.
            outlying = z2 > GATE**2 and (not agree or self._excluded(other))
            axis.railed[k] += habit * (railed - axis.railed[k])
            axis.outlying[k] += habit * ((outlying or railed) - axis.outlying[k])
            if railed or outlying:
                use[i] = False
                self._accuse(i, 1.0 if z2 > CERTAIN**2 else 0.6, "glitch")
            elif self._excluded(i):
                use[i] = False
        return use

    def _excluded(self, index: int) -> bool:
        """Tell whether a potentiometer stays out; one that lies now and then may lie a little."""
        return self._tracks[index].state in NAMED

    def _mute(self, r: Reading, axis: int) -> bool:
        """Tell whether an axis's potentiometers cannot tell a sag from a motion just now."""
        same_sense = r.gain[2 * axis] * r.gain[2 * axis + 1] > 0
        return same_sense and self._tracks[SUPPLY].state in NAMED

    def _frozen(self, r: Reading, p: Prediction) -> None:
        self._equal = self._equal + 1 if r.gyro == self._last_gyro or not r.fresh else 0
        self._last_gyro = r.gyro
        slow = self._equal * r.dt < FROZEN_DELAYS * p.gyro_delay
        self._stands = self._equal >= FROZEN and not slow
        if self._stands:
            self._accuse(GYRO, 1.0, "frozen")

    def _doubts(
        self, r: Reading, p: Prediction, rest: list[float], use: list[bool]
    ) -> list[Pair | None]:
        """Return what each filter should forget because all its potentiometers contradict it.

        This costs a little noise and names nobody, so it may come sooner than a name.
        """
        forget: list[Pair | None] = [None, None]
        for k, axis in enumerate(self._axes):
            pair = (2 * k, 2 * k + 1)
            if self._mute(r, k):
                axis.innovation = 0.0
                continue
            used = [rest[i] for i in pair if use[i]]
            if used:
                mean = sum(used) / len(used)
                axis.innovation += min(1.0, r.dt / QUICK) * (mean - axis.innovation)
                limit = DOUBT * (2 / len(used)) ** 0.5 + LAG * abs(p.rate[k])
                if abs(axis.innovation) > limit:
                    forget[k] = (abs(axis.innovation), radians(10.0))
                continue
            wired = [i for i in pair if not self._excluded(i) and axis.railed[i % 2] < 0.5]
            if wired and all(axis.outlying[i % 2] > MOSTLY for i in wired):
                forget[k] = STRANDED
        return forget

    def _dead_reckon(self, r: Reading, p: Prediction, rest: list[float], use: list[bool]) -> None:
        smooth = min(1.0, r.dt / SMOOTHING)
        cosine = (cos(p.angle[1]), 1.0)
        wrong_gyro = self._tracks[GYRO].state in NAMED
        for index, axis in enumerate(self._axes):
            if self._running <= r.dt or wrong_gyro or self._running < SETTLING:
                axis.bias = p.bias[index]
            axis.free += (r.rate[index] - axis.bias) / cosine[index] * r.dt
            late = p.rate[index] * p.gyro_delay
            offset = p.angle[index] - (axis.free + late)
            if self._running <= r.dt:
                axis.free += offset
                offset = 0.0
            for k in (0, 1):
                i = 2 * index + k
                if not use[i] and axis.outlying[k] < MOSTLY and not self._excluded(i):
                    continue  # single wrong readings are outliers; they must not look like a drift
                axis.distance[k] += smooth * (rest[i] + offset - axis.distance[k])
            parity = axis.distance[0] - axis.distance[1]
            named = self._excluded(2 * index) or self._excluded(2 * index + 1)
            # While they part, the angle stays with the gyro: the estimate follows their mean.
            if named or abs(parity) < 0.5 * DRIFT:
                leak = LEAK if not wrong_gyro else 0.1 * LEAK
                axis.free += offset * min(1.0, r.dt / leak)
                axis.bias += (p.bias[index] - axis.bias) * min(1.0, r.dt)

    def _compare(self, r: Reading, p: Prediction) -> None:
        for index, axis in enumerate(self._axes):
            a, b = axis.distance
            axis.doubtful = min(max(0.0, axis.doubtful - r.dt), 2 * DOUBTFUL)
            vague = max(p.tolerance[2 * index : 2 * index + 2])
            moving = LAG * abs(p.rate[index]) + vague
            if abs(a - b) > DRIFT + moving:
                self._disagree(index, a, b, DRIFT + moving, r.dt, vague <= DRIFT)
            elif (
                not self._mute(r, index)
                and min(a * a, b * b) > (COMMON_DRIFT + moving) ** 2
                and a * b > 0
            ):
                self._accuse(GYRO, 0.2, "bias")

    def _disagree(
        self, index: int, a: float, b: float, margin: float, dt: float, tellable: bool
    ) -> None:
        """Name the one further off; where the maps are too vague for that, doubt the axis."""
        if not tellable:
            self._doubt(index, dt)
        elif abs(a) > abs(b) + 0.5 * margin:
            self._accuse(2 * index, 0.2, "deviating")
        elif abs(b) > abs(a) + 0.5 * margin:
            self._accuse(2 * index + 1, 0.2, "deviating")
        else:
            self._doubt(index, dt)

    def _doubt(self, index: int, dt: float) -> None:
        if not (self._excluded(2 * index) or self._excluded(2 * index + 1)):
            self._axes[index].doubtful += 2 * dt

    def _advance(self, p: Prediction, dt: float) -> tuple[Pair | None, Pair | None]:
        """Move every sensor's state along `TRANSITIONS`; return what the filters should forget."""
        forget: tuple[Pair | None, Pair | None] = (None, None)
        for track in self._tracks:
            if track.score <= ODD_SCORE and track.state is State.OK:
                continue
            angle = p.angle[min(track.index, 3) // 2]
            track.clean = 0.0 if track.score > ODD_SCORE else track.clean + dt
            if track.clean == 0.0:
                track.lowest = track.highest = angle
            track.lowest, track.highest = min(track.lowest, angle), max(track.highest, angle)
            new = TRANSITIONS.get((track.state, track.sign()), track.state)
            if new is track.state:
                continue
            if new is State.FAULTY and track.state not in NAMED:
                track.since = self.time
                if track.index == GYRO:
                    forget = (self._lost(0), self._lost(1))
            self._change(track, new)
        return forget

    def _lost(self, index: int) -> Pair:
        a, b = self._axes[index].distance
        return abs(a + b) / 2 + DRIFT, radians(30.0)

    def _change(self, track: Track, new: State) -> None:
        old, track.state = track.state, new
        self._named = sum(t.state in NAMED for t in self._tracks)
        if self.listener is not None:
            self.listener(SENSORS[track.index], old, new, track.kind)
