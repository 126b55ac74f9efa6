"""What a gimbal seat with sensors has received since the last tick."""

from dataclasses import dataclass, field

from hardware.events import Event
from hardware.faults import Fault
from hardware.frames import GimbalState, SensorFrame


@dataclass(slots=True)
class Readings:
    """Renewed by every poll of the gimbal seat, which alone writes it.

    Attributes
    ----------
    frames, states : sensor frames that arrived, and the estimate after each
    age_ns : age of the newest sample at the poll; None while no frames arrive [ns]
    round_trip_ns : of the last PING; None while no frames arrive [ns]
    round_trips : PINGs answered so far
    lost, crc_errors : frames, since the line was opened
    health : of connection and sensors in one line, "ok" when nothing is wrong
    faults : sensors that are known to be wrong
    ready : whether the rig is connected
    events : since the last poll
    session : how often the rig has become ready; estimates start again with each
    gyro_delay : of the holder gyro's readings [s]
    snapshot : state of the estimator when the run began, JSON; at the first poll only, else None
    """

    frames: list[SensorFrame] = field(default_factory=list)
    states: list[GimbalState] = field(default_factory=list)
    age_ns: int | None = None
    round_trip_ns: int | None = None
    round_trips: int = 0
    lost: int = 0
    crc_errors: int = 0
    health: str = "ok"
    faults: tuple[Fault, ...] = ()
    events: list[Event] = field(default_factory=list)
    ready: bool = False
    session: int = 0
    gyro_delay: float = 0.0
    snapshot: str | None = None
