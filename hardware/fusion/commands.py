"""What a rig's servos are commanded to, and how well its calibration says where that leads."""

from math import hypot, radians

from hardware.calibration.result import Calibration
from hardware.faults import ServoLimits, Tolerance
from hardware.frames import AXES, Pair, SensorFrame
from hardware.protocol import Flags

_ARMED = int(Flags.ARMED)  # an enum's `&` takes 1 µs
_AT = radians(5.0)  # at which uncertain slopes are evaluated
_LOAD = radians(0.3)  # play that a weight takes up, and waviness of the potentiometers
_SLOPE = 0.02  # of a load on the servos
_BENT = 0.1  # of a straight line through the shipped linkage, at 9°
_SPREAD = radians(0.3)  # of the play from one place to another
# Of a 9 g servo, 10 µs by its data sheet: it may stop anywhere within after a fast move, although a
# calibration, which creeps, sees little of it.
_DEAD_BAND = radians(0.43)


def tolerances(calibration: Calibration, limits: ServoLimits) -> tuple[Tolerance, Tolerance]:
    """Return what a calibration leaves open of the angle a command leads to, per axis."""
    here, there = calibration.sigma((0.0, 0.0)), calibration.sigma((_AT, _AT))
    bent = _BENT if calibration.linearisation.straight and any(calibration.deviation) else 0.0

    def one(k: int) -> Tolerance:
        a, b = 2 * k, 2 * k + 1
        zero, away = (
            hypot(calibration.potentiometer_sigma(a, t), calibration.potentiometer_sigma(b, t)) / 2
            for t in (0.0, _AT)
        )
        grown = here[k] ** 2 + zero**2
        slope = max(0.0, there[k] ** 2 + away**2 - grown) ** 0.5 / _AT
        width = calibration.hysteresis[k]
        play = min(limits.play, max(width, _DEAD_BAND) + _SPREAD) if width > 0 else limits.play
        return Tolerance(3 * hypot(here[k], zero) + _LOAD, 3 * slope + _SLOPE + bent, play)

    return one(0), one(len(AXES) - 1)


class Commands:
    """Gimbal angles of the pulse widths in force; they change once in a servo's 20 ms."""

    def __init__(self, calibration: Calibration) -> None:
        self._calibration = calibration
        self._pulses: Pair = (0.0, 0.0)
        self._angles: Pair = (0.0, 0.0)

    def angles(self, frame: SensorFrame) -> Pair | None:
        """Return the commanded angles of a frame; None while the servos are not armed [rad]."""
        if not frame.flags & _ARMED:
            return None
        pulses = frame.pulse[:2]
        if pulses != self._pulses:
            self._pulses, self._angles = pulses, self._calibration.angles(pulses)
        return self._angles
