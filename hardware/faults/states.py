"""Health of a sensor: from evidence to state, by a transition table."""

from dataclasses import dataclass
from enum import StrEnum
from math import radians

from hardware.frames import PAIR_NAMES, POTENTIOMETER_NAMES, SERVO_NAMES

SENSORS = (
    *POTENTIOMETER_NAMES,
    "gyro",
    "supply",
    *PAIR_NAMES,
    *SERVO_NAMES,
)
GYRO, SUPPLY = len(POTENTIOMETER_NAMES), len(POTENTIOMETER_NAMES) + 1
PAIR, SERVO = SUPPLY + 1, SUPPLY + 1 + len(PAIR_NAMES)  # of x; that of y is the next
GLITCH = "glitch"  # kind of a potentiometer's fault until its readings show another
UNNAMED = "not following"  # kind of a servo's fault until, or if, its motion does not show another

ODD_SCORE, BAD_SCORE = 0.05, 1.0
SCORE_TIME = 0.1  # s; evidence fades with it
CLEAN_TIME = 2.0  # s without evidence before a sensor is trusted again
PROOF = radians(1.0)  # motion a potentiometer or servo must have followed to be trusted again


class State(StrEnum):
    """Health of one sensor or servo."""

    OK = "ok"
    SUSPECT = "suspect"
    FAULTY = "faulty"
    RECOVERING = "recovering"


class Sign(StrEnum):
    """Verdict of a frame's evidence on one sensor."""

    CLEAN = "clean"
    ODD = "odd"
    BAD = "bad"
    PROVEN = "proven"  # clean for `CLEAN_TIME` and, but for gyro and supply, moved with the gimbal


# A missing pair leaves the state unchanged.
TRANSITIONS: dict[tuple[State, Sign], State] = {
    (State.OK, Sign.ODD): State.SUSPECT,
    (State.OK, Sign.BAD): State.FAULTY,
    (State.SUSPECT, Sign.CLEAN): State.OK,
    (State.SUSPECT, Sign.BAD): State.FAULTY,
    (State.SUSPECT, Sign.PROVEN): State.OK,
    (State.FAULTY, Sign.CLEAN): State.RECOVERING,
    (State.RECOVERING, Sign.ODD): State.FAULTY,
    (State.RECOVERING, Sign.BAD): State.FAULTY,
    (State.RECOVERING, Sign.PROVEN): State.OK,
}
NAMED = (State.FAULTY, State.RECOVERING)


@dataclass(frozen=True, slots=True)
class Fault:
    """A sensor or servo that was named as wrong.

    Attributes
    ----------
    sensor : one of `SENSORS`
    kind : of a sensor glitch, open, deviating, frozen, bias or sag; of a servo not following,
        reversed, swapped with y, stuck at 3.1° or offset by 4.0°
    since : time of the monitor at which it was named [s]
    """

    sensor: str
    kind: str
    since: float


@dataclass(slots=True)
class Track:
    """Evidence on one sensor or servo and the state that follows from it."""

    index: int
    state: State = State.OK
    score: float = 0.0
    kind: str = ""
    since: float = 0.0
    clean: float = 0.0
    lowest: float = 0.0
    highest: float = 0.0

    def sign(self) -> Sign:
        """Return the verdict of the present evidence."""
        if self.score >= BAD_SCORE:
            return Sign.BAD
        if self.score > ODD_SCORE:
            return Sign.ODD
        moved = self.index in (GYRO, SUPPLY) or self.highest - self.lowest >= PROOF
        return Sign.PROVEN if self.clean >= CLEAN_TIME and moved else Sign.CLEAN
