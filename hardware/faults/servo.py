"""Model of one servo and its linkage: between which angles a healthy one is, and how it fails.

Two limits enclose every healthy servo: one that takes each command at once, and one that takes it
after the longest delay and with the lowest speed. An angle outside of them is evidence. What kind
of fault it is follows from the motion since the two last agreed: of the hypotheses (still,
reversed, the other servo's command) the one whose error is a small part of the healthy one's.
"""

from dataclasses import dataclass, field
from math import degrees, exp, radians

from hardware.frames import AXES, Pair
from hardware.parts import GIMBAL_STOP

WINDOWS = 4  # of which the oldest ones together are the longest delay
QUICK = 0.016  # s; each of two lags of the expected motion
SWING = 0.12  # s; a servo that overshoots comes back with it
NEAR = 0.4  # part of the tolerance within which command and angle agree
EXPLAINED = 0.25  # squared error of a hypothesis, of the healthy one's
CLOSELY = 0.1  # the same where a hypothesis says how far the axis moves
BACK = radians(0.3)  # against the command; a jammed axis moves less, by the other axis's servo
# commanded before an axis that never agreed is judged by its motion, and by its standing still
FIRST, FIRST_STILL = radians(1.0), radians(1.5)
LITTLE = radians(0.5) ** 2 * 0.02  # rad²·s; a smaller error shows nothing
STEADY, STEADY_TIME = radians(0.35), 0.03  # of a constant difference, and its smoothing [s]
RESTS = radians(0.25)  # between the limits of an axis at rest
STILL = radians(0.6)  # that an axis with a jammed servo still moves: play and the other axis
KNOWN = 0.3  # s at rest until the offset of an uncalibrated rig is known
FAST_LEARNING, SLOW_LEARNING = 0.15, 60.0  # s
STANDING = radians(20.0)  # rad/s
AT_STOP = 0.85  # of the stop; a servo that is there without command has run away
# s outside of the limits until a kind is named that is surer with time
CONFIRM, WAIT, CONSTANT, UNDECIDED = 0.03, 0.05, 0.12, 0.18
AT_REST = 2.5  # s outside until an axis is named that has neither agreed nor moved


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
    """

    delay: float = 0.055
    speed: float = radians(80.0)
    lag: float = 0.05
    play: float = radians(1.1)
    overshoot: float = 0.15


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

    @property
    def learned(self) -> bool:
        """Whether the offset is so uncertain that it is taken from the axis at rest."""
        return self.offset > 0.5 * self.play + radians(0.15)


@dataclass(slots=True)
class Motion:
    """Motion of one axis since command and angle last agreed.

    Attributes
    ----------
    angle, other, own_model, other_model, gyro : both axes' angles and expected angles, and the
        integral of the gyro, where it began [rad]
    healthy, still, reversed, swapped, other_healthy, other_swapped : squared errors [rad²·s]
    """

    angle: float = 0.0
    other: float = 0.0
    own_model: float = 0.0
    other_model: float = 0.0
    gyro: float = 0.0
    healthy: float = 0.0
    still: float = 0.0
    reversed: float = 0.0
    swapped: float = 0.0
    other_healthy: float = 0.0
    other_swapped: float = 0.0

    def begin(self, angle: float, other: float, model: Pair) -> None:
        """Start again from here."""
        self.angle, self.other, (self.own_model, self.other_model) = angle, other, model
        self.gyro = self.healthy = self.still = self.reversed = self.swapped = 0.0
        self.other_healthy = self.other_swapped = 0.0

    def add(self, angle: float, other: float, model: Pair, dt: float) -> None:
        """Add a frame's errors of all hypotheses."""
        a, b = angle - self.angle, other - self.other
        m, n = model[0] - self.own_model, model[1] - self.other_model
        self.healthy += (a - m) ** 2 * dt
        self.still += a * a * dt
        self.reversed += (a + m) ** 2 * dt
        self.swapped += (a - n) ** 2 * dt
        self.other_healthy += (b - n) ** 2 * dt
        self.other_swapped += (b - m) ** 2 * dt


@dataclass(slots=True)
class ServoAxis:
    """State of the model of one axis.

    Attributes
    ----------
    command, model, lagging : commanded angle, expected angle and its first lag [rad]
    low, high : angles a healthy servo is between, offset and tolerance aside [rad]
    swing : overshoot that may still be under way [rad]
    least, greatest, window : commands of the latest time windows [rad], and the age of the last [s]
    offset, known : of the angle from the command [rad], and time for which it was learned [s]
    outside : time for which the angle has been out of its limits [s]
    mean, spread : smoothed difference of angle and command, and its deviation [rad]
    agreed : 1 once command and angle have agreed, else 0
    """

    command: float = 0.0
    model: float = 0.0
    lagging: float = 0.0
    low: float = 0.0
    high: float = 0.0
    swing: float = 0.0
    least: list[float] = field(default_factory=lambda: [0.0] * WINDOWS)
    greatest: list[float] = field(default_factory=lambda: [0.0] * WINDOWS)
    window: float = 0.0
    offset: float = 0.0
    known: float = 0.0
    outside: float = 0.0
    mean: float = 0.0
    spread: float = 0.0
    agreed: float = 0.0

    def begin(self, command: float, angle: float) -> None:
        """Start with a servo that may be anywhere between its command and its angle."""
        self.command = self.model = self.lagging = command
        self.low, self.high = min(command, angle), max(command, angle)
        self.least[:] = [self.low] * WINDOWS
        self.greatest[:] = [self.high] * WINDOWS
        self.swing = self.window = self.outside = self.spread = 0.0
        self.agreed = 0.0
        self.mean = angle - command

    def advance(self, command: float, dt: float, limits: ServoLimits) -> None:
        """Move the limits by dt [s] under a command [rad]."""
        command = min(max(command, -GIMBAL_STOP), GIMBAL_STOP)
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
        low, high = min(self.least), max(self.greatest)
        slow = limits.speed * dt
        share = min(1.0, dt / limits.lag)
        self.low = min(low, self.low + min(slow, share * (low - self.low)))
        self.high = max(high, self.high - min(slow, share * (self.high - high)))
        share = min(1.0, dt / QUICK)
        self.lagging += share * (command - self.lagging)
        self.model += share * (self.lagging - self.model)

    def tolerance(self, given: Tolerance, reach: float) -> float:
        """Return by how much the angle may be beyond the limits [rad].

        Parameters
        ----------
        given : of the calibration
        reach : largest angle of both axes now [rad]
        """
        base = given.offset + 0.5 * given.play
        if given.learned and self.known >= KNOWN:
            base = min(base, given.play + radians(0.15))
        return base + given.gain * reach + self.swing

    def excess(self, angle: float, tolerance: float) -> float:
        """Return how far the angle is beyond its limits, signed; 0 within [rad]."""
        e = angle - self.offset
        if e > self.high + tolerance:
            return e - self.high - tolerance
        return min(0.0, e - self.low + tolerance)

    def learn(self, angle: float, dt: float, given: Tolerance) -> None:
        """Follow the offset of an uncalibrated axis while it rests."""
        if not given.learned or self.high - self.low > RESTS:
            return
        self.known += dt
        time = FAST_LEARNING if self.known < 2 * KNOWN else SLOW_LEARNING
        e = angle - 0.5 * (self.low + self.high)
        self.offset += min(1.0, dt / time) * (e - self.offset)
        self.offset = min(max(self.offset, -given.offset), given.offset)

    def smooth(self, angle: float, dt: float) -> None:
        """Update mean and spread of the difference from the command."""
        share = min(1.0, dt / STEADY_TIME)
        away = angle - self.offset - self.model - self.mean
        self.mean += share * away
        self.spread += share * (abs(away) - self.spread)


def name(axis: int, servo: ServoAxis, motion: Motion, angle: float, rate: float) -> str:
    """Return the kind of fault that the motion of an axis shows, "" while it is undecided.

    Parameters
    ----------
    axis : 0 for x, 1 for y
    servo, motion : of this axis
    angle, rate : measured [rad], [rad/s]
    """
    explained = EXPLAINED * motion.healthy
    moved, wanted = angle - motion.angle, servo.model - motion.own_model
    at_stop = abs(angle) > AT_STOP * GIMBAL_STOP
    fresh = not servo.agreed and abs(wanted) < FIRST  # away from the command from the beginning
    if servo.outside < WAIT or (fresh and servo.outside < AT_REST and not at_stop):
        return ""
    if motion.other_swapped < CLOSELY * motion.other_healthy and motion.swapped < explained:
        return f"swapped with {AXES[1 - axis]}"
    back = moved * wanted < -BACK * abs(wanted)
    mirrored = back and not at_stop and abs(moved) < 1.5 * abs(wanted)
    limit = CLOSELY * motion.healthy if servo.agreed else explained
    if mirrored and motion.reversed < min(limit, motion.still):
        return "reversed"
    still = motion.still < explained or (motion.still < motion.healthy and abs(moved) < STILL)
    if still and motion.healthy > LITTLE:
        sure = servo.outside > UNDECIDED if back else abs(wanted) > FIRST_STILL
        if sure or (servo.agreed and not back):
            return f"stuck at {degrees(angle):.1f}°"
    if servo.outside > CONSTANT:
        if at_stop and abs(rate) < STANDING:
            return f"stuck at {degrees(angle):.1f}°"
        if servo.spread < STEADY and (servo.agreed or fresh):
            return f"offset by {degrees(servo.mean):.1f}°"
    return "not following" if servo.outside > UNDECIDED and (servo.agreed or fresh) else ""
