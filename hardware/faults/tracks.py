"""States of all sensors and servos, and their transitions by the evidence on each."""

from collections.abc import Callable
from math import exp

from hardware.faults.axis import FORGOTTEN, MOSTLY, Axis
from hardware.faults.states import (
    GLITCH,
    GYRO,
    NAMED,
    ODD_SCORE,
    SCORE_TIME,
    SENSORS,
    SERVO,
    TRANSITIONS,
    UNNAMED,
    Fault,
    State,
    Track,
)
from hardware.frames import AXES, Pair

DOUBTFUL = 0.5  # s of disagreement in which no sensor can be named, until health reports it


class Tracks:
    """The state of every sensor and servo; calls `listener(sensor, old, new, kind)` on a change.

    The kind of a servo's fault may follow later: it changes then, and the state does not.

    Attributes
    ----------
    time : of the rig [s]
    tracks : in the order of `SENSORS`
    axes : evidence on the potentiometers of x and y
    out : which sensors and servos are named
    stands : whether the gyro has repeated one reading for too long
    """

    def __init__(self, listener: Callable[[str, State, State, str], None] | None = None) -> None:
        self.listener = listener
        self.time = 0.0
        self.tracks = tuple(Track(i) for i in range(len(SENSORS)))
        self.axes = (Axis(), Axis())
        self.out = [False] * len(SENSORS)
        self.stands = False

    @property
    def healthy(self) -> bool:
        """No sensor or servo is named and no axis is in doubt."""
        return not any(self.out) and all(a.doubtful < DOUBTFUL for a in self.axes)

    @property
    def faults(self) -> tuple[Fault, ...]:
        """The sensors and servos that are named."""
        return tuple(
            Fault(SENSORS[t.index], t.kind, t.since) for t in self.tracks if t.state in NAMED
        )

    @property
    def states(self) -> dict[str, State]:
        """State of every sensor and servo by name."""
        return {SENSORS[t.index]: t.state for t in self.tracks}

    def describe(self) -> str:
        """Return the health in one line."""
        parts = [f"{f.sensor} {f.kind}" for f in self.faults]
        parts += [
            f"potentiometers of {name} disagree"
            for name, axis in zip(AXES, self.axes, strict=True)
            if axis.doubtful >= DOUBTFUL and not parts
        ]
        return ", ".join(parts) or "ok"

    @property
    def frozen(self) -> bool:
        """Whether the gyro is named because it repeats one reading."""
        gyro = self.tracks[GYRO]
        return gyro.state is State.FAULTY and gyro.kind == "frozen"

    def accuse(self, index: int, weight: float, kind: str) -> None:
        """Add evidence of a kind of fault to the score of a sensor or servo."""
        track = self.tracks[index]
        track.score = min(track.score + weight, 2.0)
        if index < GYRO:
            axis, k = self.axes[index // 2], index % 2
            if axis.railed[k] > MOSTLY:
                kind = "open"
            elif axis.outlying[k] > MOSTLY:
                kind = "deviating"
            elif axis.outlying[k] and self.out[index] and track.kind == GLITCH:
                kind = GLITCH  # its wrong readings are few: they alone moved its mean
        elif index == GYRO and self.stands:
            kind = "frozen"
        elif index >= SERVO and self.out[index] and kind != track.kind:
            if kind == UNNAMED:  # again
                return
            if self.listener is not None:
                self.listener(SENSORS[index], track.state, track.state, kind)
        track.kind = kind

    def fade(self, dt: float) -> None:
        """Let all evidence fade over dt [s]."""
        fade = exp(-dt / SCORE_TIME)
        for track in self.tracks:
            if track.score:
                track.score = track.score * fade if track.score > FORGOTTEN else 0.0

    def advance(self, angles: Pair, dt: float) -> bool:
        """Move every state along `TRANSITIONS`; return whether the gyro was named just now.

        Parameters
        ----------
        angles : of both axes, whose motion proves that a sensor or servo works again [rad]
        """
        gyro = False
        for track in self.tracks:
            if track.score <= ODD_SCORE and track.state is State.OK:
                continue
            angle = angles[track.index // 2 if track.index < GYRO else track.index % 2]
            track.clean = 0.0 if track.score > ODD_SCORE else track.clean + dt
            if track.clean == 0.0:
                track.lowest = track.highest = angle
            track.lowest, track.highest = min(track.lowest, angle), max(track.highest, angle)
            new = TRANSITIONS.get((track.state, track.sign()), track.state)
            if new is track.state:
                continue
            if new is State.FAULTY and track.state not in NAMED:
                track.since = self.time
                gyro = gyro or track.index == GYRO
            self._change(track, new)
        return gyro

    def _change(self, track: Track, new: State) -> None:
        old, track.state = track.state, new
        self.out[track.index] = new in NAMED
        if self.listener is not None:
            self.listener(SENSORS[track.index], old, new, track.kind)
