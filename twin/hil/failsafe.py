"""The reaction of a run to a fault of its rig: servos to neutral, and the run ends or continues."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from hardware.events import Event, Level, RigLost
from hardware.faults import SENSORS
from hardware.faults.states import GLITCH, GYRO, UNNAMED
from hardware.frames import GimbalState, Pair
from twin.config import OnFault
from twin.hil.gimbal import SILENT_S
from twin.loop.loop import Controller
from twin.loop.readings import Readings

if TYPE_CHECKING:
    from twin.hil.turntable import Turntable

# First names, and for how long another may follow [s]: that of a servo comes after 0.3 s, `open` or
# `deviating` of a potentiometer after 25 to 50 ms.
NAMING_S = {UNNAMED: 0.4, GLITCH: 0.06}
LATE_S = 0.3  # an older reading does not count; a pause of this computer is caught up with sooner


@dataclass(frozen=True)
class RunFault(Event):
    """A fault of the rig, and what the run does about it.

    Attributes
    ----------
    fault : in one line
    policy : of the run
    """

    level: ClassVar[Level] = "ERROR"
    fault: str
    policy: OnFault

    @property
    def text(self) -> str:
        """Fault and reaction."""
        reactions = {
            "end": "servos to neutral, the run ends",
            "neutral": "servos stay at neutral",
            "ignore": "ignored as requested",
        }
        return f"fault: {self.fault}; {reactions[self.policy]}"


class Guard:
    """A controller that commands zero from a rig's first fault on.

    A servo that does not follow is named by its return to zero; the run ends 0.4 s later then. A
    potentiometer's first wrong reading does not tell a glitch from an open wire: 0.06 s later.

    A fault is a lost connection, a silence of 0.1 s, readings that are 0.3 s
    old for as long, or a sensor that the monitor has named. Lost
    or damaged frames alone are not faults: the estimate goes on without them.

    Parameters
    ----------
    controller : in command until then
    readings : of the rig
    policy : `end` the run, continue with the servos at `neutral`, or `ignore` the fault
    turntable : that the rig stands on, if any; its faults count, and it stops with the servos

    Attributes
    ----------
    fault : the first one, in one line; None before
    events : since the last update
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
        self._last_frame = self._time = 0.0
        self._waits_until = 0.0
        self.fault: str | None = None
        self.events: list[Event] = []

    def update(self, time: float, gimbal: GimbalState) -> Pair:
        """Gimbal angle to command now [rad], `time` in experiment time [s]."""
        self.events.clear()
        if self.fault is None:
            self.fault = self._detected(time, gimbal)
            if self.fault is not None:
                self.events.append(RunFault(self.fault, self._policy))
                self._waits_until = time + _naming(self.fault)
                if self._turntable is not None and self._policy != "ignore":
                    self._turntable.stop()
        elif time < self._waits_until:
            unnamed = UNNAMED in self.fault
            self.fault = self._readings.health if self._readings.faults else self.fault
            if unnamed and UNNAMED not in self.fault:  # final
                self._waits_until = time
        self._time = time
        wanted = self._controller.update(time, gimbal)  # at every tick, so that its state continues
        return wanted if self.fault is None or self._policy == "ignore" else (0.0, 0.0)

    def over(self) -> str | None:
        """Return the reason to end the run, None while there is none."""
        if self.fault is None or self._policy != "end":
            return None
        return None if self._time < self._waits_until else f"fault: {self.fault}"

    def _detected(self, time: float, gimbal: GimbalState) -> str | None:
        r = self._readings
        age = (r.age_ns or 0) * 1e-9
        if r.frames and age < LATE_S:
            self._last_frame = time
            # a turntable that does not turn as it should makes the holder's gyro look wrong
            if self._turntable is not None and self._turntable.fault is not None:
                return self._turntable.fault
            if gimbal.healthy:
                return None
            # on a turntable the monitor only sees the difference of two gyros
            gyro = bool(r.faults) and r.faults[0].sensor == SENSORS[GYRO]
            either = self._turntable is not None and gyro
            return f"{r.health}, of holder or base" if either else r.health
        if not r.ready:
            lost = [event.text for event in r.events if isinstance(event, RigLost)]
            return lost[-1] if lost else "rig away"
        if time - self._last_frame <= SILENT_S:
            return None
        return f"readings are {age:.1f} s old" if r.frames else f"no readings for {SILENT_S:g} s"


def _naming(fault: str) -> float:
    """Return for how long the name of a fault may change after it was found [s]."""
    return max(time if kind in fault else 0.0 for kind, time in NAMING_S.items())
