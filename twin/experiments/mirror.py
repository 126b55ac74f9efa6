"""`twin mirror`: the simulated gimbal follows what a rig measures, live or recorded."""

import time
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import asdict, dataclass
from math import degrees

import numpy as np

from hardware.events import RigBack, RigLost
from hardware.protocol import Board
from twin.config import Mirror
from twin.config.result import Result, Rows
from twin.errors import TwinError
from twin.experiments.session import Session
from twin.experiments.signals import until_signal
from twin.experiments.summary import recording_rows
from twin.hil import RigGimbal
from twin.hil.playback import Playback
from twin.hil.teleop import Keys, Stick, Watch
from twin.loop.loop import Controller
from twin.loop.readings import Readings
from twin.plant.authority import stroke

KEYS = "arrow keys, space: zero, q: end   "
ENDLESS_NS = 1 << 62
FEWEST_AGES = 100  # of which one is at 99 %
AGE_NS, OLDEST = 10_000, 10_000  # a class of ages, and their number: up to 0.1 s
# The rig is polled more often than rows are needed, so that no frame waits for its tick.
ROW_NS = 2_000_000
DRAIN_NS = 2_000_000_000  # a write of the recorder holds the loop up for milliseconds: seldom


@dataclass(frozen=True)
class MirrorResult(Result):
    """What a mirror followed.

    Attributes
    ----------
    rig : its seat, board and serial number
    ended : reason of the end
    frames : sensor frames followed
    pose_age_ms : median and 99th percentile of the time from a device's stamp to the pose that
        shows it; None with less than 100 readings or for a recording
    lost, crc_errors : frames, from time zero on
    gaps_s : times without the rig
    health : last state of connection and sensors
    notes : what is worth knowing about the rig, one line each
    """

    recording: str
    rig: str
    ended: str
    duration_s: float
    frames: int
    pose_age_ms: tuple[float, float] | None
    lost: int
    crc_errors: int
    gaps_s: tuple[float, ...]
    health: str
    wall_s: float
    notes: tuple[str, ...] = ()

    def as_dict(self) -> dict[str, object]:
        """JSON values."""
        return asdict(self)

    def rows(self) -> Rows:
        """The run as a table."""
        rows = [
            ("rig", self.rig),
            ("ended", f"{self.ended}, after {self.duration_s:.2f} s"),
            ("frames", f"{self.frames}, {self.lost} lost, {self.crc_errors} with CRC errors"),
        ]
        age = "–"
        if self.pose_age_ms is not None:
            age = "{:.2f} ms median, {:.2f} ms at 99 %".format(*self.pose_age_ms)
        rows.append(("pose age", age))
        if self.gaps_s:
            times = ", ".join(f"{g:.2f}" for g in self.gaps_s)
            rows.append(("without the rig", f"{len(self.gaps_s)} times: {times} s"))
        rows += [("health", self.health), *(("note", note) for note in self.notes)]
        return rows + recording_rows(self.recording)


class _Witness:
    """Counts frames and notes the age of each pose, once the plant has taken the tick's step."""

    def __init__(self, readings: Readings, now_ns: Callable[[], int] | None) -> None:
        self.readings, self._now = readings, now_ns
        self.frames = 0
        self.angle = (0.0, 0.0)
        self.ages = np.zeros(OLDEST, np.int64)  # numbers of them by class: a run may last for days
        self.gaps: list[float] = []
        self._since: int | None = None
        self._seen_ns = 0

    def look(self, time_ns: int) -> None:
        r = self.readings
        self.frames += sum(f.time_ns >= 0 for f in r.frames)
        for event in r.events:
            if isinstance(event, RigLost):
                self._since = time_ns
            elif self._since is not None and isinstance(event, RigBack):
                self.gaps.append((time_ns - self._since) * 1e-9)
                self._since = None
        self._seen_ns = time_ns
        if r.states:
            self.angle = r.states[-1].angle
        if self._now is not None and r.states:
            age = (self._now() - r.states[-1].time_ns) // AGE_NS
            self.ages[min(max(age, 0), OLDEST - 1)] += 1

    def times_without(self) -> tuple[float, ...]:
        """How long the rig was away each time, the last to the end of the run [s]."""
        last = () if self._since is None else ((self._seen_ns - self._since) * 1e-9,)
        return (*self.gaps, *last)

    def text(self) -> str:
        """Angles, health and link, for the status line."""
        x, y = map(degrees, self.angle)
        link = "rig away" if self._since is not None else f"{self.readings.lost} frames lost"
        return f"x {x:+6.2f}°  y {y:+6.2f}°  {self.readings.health}, {link}"

    def percentiles(self) -> tuple[float, float] | None:
        """Median and 99th percentile of the ages [ms], to half a class."""
        below = np.cumsum(self.ages)
        if below[-1] < FEWEST_AGES:
            return None
        median, high = np.searchsorted(below, below[-1] * np.array([0.5, 0.99]))
        return (float(median) + 0.5) * AGE_NS * 1e-6, (float(high) + 0.5) * AGE_NS * 1e-6


def mirror(config: Mirror) -> MirrorResult:
    """Follow a rig, or a recording, until interrupted or the time is over.

    Raises
    ------
    TwinError, HardwareError, AnalysisError : in one line, what cannot be opened and what to do
    """
    began = time.perf_counter()
    with Session(config, "mirror", config.control_hz, timed=False) as s, ExitStack() as stack:
        plant = s.plant
        if plant.twin.gimbal != "follow":
            raise TwinError(f"--scene {config.scene}: has no gimbal to follow a rig with")
        reach = stroke(plant.twin.mj)
        keys = stack.enter_context(Keys(reach)) if config.steer == "keys" else None
        length = ENDLESS_NS
        if config.playback is None:
            s.connect(watch=not config.steer)
            assert s.rig is not None
            controller, name = _controller(config, keys, s.rig, reach), _name(config, s.rig)
            witness = _Witness(s.rig.readings, s.rig.now_ns)
        else:
            playback = Playback(config.playback, plant)
            s.seat(playback, playback.readings)
            controller, name = playback, f"recording {config.playback}"
            witness = _Witness(playback.readings, None)
            length = playback.duration_ns + s.tick_ns  # the last reading belongs to a tick
        if config.duration_s is not None:
            length = min(length, round(config.duration_s * 1e9))
        recorder = s.record(serve=config.serve, drain_ns=DRAIN_NS)
        ended = stack.enter_context(until_signal())  # until then there is nothing to keep
        readings, rows = witness.readings, s.rows

        hint = KEYS if keys is not None else ""

        def write(time_ns: int) -> None:
            if readings.frames or readings.events or time_ns % ROW_NS == 0:
                rows.write(time_ns)

        def over() -> str | None:
            witness.look(plant.time_ns)
            return "q" if keys is not None and keys.ended else ended()

        outcome = s.run(
            controller, length, each_tick=(write,), stop=over, doing=lambda: hint + witness.text()
        )
        recorder.event(plant.time_ns, f"mirror ended: {outcome.ended}")
    return MirrorResult(
        recording=str(recorder.path),
        rig=name,
        ended=outcome.ended,
        duration_s=plant.time_ns * 1e-9,
        frames=witness.frames,
        pose_age_ms=witness.percentiles(),
        lost=readings.lost,
        crc_errors=readings.crc_errors,
        gaps_s=witness.times_without(),
        health=readings.health,
        wall_s=time.perf_counter() - began,
        notes=s.notes,
    )


def _controller(config: Mirror, keys: Keys | None, rig: RigGimbal, reach: float) -> Controller:
    if keys is not None:
        return keys
    if config.steer == "joystick":
        return Stick(rig.readings, reach)
    return Watch(rig.readings, rig.pulse_angle)


def _name(config: Mirror, rig: RigGimbal) -> str:
    hello = rig.rig.hello
    assert hello is not None
    board = Board(hello.board).name.lower() if hello.board in list(Board) else str(hello.board)
    return f"{config.gimbal} ({board} {hello.serial:08x})"
