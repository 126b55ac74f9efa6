"""Injected faults, as strings `target:kind[:value][@start[-end]]`, times in seconds."""

import math
from dataclasses import dataclass

from hardware.frames import PAIR_NAMES, POTENTIOMETER_NAMES, SERVO_NAMES, HardwareError


class FaultNameError(HardwareError):
    """A fault string does not name a valid fault."""


_UNPLUG = {"unplug": (2.0, 0.0, 3600.0, "seconds")}
_NONE = (0.0, 0.0, 0.0, "none")
# kind → (default value, lowest, highest, meaning of the value)
_POTENTIOMETER = {
    "glitch": (0.2, 0.0, 1.0, "fraction of readings that are wrong"),
    "stuck": _NONE,
    "open": _NONE,
    "offset": (5.0, -180.0, 180.0, "degrees"),
    "drift": (0.1, -90.0, 90.0, "degrees per second"),
    "gain": (0.05, -1.0, 1.0, "deviation of the scale"),
}
_PAIR = {
    "slipped": (5.0, -90.0, 90.0, "degrees"),
    "stuck": _NONE,
    "drift": (0.3, -90.0, 90.0, "degrees per second"),
}
_SERVO = {
    "reversed": _NONE,
    "jammed": _NONE,
    "dead": _NONE,
    "hard_over": (40.0, -90.0, 90.0, "degrees of the shaft"),
    "slipped": (10.0, -90.0, 90.0, "degrees of the horn on its shaft"),
    "slow": (0.1, 0.001, 1.0, "fraction of its speed"),
    "contact": (1.0, 0.01, 50.0, "times a second without power, half of the time"),
    "backlash": (0.5, 0.0, 10.0, "degrees of the horn more"),
    "friction": (2.0, 0.0, 20.0, "times the friction of the shaft"),
    "voltage": (0.1, 0.0, 0.9, "fraction of the servo's supply that is missing"),
    "delay": (10.0, 0.0, 1000.0, "milliseconds later"),
}
VALID: dict[str, dict[str, tuple[float, float, float, str]]] = {
    **dict.fromkeys(POTENTIOMETER_NAMES, _POTENTIOMETER),
    **dict.fromkeys(PAIR_NAMES, _PAIR),
    **dict.fromkeys(SERVO_NAMES, _SERVO),
    "servos": {"swapped": _NONE},
    "supply": {
        "sag": (0.1, 0.0, 0.9, "fraction of the supply that is missing"),
        "droop": (0.01, 0.0, 0.9, "fraction of the supply lost per second"),
        "reset": _NONE,
    },
    "gyro": {
        "bias": (20.0, -500.0, 500.0, "degrees per second"),
        "gain": (0.05, -1.0, 1.0, "deviation of the scale"),
        "frozen": _NONE,
    },
    "base_gyro": {
        "bias": (20.0, -500.0, 500.0, "degrees per second"),
        "frozen": _NONE,
    },
    "imu": _UNPLUG,
    "base_imu": _UNPLUG,
    "turntable": {"stuck": _NONE},
    "link": {
        "drop": (0.001, 0.0, 1.0, "fraction of bytes"),
        "corrupt": (0.001, 0.0, 1.0, "fraction of bytes"),
        **_UNPLUG,
    },
}


@dataclass(frozen=True, slots=True)
class Injection:
    """One fault in the rig.

    Attributes
    ----------
    target, kind : keys of `VALID`
    value : in the unit `VALID` names
    start, end : window in rig time [s]
    """

    target: str
    kind: str
    value: float
    start: float = 0.0
    end: float = math.inf

    @property
    def strength(self) -> float:
        """`value`, or 1 for a fault without one; a value of 0 has no effect."""
        _, low, high, _ = VALID[self.target][self.kind]
        return self.value if low < high else 1.0

    def active(self, time: float) -> bool:
        """Return whether the fault is active at a rig time [s]."""
        return self.start <= time < self.end


def valid_names() -> str:
    """Return every fault that can be requested, for messages and help."""
    return ", ".join(f"{target}:{kind}" for target, kinds in VALID.items() for kind in kinds)


def _number(text: str, what: str, whole: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise FaultNameError(f"fault {whole!r}: {what} {text!r} is not a number")
    return value


def _window(text: str, whole: str) -> tuple[float, float]:
    first, dash, last = text.partition("-")
    start = _number(first, "start", whole)
    end = _number(last, "end", whole) if dash else math.inf
    if not 0 <= start < end:
        raise FaultNameError(f"fault {whole!r}: window {text!r} must be START or START-END, rising")
    return start, end


def parse(text: str) -> Injection:
    """Return the fault that a string names.

    Parameters
    ----------
    text : `target:kind[:value][@start[-end]]`, such as `potentiometer_x_a:glitch:0.2@5-8`

    Raises
    ------
    FaultNameError : unknown target or kind (the valid ones are listed), or a value out of range
    """
    body, at, window = text.partition("@")
    parts = body.split(":")
    target, kind = parts[0], parts[1] if len(parts) > 1 else ""
    if kind not in VALID.get(target, {}) or len(parts) > 3:
        raise FaultNameError(f"fault {text!r}: must be one of {valid_names()}")
    default, low, high, meaning = VALID[target][kind]
    value = _number(parts[2], "value", text) if len(parts) == 3 else default
    if len(parts) == 3 and not low <= value <= high:
        raise FaultNameError(f"fault {text!r}: value must be {low:g}…{high:g} ({meaning})")
    start, end = _window(window, text) if at else (0.0, math.inf)
    if kind == "unplug":
        end = min(end, start + value)
    return Injection(target, kind, value, start, end)
