"""Whether the servos obey: commanded angles against measured ones, through limits of a servo."""

from collections.abc import Mapping
from dataclasses import asdict
from math import radians
from typing import Any

from hardware.faults.memory import filled
from hardware.faults.servo import (
    CONFIRM,
    NEAR,
    Motion,
    ServoAxis,
    ServoLimits,
    Tolerance,
    name,
)
from hardware.frames import Pair

MISREAD = "misread"  # kind of an axis whose potentiometers are wrong, not its servo
RANKS = ("not", "offset", "stuck", "reversed", "swapped", MISREAD)
MARGIN = radians(0.6)  # of the gyro's integral from the measured angle
LATE = 0.012  # s; delays of gyro and command
NOMINAL = Tolerance(0.0, 0.0, ServoLimits().play)


class Actuation:
    """Compares both axes with the servos' limits, frame by frame.

    Parameters
    ----------
    tolerance : what the calibration leaves open, per axis
    limits : of the servos
    """

    def __init__(
        self,
        tolerance: tuple[Tolerance, Tolerance] = (NOMINAL, NOMINAL),
        limits: ServoLimits | None = None,
    ) -> None:
        self.limits, self.tolerance = limits or ServoLimits(), tolerance
        self.axes = (ServoAxis(), ServoAxis())
        self.motion = (Motion(), Motion())
        self.kinds = ["", ""]
        self.driven = False

    def begin(self) -> None:
        """Start again with the next command."""
        self.driven = False
        self.kinds[:] = "", ""

    def advance(self, command: Pair | None, angle: Pair, dt: float) -> None:
        """Move the limits of both servos by a frame.

        Parameters
        ----------
        command : angles of the pulse widths in force; None while the servos are not driven [rad]
        angle : measured [rad]
        dt : time since the previous frame [s]
        """
        if command is None:
            self.begin()
        elif not self.driven:
            self.driven = True
            for k, servo in enumerate(self.axes):
                servo.begin(command[k], angle[k])
            self._anchor(0, angle)
            self._anchor(1, angle)
        else:
            for k, servo in enumerate(self.axes):
                servo.advance(command[k], dt, self.limits)

    def excess(self, k: int, angle: float) -> float:
        """Return how far an angle of axis `k` is beyond what its servo may do, 0 within [rad]."""
        servo = self.axes[k]
        return servo.excess(angle, self._tolerance(k)) if self.driven else 0.0

    def _tolerance(self, k: int) -> float:
        x, y = self.axes
        reach = max(x.high, -x.low, y.high, -y.low)
        return self.axes[k].tolerance(self.tolerance[k], reach)

    def inspect(
        self,
        angle: Pair,
        rate: Pair,
        turned: Pair | None,
        dt: float,
        switches: tuple[bool, bool, bool, bool],
    ) -> None:
        """Judge both axes; `kinds` then holds the fault of each, "" without one.

        Parameters
        ----------
        angle, rate : measured [rad], [rad/s]
        turned : by the gyro since the previous frame; None where it is wrong [rad]
        dt : time since then [s]
        switches : closed limit switches +x, −x, +y, −y
        """
        if not self.driven:
            return
        for k, (servo, motion) in enumerate(zip(self.axes, self.motion, strict=True)):
            a, b = angle[k], angle[1 - k]
            tolerance = self._tolerance(k)
            excess = servo.excess(a, tolerance)
            held = (excess < 0 and switches[2 * k]) or (excess > 0 and switches[2 * k + 1])
            if turned is not None:
                motion.gyro += turned[k]
            servo.smooth(a, dt)
            if excess and not held:
                servo.outside += dt
            else:
                servo.outside = max(0.0, servo.outside - dt)
                if not servo.outside:
                    self.kinds[k] = ""
                servo.learn(a, dt, self.tolerance[k])
            model = servo.model, self.axes[1 - k].model
            if abs(a - servo.offset - servo.model) < NEAR * tolerance:
                servo.agreed = 1.0
                self._anchor(k, angle)
            else:
                motion.add(a, b, model, dt)
            if servo.outside > CONFIRM and excess:
                if turned is not None and self._misread(k, a, rate[k]):
                    self.kinds[k] = MISREAD
                else:
                    self._decide(k, angle, rate[k])

    def _misread(self, k: int, angle: float, rate: float) -> bool:
        """Return whether the gyro moved with the command and against the measured angle."""
        motion = self.motion[k]
        apart = abs(motion.gyro - (angle - motion.angle)) - MARGIN - LATE * abs(rate)
        return abs(motion.gyro - (self.axes[k].model - motion.own_model)) < apart

    def _anchor(self, k: int, angle: Pair) -> None:
        model = self.axes[k].model, self.axes[1 - k].model
        self.motion[k].begin(angle[k], angle[1 - k], model)

    def _decide(self, k: int, angle: Pair, rate: float) -> None:
        """Name the fault; a vague name gives way to a better one."""
        new = name(k, self.axes[k], self.motion[k], angle[k], rate)
        if new and _rank(new) > _rank(self.kinds[k]):
            self.kinds[k] = new
            if new.startswith("offset"):  # the jump says nothing about what follows
                self._anchor(k, angle)

    def snapshot(self) -> dict[str, object]:
        """Return the whole state, as JSON values."""
        return {
            "driven": self.driven,
            "kinds": list(self.kinds),
            "servos": [asdict(servo) for servo in self.axes],
            "motion": [asdict(motion) for motion in self.motion],
        }

    def restore(self, memory: Mapping[str, Any]) -> None:
        """Restore the state from a `snapshot`.

        Raises
        ------
        KeyError, TypeError, ValueError : it is not a snapshot
        """
        x, y = (filled(ServoAxis, values) for values in memory["servos"])
        u, v = (filled(Motion, values) for values in memory["motion"])
        a, b = memory["kinds"]
        if not (isinstance(a, str) and isinstance(b, str) and isinstance(memory["driven"], bool)):
            raise TypeError("not a state of the servos")
        self.axes, self.motion, self.kinds = (x, y), (u, v), [a, b]
        self.driven = memory["driven"]


def _rank(kind: str) -> int:
    """How much a kind says; none is −1."""
    return RANKS.index(kind.split()[0]) if kind else -1
