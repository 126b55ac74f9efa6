"""What happens to a rig between two polls, as types with a level and a text for the log."""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar, Literal

Level = Literal["INFO", "WARN", "ERROR"]


class Event(ABC):
    """One thing that happened; its time is that of the poll or tick that reports it.

    Attributes
    ----------
    level : severity in the log
    """

    level: ClassVar[Level] = "INFO"

    @property
    @abstractmethod
    def text(self) -> str:
        """One line for the log."""


def _part(name: str) -> str:
    return "servo" if name.startswith("servo_") else "sensor"


@dataclass(frozen=True)
class RigLost(Event):
    """The connection was lost.

    Attributes
    ----------
    reason : of the loss
    """

    level: ClassVar[Level] = "WARN"
    reason: str

    @property
    def text(self) -> str:
        """Reason on one line."""
        return f"rig lost: {' '.join(self.reason.split())}"


@dataclass(frozen=True)
class RigBack(Event):
    """The connection is there again.

    Attributes
    ----------
    away_s : time without it [s]
    restart : what the device started again after, "after a brown-out"; "" if it did not
    """

    away_s: float
    restart: str = ""

    @property
    def text(self) -> str:
        """Time without connection, and whether the device started again."""
        restarted = f"; it started again {self.restart}" if self.restart else ""
        return f"rig back after {self.away_s:.2f} s{restarted}"


@dataclass(frozen=True)
class SensorFault(Event):
    """The monitor has found a sensor or servo to be wrong.

    Attributes
    ----------
    sensor, kind : as in `hardware.faults.Fault`; later kinds of a sensor are part of the health
        only, those of a servo are an event each
    """

    level: ClassVar[Level] = "WARN"
    sensor: str
    kind: str

    @property
    def text(self) -> str:
        """Sensor and kind."""
        return f"{_part(self.sensor)} fault: {self.sensor} {self.kind}"


@dataclass(frozen=True)
class SensorRecovered(Event):
    """A sensor or servo that was wrong is trusted again."""

    sensor: str

    @property
    def text(self) -> str:
        """Sensor."""
        return f"{_part(self.sensor)} recovered: {self.sensor}"


@dataclass(frozen=True)
class HealthChanged(Event):
    """Health of connection and sensors has changed.

    Attributes
    ----------
    health : the new one in one line, "ok" when nothing is wrong
    """

    health: str

    @property
    def text(self) -> str:
        """The new health."""
        return self.health


@dataclass(frozen=True)
class ReadingsDropped(Event):
    """Readings come faster than they are processed; the newest are used."""

    level: ClassVar[Level] = "WARN"

    @property
    def text(self) -> str:
        """What happens."""
        return "readings come faster than they are processed: the oldest are dropped"


@dataclass(frozen=True)
class MonitoringLimited(Event):
    """The fault monitor cannot see all that it should.

    Attributes
    ----------
    reason : what limits it, and what it cannot see
    """

    reason: str

    @property
    def text(self) -> str:
        """Reason."""
        return self.reason
