"""Phases of a connection to a rig, and its statistics."""

from dataclasses import dataclass
from enum import StrEnum

from hardware.link import Gap


class Phase(StrEnum):
    """Phase of a connection."""

    AWAY = "away"
    GREETING = "greeting"
    SYNCING = "syncing"
    READY = "ready"


class Sign(StrEnum):
    """Event that changes the phase."""

    LOST = "lost"
    OPENED = "opened"
    HELLO = "hello"
    SYNCED = "synced"
    SILENT = "silent"


# A pair that is missing leaves the phase unchanged.
TRANSITIONS: dict[tuple[Phase, Sign], Phase] = {
    (Phase.AWAY, Sign.OPENED): Phase.GREETING,
    (Phase.GREETING, Sign.HELLO): Phase.SYNCING,
    (Phase.GREETING, Sign.LOST): Phase.AWAY,
    (Phase.SYNCING, Sign.SYNCED): Phase.READY,
    (Phase.SYNCING, Sign.LOST): Phase.AWAY,
    (Phase.SYNCING, Sign.OPENED): Phase.GREETING,
    (Phase.READY, Sign.LOST): Phase.AWAY,
    (Phase.READY, Sign.OPENED): Phase.GREETING,
    (Phase.SYNCING, Sign.SILENT): Phase.GREETING,
    (Phase.READY, Sign.SILENT): Phase.GREETING,
    (Phase.READY, Sign.HELLO): Phase.SYNCING,  # it rebooted without a loss of the line
}


@dataclass(frozen=True, slots=True)
class RigStatistics:
    """Losses and timing of a rig since it was made.

    Attributes
    ----------
    frames : telemetry frames turned into sensor frames
    lost, crc_errors : of what the device sent
    device_lost, device_crc_errors : of what it was sent, by its own count
    skipped : frames it had no room to send
    refused : messages the line did not take
    dropped : bytes received and not processed, because they came faster than they were polled
    gaps : times without a connection
    round_trips : answered PINGs of this session
    round_trip_ns, shortest_ns : of the last PING, and without the slow ones [ns]
    skew : how fast the device's clock is [1]
    """

    frames: int
    lost: int
    crc_errors: int
    device_lost: int
    device_crc_errors: int
    skipped: int
    refused: int
    gaps: tuple[Gap, ...]
    round_trips: int
    round_trip_ns: int
    shortest_ns: int
    skew: float
    dropped: int = 0
