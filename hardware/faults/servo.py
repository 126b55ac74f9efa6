"""Model of one servo and its linkage: between which angles a healthy one is.

Two limits enclose every healthy servo: one that takes each command at once, and one that takes it
after the longest delay and with the lowest speed. Play and calibration add to them an offset that
is constant, so that every frame narrows the interval it may be in. An angle that no such offset
explains is evidence against the servo.
"""

from dataclasses import dataclass, field
from math import exp, radians, sin

from hardware.parts import GIMBAL_STOP

WINDOWS = 4  # of which the oldest ones together are the longest delay
QUICK = 0.016  # s; each of two lags of the expected motion
SWING = 0.12  # s; a servo that overshoots comes back with it
NARROWING = 0.03  # s; with which a frame narrows the interval of the offset
RELAXING = radians(0.05)  # rad/s; with which the interval widens again
BEGINNING = 0.15  # s; servos go from neutral to their first command
STEADY = radians(0.02)  # of a command that does not move
NARROWEST = radians(0.3)  # of the interval: noise of the angle, and waviness of the potentiometers


@dataclass(frozen=True, slots=True)
class ServoLimits:
    """Limits of healthy servos, as angles of the gimbal.

    The defaults hold for hobby servos behind the shipped linkage: 9 g ones turn 0.10 s/60° (267°/s
    of the gimbal) and act within 10 to 35 ms of a new pulse; a strong and slow one 281°/s (125°/s).

    Attributes
    ----------
    delay : longest, from the start of a pulse [s]
    speed, lag : lowest speed [rad/s], and longest time constant close to the command [s]
    play : full width of backlash and dead band [rad]
    overshoot : of a change of the command [1]
    compliance, weight : of the shipped motor on a base that turns: gimbal angle per angular
        acceleration of the base [s²], and by the motor's weight on its side [rad]. Inertia about
        the pivot 1.8e-3 kg·m², weight 0.14 N·m; a servo's 1.8 N·m/rad are 9.1 at the gimbal, half
        of that with all tolerances
    """

    delay: float = 0.055
    speed: float = radians(80.0)
    lag: float = 0.05
    play: float = radians(1.1)
    overshoot: float = 0.15
    compliance: float = 4e-4
    weight: float = radians(1.8)


@dataclass(frozen=True, slots=True)
class Tolerance:
    """What a calibration leaves open on one axis.

    Attributes
    ----------
    offset : of the angle at zero, 3 σ [rad]
    gain : of the angle per commanded angle of both axes, 3 σ [1]
    play : as in `ServoLimits` [rad]
    """

    offset: float
    gain: float
    play: float


@dataclass(slots=True)
class ServoAxis:
    """State of the model of one axis.

    Attributes
    ----------
    command, model, lagging : commanded angle, expected angle and its first lag [rad]
    low, high : angles a healthy servo is between, offset and tolerance aside [rad]
    swing : overshoot that may still be under way [rad]
    load : deflection by the load of a base that turns, which may still be under way [rad]
    carried : rate of the base about this axis [rad/s]
    stood, first : command at rest, before the present motion, and when first driven [rad]
    age : time since then [s]
    least, greatest, window : commands of the latest time windows [rad], and the age of the last [s]
    lowest, highest : between which the offset of the angle is [rad]
    outside : time for which no offset has explained the angle [s]
    agreed : time for which command and angle have agreed away from the first command [s]
    displaced, moving : without having agreed, time since it was outside, and since its command has
        moved by a degree [s]
    """

    command: float = 0.0
    model: float = 0.0
    lagging: float = 0.0
    low: float = 0.0
    high: float = 0.0
    swing: float = 0.0
    load: float = 0.0
    carried: float = 0.0
    stood: float = 0.0
    first: float = 0.0
    age: float = 0.0
    least: list[float] = field(default_factory=lambda: [0.0] * WINDOWS)
    greatest: list[float] = field(default_factory=lambda: [0.0] * WINDOWS)
    window: float = 0.0
    lowest: float = 0.0
    highest: float = 0.0
    outside: float = 0.0
    agreed: float = 0.0
    displaced: float = 0.0
    moving: float = 0.0

    @property
    def speed(self) -> float:
        """Rate of the expected angle [rad/s]."""
        return (self.lagging - self.model) / QUICK

    @property
    def rests(self) -> bool:
        """Whether the command has not changed within the longest delay."""
        return max(self.greatest) - min(self.least) < STEADY

    @property
    def moved(self) -> float:
        """How far the command has moved within the longest delay from where it stood [rad]."""
        return abs(self.command - self.stood)

    @property
    def offset(self) -> float:
        """Middle of the interval of the offset [rad]."""
        return 0.5 * (self.lowest + self.highest)

    def begin(self, command: float, angle: float, given: Tolerance) -> None:
        """Start with a servo that may be anywhere between its command and its angle."""
        self.command = self.model = self.lagging = command
        self.stood = self.first = command
        self.low, self.high = min(command, angle), max(command, angle)
        self.least[:] = [self.low] * WINDOWS
        self.greatest[:] = [self.high] * WINDOWS
        self.lowest, self.highest = -given.offset, given.offset
        self.swing = self.load = self.carried = self.window = self.outside = self.age = 0.0
        self.agreed = self.displaced = self.moving = 0.0

    def advance(self, command: float, dt: float, limits: ServoLimits) -> None:
        """Move the limits by dt [s] under a command [rad]."""
        command = min(max(command, -GIMBAL_STOP), GIMBAL_STOP)
        self.age += dt
        if self.age < BEGINNING:
            self.first = command
        if command != self.command:
            self.swing += limits.overshoot * abs(command - self.command)
            self.command = command
        if self.swing:
            self.swing = self.swing * exp(-dt / SWING) if self.swing > 1e-6 else 0.0
        self.window += dt
        if self.window * (WINDOWS - 1) > limits.delay:
            self.window = 0.0
            self.least[:] = (*self.least[1:], command)
            self.greatest[:] = (*self.greatest[1:], command)
        self.least[-1] = min(self.least[-1], command)
        self.greatest[-1] = max(self.greatest[-1], command)
        if self.rests or self.age < BEGINNING:
            self.stood = command
        low, high = min(self.least), max(self.greatest)
        slow = limits.speed * dt
        share = min(1.0, dt / limits.lag)
        self.low = min(low, self.low + min(slow, share * (low - self.low)))
        self.high = max(high, self.high - min(slow, share * (self.high - high)))
        share = min(1.0, dt / QUICK)
        self.lagging += share * (command - self.lagging)
        self.model += share * (self.lagging - self.model)

    def carry(self, rate: float, turn: float, dt: float, limits: ServoLimits) -> None:
        """Take into account that the base turns at a rate [rad/s] and stands at a turn [rad]."""
        load = limits.compliance * abs(rate - self.carried) / dt + limits.weight * abs(sin(turn))
        self.load, self.carried = max(load, self.load * exp(-dt / SWING)), rate

    def tolerance(self, given: Tolerance, reach: float) -> float:
        """Return by how much the angle may be beyond limits and offset [rad].

        Parameters
        ----------
        given : of the calibration
        reach : largest angle of both axes now [rad]
        """
        return 0.5 * given.play + given.gain * reach + self.swing + self.load

    def excess(self, angle: float, tolerance: float) -> float:
        """Return how far the angle is beyond its limits, signed; 0 within [rad]."""
        over = angle - self.high - tolerance - self.highest
        return over if over > 0 else min(0.0, angle - self.low + tolerance - self.lowest)

    def narrow(self, angle: float, tolerance: float, dt: float, given: Tolerance) -> None:
        """Take from the offset's interval what an angle within its limits excludes."""
        share, relaxed = min(1.0, dt / NARROWING), RELAXING * dt
        low = max(angle - self.high - tolerance - self.lowest, 0.0)
        high = min(angle - self.low + tolerance - self.highest, 0.0)
        lowest, highest = self.lowest, self.highest
        self.lowest = min(lowest + share * low, highest - NARROWEST) if low else lowest - relaxed
        self.highest = (
            max(highest + share * high, lowest + NARROWEST) if high else highest + relaxed
        )
        self.lowest = max(-given.offset, self.lowest)
        self.highest = min(given.offset, self.highest)
