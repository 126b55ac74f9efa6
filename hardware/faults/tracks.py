"""States of all sensors and servos, and their transitions by the evidence on each."""

from collections.abc import Callable
from math import exp

from hardware.faults.axis import FORGOTTEN, MOSTLY, Axis
from hardware.faults.states import (
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
    """

    def __init__(self, listener: Callable[[str, State, State, str], None] | None = None) -> None:
        self.listener = listener
        self.time = 0.0
        self._tracks = tuple(Track(i) for i in range(len(SENSORS)))
        self._axes = (Axis(), Axis())
        self._out = [False] * len(SENSORS)  # which of them are named
        self._stands = False  # the gyro has repeated one reading for too long

    @property
    def healthy(self) -> bool:
        """No sensor or servo is named and no axis is in doubt."""
        return not any(self._out) and all(a.doubtful < DOUBTFUL for a in self._axes)

    @property
    def faults(self) -> tuple[Fault, ...]:
        """The sensors and servos that are named."""
        return tuple(
            Fault(SENSORS[t.index], t.kind, t.since) for t in self._tracks if t.state in NAMED
        )

    @property
    def states(self) -> dict[str, State]:
        """State of every sensor and servo by name."""
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

    def _is_frozen(self) -> bool:
        gyro = self._tracks[GYRO]
        return gyro.state is State.FAULTY and gyro.kind == "frozen"

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
        elif index >= SERVO and self._out[index] and kind != track.kind:
            if kind == UNNAMED:  # again
                return
            if self.listener is not None:
                self.listener(SENSORS[index], track.state, track.state, kind)
        track.kind = kind

    def _fade(self, dt: float) -> None:
        """Let all evidence fade over dt [s]."""
        fade = exp(-dt / SCORE_TIME)
        for track in self._tracks:
            if track.score:
                track.score = track.score * fade if track.score > FORGOTTEN else 0.0

    def _advance(self, angles: Pair, dt: float) -> bool:
        """Move every state along `TRANSITIONS`; return whether the gyro was named just now.

        Parameters
        ----------
        angles : of both axes, whose motion proves that a sensor or servo works again [rad]
        """
        gyro = False
        for track in self._tracks:
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
        self._out[track.index] = new in NAMED
        if self.listener is not None:
            self.listener(SENSORS[track.index], old, new, track.kind)
