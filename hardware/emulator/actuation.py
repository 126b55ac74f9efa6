"""Faults between pulse widths and servo shafts: what a servo does instead of what it is sent."""

from collections import deque
from math import radians

from hardware.emulator.injection import Injection
from hardware.emulator.plant import Plant
from hardware.emulator.servo import Drive, Wear
from hardware.frames import SERVO_NAMES, Triple

FULL_SPEED = radians(600.0)  # rad/s of shaft, 0.10 s/60°: SG90 data sheet
TARGETS = (*SERVO_NAMES, "servos")


class Actuation:
    """Turns commanded shaft angles into those that faulty servos go to.

    Parameters
    ----------
    plant : whose servos are jammed or left without power
    injections : of all targets; only those of servos count
    """

    def __init__(self, plant: Plant, injections: tuple[Injection, ...]) -> None:
        self._plant = plant
        self._faults = tuple(f for f in injections if f.target in TARGETS)
        self._drives = [Drive.NORMAL, Drive.NORMAL]
        self._slow: list[float | None] = [None, None]
        self._wear = [Wear(), Wear()]
        self._late: list[deque[float]] = [deque(), deque()]

    @property
    def faulty(self) -> bool:
        """Whether any fault of a servo was requested."""
        return bool(self._faults)

    def shafts(self, wanted: Triple, time: float, dt: float) -> Triple:
        """Return the angles that the servos go to now, and set how they are driven.

        Parameters
        ----------
        wanted : commanded shaft angles of servos x, y and turntable [rad]
        time, dt : rig time and time step [s]
        """
        active = [f for f in self._faults if f.active(time)]
        pair = [wanted[0], wanted[1]]
        if any(f.target == "servos" for f in active):
            pair.reverse()
        for k, name in enumerate(SERVO_NAMES):
            own = [f for f in active if f.target == name]
            drive = Drive.NORMAL
            for fault in own:
                drive = _drive(fault, time, drive)
                pair[k] = self._moved(k, fault, pair[k], dt)
            if not any(f.kind == "slow" for f in own):
                self._slow[k] = None
            if not any(f.kind == "delay" for f in own):
                self._late[k].clear()
            wear = _wear(own)
            if wear != self._wear[k]:
                self._wear[k] = wear
                self._plant.set_wear(k, wear)
            if drive is not self._drives[k]:
                self._drives[k] = drive
                self._plant.set_drive(k, drive)
        return pair[0], pair[1], wanted[2]

    def _moved(self, k: int, fault: Injection, wanted: float, dt: float) -> float:
        if fault.kind == "reversed":
            return -wanted
        if fault.kind == "hard_over":
            return radians(fault.value)
        if fault.kind == "slipped":
            return wanted + radians(fault.value)
        if fault.kind == "delay":
            return _delayed(self._late[k], wanted, round(1e-3 * fault.value / dt))
        if fault.kind == "slow":
            step = fault.value * FULL_SPEED * dt
            before = self._slow[k]
            now = wanted if before is None else min(max(wanted, before - step), before + step)
            self._slow[k] = now
            return now
        return wanted


def _delayed(waiting: deque[float], wanted: float, steps: int) -> float:
    """The angle commanded some steps ago; the first one until then."""
    waiting.append(wanted)
    while len(waiting) > steps + 1:
        waiting.popleft()
    return waiting[0]


def _wear(faults: list[Injection]) -> Wear:
    """How worn a servo is by its faults."""
    values = {f.kind: f.value for f in faults}
    return Wear(
        radians(values.get("backlash", 0.0)),
        values.get("friction", 1.0),
        1.0 - values.get("voltage", 0.0),
    )


def _drive(fault: Injection, time: float, drive: Drive) -> Drive:
    if fault.kind == "jammed":
        return Drive.JAMMED
    open_contact = fault.kind == "contact" and (time - fault.start) * fault.value % 1.0 < 0.5
    return Drive.LIMP if fault.kind == "dead" or open_contact else drive
