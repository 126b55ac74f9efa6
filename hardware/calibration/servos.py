"""Whether the servos of a rig that is calibrated are driven as commanded, frame by frame."""

from collections.abc import Sequence

from hardware.calibration.log import CalibrationRig
from hardware.frames import SensorFrame

LONGEST_US = 1_000_000  # to wait for a pulse; a board that never takes it shows in the switches


class InForce:
    """Compares the pulses in force with those commanded.

    A host that is too busy takes frames late and commands late. A step counts once it is in force,
    so that frames that come all at once do not lead to as many steps; and where the servos
    returned to neutral for want of commands, an approach has to be repeated.

    Parameters
    ----------
    rig : its steps; servos follow a command by one of them

    Attributes
    ----------
    left : the servos have left what was commanded by more than a step, since this was set to false
    """

    def __init__(self, rig: CalibrationRig) -> None:
        self._equal, self._apart = 0.4 * rig.fine, 1.6 * rig.fine
        self._least_us = 0.1e6 * rig.dwell
        self._since: int | None = None
        self.left = False

    def update(self, frame: SensorFrame, commanded: Sequence[float]) -> None:
        """Take a frame, and the pulses commanded before it [s]."""
        apart = max(abs(p - c) for p, c in zip(frame.pulse[:2], commanded, strict=True))
        self.left = self.left or apart > self._apart
        if apart > self._equal:
            self._since = None
        elif self._since is None:
            self._since = frame.device_us

    def over(self, now: int, end: float) -> bool:
        """Return whether a wait until `end` is over: its pulses have been in force for a while.

        Parameters
        ----------
        now, end : device time [µs]
        """
        if now < end:
            return False
        taken = self._since is not None and now - self._since >= self._least_us
        return taken or now > end + LONGEST_US
