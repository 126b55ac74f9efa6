"""What becomes of a run whose rig fails: servos to neutral, and the run ends or goes on."""

from typing import TYPE_CHECKING

from hardware.frames import GimbalState, Pair
from twin.config import OnFault
from twin.loop.loop import Controller
from twin.loop.readings import Readings

if TYPE_CHECKING:
    from twin.hil.turntable import Turntable

SILENT_S = 0.1  # without a reading; fifty frames, and as long as the rig itself waits for a command


class Guard:
    """A controller that commands zero from a rig's first fault on.

    A fault is a lost connection, a silence of 0.1 s, or a sensor that the monitor has named. Lost
    or damaged frames alone are none: the estimate goes on without them.

    Parameters
    ----------
    controller : who commands while all is well
    readings : of the rig
    policy : `end` the run, go on with the servos at `neutral`, or `ignore` the fault and go on as
        the estimate goes on
    turntable : that the rig stands on, if any; its faults count, and it stops with the servos

    Attributes
    ----------
    fault : the first one, in words; None while there was none
    """

    def __init__(
        self,
        controller: Controller,
        readings: Readings,
        policy: OnFault,
        turntable: "Turntable | None" = None,
    ) -> None:
        self._controller, self._readings, self._policy = controller, readings, policy
        self._turntable = turntable
        self._heard = 0.0
        self.fault: str | None = None

    def update(self, time: float, gimbal: GimbalState) -> Pair:
        """Gimbal angle to command now [rad], `time` in experiment time [s]."""
        if self.fault is None:
            self.fault = self._found(time, gimbal)
            if self.fault is not None:
                self._announce()
                if self._turntable is not None and self._policy != "ignore":
                    self._turntable.stop()
        wanted = self._controller.update(time, gimbal)  # it sees every tick, whatever it is worth
        return wanted if self.fault is None or self._policy == "ignore" else (0.0, 0.0)

    def over(self) -> str | None:
        """Why the run is over, or None while it is not."""
        ended = self.fault is not None and self._policy == "end"
        return f"fault: {self.fault}" if ended else None

    def _found(self, time: float, gimbal: GimbalState) -> str | None:
        r = self._readings
        if r.frames:
            self._heard = time
            # a base that does not turn as it should leads the holder's gyro astray as well
            if self._turntable is not None and self._turntable.fault is not None:
                return self._turntable.fault
            if gimbal.healthy:
                return None
            # on a turntable the monitor knows the difference of two gyros only
            either = self._turntable is not None and r.health.startswith("gyro ")
            return f"{r.health}, of holder or base" if either else r.health
        if not r.ready:
            lost = [text for _, text in r.news if text.startswith("rig lost")]
            return lost[-1] if lost else "rig away"
        return f"no readings for {SILENT_S:g} s" if time - self._heard > SILENT_S else None

    def _announce(self) -> None:
        ending = {"end": "servos neutral, the run ends", "neutral": "servos neutral from here on"}
        told = ending.get(self._policy, "ignored, as asked")
        self._readings.news.append(("ERROR", f"fault: {self.fault}; {told}"))
