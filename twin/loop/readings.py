"""What a gimbal seat with sensors has seen since the last tick, for whoever records or shows it."""

from dataclasses import dataclass, field

from hardware.frames import GimbalState, SensorFrame


@dataclass(slots=True)
class Readings:
    """Renewed by every poll.

    Attributes
    ----------
    frames, states : sensor frames that arrived, and the estimate after each
    age_ns : of the newest sample at the poll; None while nothing is coming [ns]
    round_trip_ns : of the last PING; None while nothing is coming [ns]
    round_trips : PINGs answered so far
    lost, crc_errors : frames, since the line was opened
    health : of connection and sensors, in words
    ready : whether the rig is connected
    news : events since the last poll, as level and text
    session : how often the rig has become ready; estimates begin anew with each
    gyro_delay : of the holder gyro's readings [s]
    opening : what the estimator remembered when the run began, JSON; told once, at the first poll
    """

    frames: list[SensorFrame] = field(default_factory=list)
    states: list[GimbalState] = field(default_factory=list)
    age_ns: int | None = None
    round_trip_ns: int | None = None
    round_trips: int = 0
    lost: int = 0
    crc_errors: int = 0
    health: str = "ok"
    news: list[tuple[str, str]] = field(default_factory=list)
    ready: bool = False
    session: int = 0
    gyro_delay: float = 0.0
    opening: str | None = None
