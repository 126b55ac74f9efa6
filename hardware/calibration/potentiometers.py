"""Whether the potentiometers of a calibration run are wired, turn, and stay on their tracks."""

from math import degrees, radians, sqrt

import numpy as np

from hardware.calibration.axis import KA, KB, OA, OB, Array, events_of
from hardware.calibration.errors import CalibrationError
from hardware.calibration.log import SWITCHES, CalibrationRig, Log
from hardware.frames import POTENTIOMETER_NAMES
from hardware.parts import RAIL

TURN = 0.8, 1.25  # of the angle between the switches, by the stated track; tracks are sold to 5 %
LARGEST_JUMP = radians(1.0)  # between approaches of a switch, at rest; play and step leave 0.2°
LARGEST_BEND = radians(0.4)  # of two straight lines between the switches; waviness leaves 0.1°
NEAR_END = 0.1  # of the track
AT_END = (
    "the end of its track is reached; turn its body on the shaft until it reads about 0.5 at zero"
)


def check_readings(log: Log, rig: CalibrationRig) -> None:
    """Refuse potentiometers that are at the end of their track at a switch, or lose contact.

    Raises
    ------
    CalibrationError : the message names the potentiometer
    """
    jumps = [_jump(log, rig, index) for index in range(len(POTENTIOMETER_NAMES))]
    for index, name in enumerate(POTENTIOMETER_NAMES):
        ends, jump = [], jumps[index]
        for switch in (index // 2 * 2, index // 2 * 2 + 1):
            events = [e for e in log.events if e.switch == switch]
            for closed in (True, False):
                seen = [e.potentiometer[index] for e in events if e.closed is closed]
                ends.append((switch, max(seen) > 1 - RAIL or min(seen) < RAIL, np.mean(seen)))
        if all(railed for _, railed, _ in ends) and jump < LARGEST_JUMP:
            end = "ground" if ends[0][2] < 0.5 else "the supply"
            raise CalibrationError(f"{name} reads {end} at both switches; it is not wired")
        if jump > LARGEST_JUMP and jumps[index ^ 1] < 0.5 * jump:  # both jump with a loose switch
            raise CalibrationError(
                f"{name} jumps by {degrees(jump):.1f}° between approaches of the same switch; a"
                " wire is loose, or its shaft slips"
            )
        for switch, railed, fraction in ends:
            if railed:
                raise CalibrationError(
                    f"{name} reads {fraction:.3f} of its supply at switch {SWITCHES[switch]}:"
                    f" {AT_END}"
                )


def _jump(log: Log, rig: CalibrationRig, index: int) -> float:
    """Largest difference of a potentiometer between approaches of one switch [rad]."""
    ranges = []
    for switch in (index // 2 * 2, index // 2 * 2 + 1):
        events = [e for e in log.events if e.switch == switch]
        for closed in (True, False):
            seen = [e.potentiometer[index] for e in events if e.closed is closed]
            ranges.append(float(np.ptp(seen)) * rig.track)
    return max(ranges)


def check_tracks(index: int, value: Array, log: Log, rig: CalibrationRig) -> None:
    """Refuse potentiometers of an axis that turn by another angle, or not in proportion to it.

    Parameters
    ----------
    index : of the axis
    value : its parameters (11,)

    Raises
    ------
    CalibrationError : the message names the potentiometer
    """
    turned = [abs(float(value[k])) * rig.track for k in (KA, KB)]
    names = POTENTIOMETER_NAMES[2 * index : 2 * index + 2]
    for name, turn in zip(names, turned, strict=True):
        if not TURN[0] < turn < TURN[1]:
            raise CalibrationError(_other_turn(index, name, turn, turned, rig))
    apart = [_bend(event.potentiometer, index, value) for event in events_of(log, 1 - index)]
    bend = sqrt(float(np.mean(np.square(apart))))
    if bend > LARGEST_BEND:
        raise _bent(index, bend, log)


def _other_turn(
    index: int, name: str, turn: float, turned: list[float], rig: CalibrationRig
) -> str:
    plus, minus = 2 * index, 2 * index + 1
    apart = degrees(rig.switch_angle[plus] - rig.switch_angle[minus])
    said = (
        f"{name} turned {apart * turn:.1f}° between switches {SWITCHES[plus]} and"
        f" {SWITCHES[minus]}, which are {apart:.1f}° apart"
    )
    if min(turned) > 0.5 and max(turned) < 1.15 * min(turned):
        track = degrees(rig.track) / (sum(turned) / 2)
        return (
            f"{said}, and so did the other one of this axis; if the data sheet gives a track of"
            f" about {track:.0f}°, not {degrees(rig.track):g}°, give it as --potentiometer-deg;"
            " else a switch is misplaced"
        )
    return f"{said}; its shaft is loose, it is not wired, or a switch is misplaced"


def _bend(readings: tuple[float, ...], index: int, value: Array) -> float:
    """Return how far two potentiometers are apart, each by its line through the switches [rad]."""
    a, b = readings[2 * index], readings[2 * index + 1]
    return float((a - value[OA]) / value[KA] - (b - value[OB]) / value[KB])


def _bent(index: int, bend: float, log: Log) -> CalibrationError:
    """Say which of two potentiometers is clipped: the one that comes closest to an end."""
    margin, k, switch = min(
        (min(e.potentiometer[k], 1 - e.potentiometer[k]), k, e.switch)
        for e in events_of(log, index)
        for k in (2 * index, 2 * index + 1)
    )
    if margin < NEAR_END:
        return CalibrationError(
            f"{POTENTIOMETER_NAMES[k]} stops turning before switch {SWITCHES[switch]}: {AT_END}"
        )
    a, b = POTENTIOMETER_NAMES[2 * index : 2 * index + 2]
    return CalibrationError(
        f"{a} and {b} are {degrees(bend):.1f}° (rms) apart between switches where they agree; one"
        " of them is worn, or its shaft slips"
    )
