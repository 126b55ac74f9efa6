"""Whether the servos obey: commanded angles against measured ones, through limits of a servo."""

from collections.abc import Mapping
from dataclasses import asdict
from math import degrees, radians
from typing import Any

from hardware.faults.memory import filled, number
from hardware.faults.motion import HEALTHY, SIGMA, STILL, Motion
from hardware.faults.servo import ServoAxis, ServoLimits, Tolerance
from hardware.faults.states import UNNAMED
from hardware.frames import AXES, Pair
from hardware.parts import GIMBAL_STOP

MISREAD = "misread"  # kind of an axis whose potentiometers are wrong, not its servo
NEAR = 0.4  # part of the tolerance within which command and angle agree
FADING = 0.25  # s; of the motion before a fault
CONFIRM = 0.03  # s outside of the limits until an axis is at fault
NAMING = 0.3  # s from then on until its kind is named
AGREED = 0.05  # s; a servo that has agreed for a shorter time was away from its command all along
FIRST = radians(1.0)  # commanded before such a servo is at fault,
WAIT, WAIT_FOR_OTHER = 0.2, 0.27  # s since then, and since the other axis was
AT_REST = 2.5  # s outside without a command
FAR = radians(2.0)  # outside, that needs no wait
TAKEN = radians(0.7)  # moved along with the other axis
AT_STOP = 0.85  # of the stop; a servo that is there without command has run away
MOVED = radians(1.2)  # expected motion that tells a constant offset from standing still
JUMP = radians(80.0)  # rad/s faster than expected; a servo that jams or loses power is not
MARGIN = radians(0.3)  # of the gyro's integral from the measured angle
LATE = 0.012  # s; delays of gyro and command
COUPLED = 0.1  # of the other axis's error, moved by linkage and play
NOMINAL = Tolerance(0.0, 0.0, ServoLimits().play)
Flags4 = tuple[bool, bool, bool, bool]


class Actuation:
    """Compares both axes with the servos' limits, frame by frame.

    An axis at fault is `not following` at once; what its motion before and 0.3 s after shows is
    its kind from then on.

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
        self.before = (Motion(), Motion())  # since command and angle last agreed
        self.after = (Motion(), Motion())  # since the fault
        self.kinds = ["", ""]
        self.naming = [0.0, 0.0]  # s until a fault has its final name
        self.driven = False

    def begin(self) -> None:
        """Start again with the next command."""
        self.driven = False
        self.kinds[:] = "", ""

    def advance(
        self,
        command: Pair | None,
        angle: Pair,
        dt: float,
        carried: Pair = (0.0, 0.0),
        turn: float = 0.0,
    ) -> None:
        """Move the limits of both servos by a frame.

        Parameters
        ----------
        command : angles of the pulse widths in force; None while the servos are not driven [rad]
        angle : measured [rad]
        dt : time since the previous frame [s]
        carried, turn : rates of the base about both axes [rad/s], and its turn about x [rad]
        """
        if command is None:
            self.begin()
        elif not self.driven:
            self.driven = True
            for k, servo in enumerate(self.axes):
                servo.begin(command[k], angle[k], self.tolerance[k])
                servo.carried = carried[k]
            for k in (0, 1):
                self._anchor(self.before[k], k, angle)
        else:
            for k, servo in enumerate(self.axes):
                servo.advance(command[k], dt, self.limits)
                if any(carried):
                    servo.carry(carried[k], 0.0 if k else turn, dt, self.limits)

    def excess(self, k: int, angle: float) -> float:
        """Return how far an angle of axis `k` is beyond what its servo may do, 0 within [rad]."""
        return self.axes[k].excess(angle, self._tolerance(k)) if self.driven else 0.0

    def _tolerance(self, k: int) -> float:
        x, y = self.axes
        reach = max(x.high, -x.low, y.high, -y.low)
        return self.axes[k].tolerance(self.tolerance[k], reach)

    def inspect(
        self, angle: Pair, rate: Pair, turned: Pair | None, dt: float, switches: Flags4
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
        for k, servo in enumerate(self.axes):
            tolerance = self._tolerance(k)
            if self.kinds[1 - k]:
                tolerance += COUPLED * abs(angle[1 - k] - self.axes[1 - k].model)
            excess = servo.excess(angle[k], tolerance)
            held = (excess < 0 and switches[2 * k]) or (excess > 0 and switches[2 * k + 1])
            if excess and not held:
                servo.outside += dt
            else:
                servo.outside = max(0.0, servo.outside - dt)
                servo.narrow(angle[k], tolerance, dt, self.tolerance[k])
            if servo.agreed < AGREED:
                if servo.displaced or servo.outside > CONFIRM:
                    servo.displaced += dt
                if servo.moving or servo.moved > FIRST:
                    servo.moving += dt
            self._follow(k, angle, rate[k], turned, tolerance, dt)
            if self.kinds[k]:
                self._name(k, angle, rate[k], turned, dt)
            elif self._due(k, excess, angle[k]):
                self.kinds[k], self.naming[k] = UNNAMED, NAMING
                self._anchor(self.after[k], k, angle)
                if turned is not None and self._misread(k, angle[k], rate[k]):
                    self.kinds[k] = MISREAD

    def _follow(
        self, k: int, angle: Pair, rate: float, turned: Pair | None, tolerance: float, dt: float
    ) -> None:
        """Add a frame to the motion of an axis, or start it again where command and angle agree."""
        servo, other = self.axes[k], self.axes[1 - k]
        speed = max(abs(servo.speed), abs(other.speed))
        away = abs(angle[k] - servo.offset - servo.model) - LATE * speed
        near = away < NEAR * tolerance
        if near and not servo.displaced and abs(servo.command - servo.first) > FIRST:
            servo.agreed += dt
        began = servo.moving or other.moving or servo.outside
        resting = servo.agreed < AGREED and not began and servo.rests and other.rests
        if not self.kinds[k] and (near or resting):
            self._anchor(self.before[k], k, angle)
            return
        pair, model = (angle[k], angle[1 - k]), (servo.model, other.model)
        for motion in (self.before[k], self.after[k]) if self.kinds[k] else (self.before[k],):
            motion.add(pair, model, rate, speed, dt, FADING if not self.kinds[k] else 0.0)
            if turned is not None:
                motion.gyro += turned[k]

    def _due(self, k: int, excess: float, angle: float) -> bool:
        """Return whether an axis is at fault now."""
        servo = self.axes[k]
        if not servo.displaced:
            return excess != 0.0 and servo.outside > CONFIRM
        far = servo.moving > CONFIRM and abs(excess) > FAR
        taken = abs(angle - self.before[k].start[0]) > TAKEN
        by_other = taken and self.axes[1 - k].moving > WAIT_FOR_OTHER
        return far or by_other or servo.moving > WAIT or servo.displaced > AT_REST

    def _misread(self, k: int, angle: float, rate: float) -> bool:
        """Return whether the gyro moved with the command and against the measured angle."""
        motion = self.before[k]
        apart = abs(motion.gyro - (angle - motion.start[0])) - MARGIN - LATE * abs(rate)
        return abs(motion.gyro - (self.axes[k].model - motion.start[2])) < apart

    def _anchor(self, motion: Motion, k: int, angle: Pair) -> None:
        model = self.axes[k].model, self.axes[1 - k].model
        motion.begin((angle[k], angle[1 - k]), model)

    def _name(self, k: int, angle: Pair, rate: float, turned: Pair | None, dt: float) -> None:
        """Name the fault of an axis when its time has come, and forget it once it is gone."""
        if self.naming[k] > 0.0:
            self.naming[k] -= dt
            if turned is not None and self._misread(k, angle[k], rate):
                self.kinds[k] = MISREAD
            elif self.naming[k] <= 0.0 and self.kinds[k] == UNNAMED:
                self.kinds[k] = self._kind(k, angle[k])
        elif not self.axes[k].outside:
            self.kinds[k] = ""

    def _kind(self, k: int, angle: float) -> str:
        """Return the kind of a fault by all that was seen of it."""
        before, after = self.before[k], self.after[k]
        stuck = f"stuck at {degrees(angle):.1f}°"
        if abs(angle) > AT_STOP * GIMBAL_STOP > abs(self.axes[k].command):
            return stuck
        jumped = before.jump > JUMP
        if not jumped and (kind := before.likeliest()) is not None:
            return (stuck, "reversed", f"swapped with {AXES[1 - k]}")[kind]
        if after.highest - after.lowest > MOVED:
            still = SIGMA[STILL] ** 2 if jumped else after.error(HEALTHY)
            jumped = after.error(STILL) > still
        if not after.explained(HEALTHY if jumped else STILL):
            return UNNAMED
        return self._offset(k) if jumped else stuck

    def _offset(self, k: int) -> str:
        after = self.after[k]
        mean = after.start[0] - after.start[2] + after.sums[HEALTHY] / after.time
        return f"offset by {degrees(mean):.1f}°"

    def snapshot(self) -> dict[str, object]:
        """Return the whole state, as JSON values."""
        return {
            "driven": self.driven,
            "kinds": list(self.kinds),
            "naming": list(self.naming),
            "servos": [asdict(servo) for servo in self.axes],
            "before": [asdict(motion) for motion in self.before],
            "after": [asdict(motion) for motion in self.after],
        }

    def restore(self, memory: Mapping[str, Any]) -> None:
        """Restore the state from a `snapshot`.

        Raises
        ------
        KeyError, TypeError, ValueError : it is not a snapshot
        """
        # Recordings of earlier versions hold no loads.
        loads = {"load": 0.0, "carried": 0.0}
        x, y = (filled(ServoAxis, {**loads, **values}) for values in memory["servos"])
        u, v = (filled(Motion, values) for values in memory["before"])
        s, t = (filled(Motion, values) for values in memory["after"])
        a, b = memory["kinds"]
        if not (isinstance(a, str) and isinstance(b, str) and isinstance(memory["driven"], bool)):
            raise TypeError("not a state of the servos")
        c, d = (number(value) for value in memory["naming"])
        self.axes, self.before, self.after = (x, y), (u, v), (s, t)
        self.kinds, self.naming, self.driven = [a, b], [c, d], memory["driven"]
