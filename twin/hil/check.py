"""Motion check before a run: small commands to each axis, and whether the right one follows."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import degrees, radians

from hardware.events import Event
from hardware.faults import Fault
from hardware.frames import (
    AXES,
    POTENTIOMETER_NAMES,
    SERVO_NAMES,
    GimbalCommand,
    HardwareError,
    Pair,
)
from hardware.rig.rig import TIMEOUT_MS
from twin.errors import CheckError
from twin.hil.gimbal import COMMAND_NS, RigGimbal

AMPLITUDE = radians(2.0)
STEPS: tuple[Pair, ...] = ((1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0))  # of the amplitude
HOLD_NS, SAMPLE_NS = 320_000_000, 80_000_000  # at each step, and the last part of it that counts
FEWEST = 5  # frames of a sample
LATE_NS = TIMEOUT_MS * 1_000_000  # without a command for as long, a rig's servos go to neutral
# Of the commanded motion of 4°: a play of 1.1° leaves 0.72; half a gain leaves 0.65 at most, where
# the motor's weight moves the gimbal outwards through its play; double gives at least 1.7.
DEAD, SMALLEST, LARGEST = 0.25, 0.7, 1.4
CROSS = 0.35  # of the other axis
SPREAD = radians(0.3)  # of the middle between two steps: weight of the motor, noise

Response = tuple[Pair, Pair]
ABSENT = (
    "check the 5 V of the potentiometers; a rig without them needs the --calibration that"
    " twin calibrate --minimal writes"
)
HELP = "check plugs, power, horns and --calibration, or give --no-check"


@dataclass(frozen=True)
class MotionChecked(Event):
    """The motion check before the run.

    Attributes
    ----------
    response : motion of each axis per commanded motion [1]; None where it was skipped
    """

    response: Pair | None

    @property
    def text(self) -> str:
        """Motion of both axes per command."""
        if self.response is None:
            return "motion check skipped as requested"
        x, y = self.response
        return f"motion check: x moved {x:.2f} and y {y:.2f} times the commanded ±2°"


def check_motion(seat: RigGimbal) -> None:
    """Move both axes by ±2° one after the other and compare; blocks for 1.6 s.

    Raises
    ------
    CheckError : an axis does not move, or not as commanded; in one line
    HardwareError : no readings come
    """
    held = [_held(seat, (AMPLITUDE * u, AMPLITUDE * v)) for u, v in (*STEPS, (0.0, 0.0))]
    late = max(late for _, late in held)
    a, b, c, d = (angle for angle, _ in held[: len(STEPS)])
    across = 2.0 * AMPLITUDE
    response = (
        ((a[0] - b[0]) / across, (c[0] - d[0]) / across),
        ((a[1] - b[1]) / across, (c[1] - d[1]) / across),
    )
    named = seat.rig.fusion.monitor.faults
    gain = max(t.gain for t in seat.rig.fusion.monitor.actuation.tolerance)
    problem = wrong_motion(response, gain) or _displaced(seat, a, b, c, d)
    sensors = [f for f in named if f.sensor not in SERVO_NAMES]
    if problem and not sensors and late > LATE_NS:  # what moved says nothing about plugs and horns
        raise _too_late(late)
    if not problem or sensors:  # what a faulty sensor shows says nothing about a servo
        counted = sensors if problem else [f for f in named if f.sensor in SERVO_NAMES]
        problem = ", ".join(f"{f.sensor} {f.kind}" for f in counted)
    if problem:
        raise CheckError(f"motion check: {problem}; {remedy(named)}")
    seat.notices.append(MotionChecked((response[0][0], response[1][1])))


def remedy(named: Sequence[Fault]) -> str:
    """Return what to do about a failed check, by the faults that are named."""
    absent = sum(f.kind == "open" and f.sensor in POTENTIOMETER_NAMES for f in named)
    return HELP if absent < len(POTENTIOMETER_NAMES) else ABSENT


def wrong_motion(response: Response, gain: float = 0.0) -> str:
    """Return what is wrong with a response, in one line; "" if nothing is.

    Parameters
    ----------
    response : motion of x, then of y, per commanded motion of x and y [1]
    gain : uncertainty of the commanded motion, 3 σ [1]
    """
    (xx, xy), (yx, yy) = response
    if max(abs(xx), abs(yy)) < SMALLEST / 2 < min(abs(xy), abs(yx)):
        return "servos swapped: x moves with the command of y, and y with that of x"
    commanded = degrees(2.0 * AMPLITUDE)
    for k, own in enumerate((xx, yy)):
        moved = f"{AXES[k]} moved by {own * commanded:.1f}° for {commanded:.0f}° commanded"
        if abs(own) < DEAD:
            return f"{SERVO_NAMES[k]} not following: {moved}"
        if own < 0.0:
            return f"{SERVO_NAMES[k]} reversed: {moved}"
        if not SMALLEST * (1.0 - gain) <= own <= LARGEST:
            return f"{SERVO_NAMES[k]} moves by the wrong angle: {moved}"
    for k, other in enumerate((xy, yx)):
        if abs(other) > CROSS:
            return f"{AXES[k]} moves by {other:.2f} of the command of {AXES[1 - k]}"
    return ""


def _displaced(seat: RigGimbal, a: Pair, b: Pair, c: Pair, d: Pair) -> str:
    """Return which axis does not stand where it is commanded to, as far as it is calibrated."""
    actuation = seat.rig.fusion.monitor.actuation
    middles = (0.5 * (a[0] + b[0]), 0.5 * (c[1] + d[1]))
    for k, middle in enumerate(middles):
        tolerance = actuation.tolerance[k]
        if abs(middle) > tolerance.offset + 0.5 * tolerance.play + SPREAD:
            return f"{SERVO_NAMES[k]} offset by {degrees(middle):.1f}°"
    return ""


def _held(seat: RigGimbal, angle: Pair) -> tuple[Pair, int]:
    """Mean angles at the end of a command [rad], and how late readings came at worst [ns]."""
    begin, x, y, count, late = seat.now_ns(), 0.0, 0.0, 0, 0
    newest = begin
    while (now := seat.now_ns()) - begin < HOLD_NS:
        seat.rig.send(GimbalCommand(now, angle), seat.turntable)
        seat.wait(COMMAND_NS)
        seat.rig.poll()
        newest = max([newest, *(state.time_ns for state in seat.rig.states)])
        polled = seat.now_ns()
        late = max(late, polled - now, polled - newest)
        if now - begin > HOLD_NS - SAMPLE_NS:
            for state in seat.rig.states:
                x, y, count = x + state.angle[0], y + state.angle[1], count + 1
    if count < FEWEST:
        if newest > begin and late > LATE_NS:
            raise _too_late(late)
        raise HardwareError(
            "the rig sends no readings during the motion check; check its sensors and supply"
        )
    return (x / count, y / count), late


def _too_late(late: int) -> CheckError:
    return CheckError(
        f"motion check: readings came up to {late * 1e-6:.0f} ms late; this computer is too busy"
        " for a rig in real time: stop other programs and try again"
    )
