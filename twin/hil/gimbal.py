"""A rig in the gimbal seat: commands go over its line, measured angles move the joints."""

import json
from collections.abc import Callable
from dataclasses import replace

from hardware.emulator import Bench
from hardware.events import (
    Event,
    HealthChanged,
    MonitoringLimited,
    ReadingsDropped,
    RigBack,
    RigLost,
    SensorFault,
    SensorRecovered,
)
from hardware.faults import Fault
from hardware.frames import SERVO_NAMES, GimbalCommand, GimbalState, Pair, SensorFrame
from hardware.fusion import BaseMap
from hardware.rig import Phase, Rig, RigError
from hardware.rig.rig import TIMEOUT_MS
from twin.hil.recorded import RecordedRig
from twin.loop.readings import Readings
from twin.plant.plant import Plant

# The filters settle sooner, but the estimate of the device clock errs by up to 1 ms in the first
# 0.6 s after the handshake.
SETTLE_NS = 800_000_000
LONGEST_SETTLE_NS = 3_000_000_000
# A servo takes a new pulse every 20 ms; commands more frequent than the frames have no effect.
COMMAND_NS = 2_000_000
SILENT_S = 0.1  # without a reading: fifty frames, and the time the rig waits for a command
# timeout of the rig, after which its servos go to neutral, and the time they take
NEUTRAL_NS = TIMEOUT_MS * 1_000_000 + 100_000_000
_STEP_NS = 1_000_000
LARGEST_ANGLE = 0.8  # that the joints of the plant follow [rad]; gimbals reach 0.2
# Frames come every 2 ms and take 2 ms on the line; a backlog of one second is processed in 0.1 s.
FRESH_NS, LONGEST_CATCH_UP_NS = 10_000_000, 10_000_000_000


class RigGimbal:
    """Polls a rig once a tick without blocking and lets the joints of the plant follow it.

    While no frames arrive, the joints hold the last angle until the timeout of the rig and then go
    to neutral as its servos do (except with `watch`); `GimbalState.healthy` is false meanwhile.

    Parameters
    ----------
    rig : not connected yet
    plant : of a model whose gimbal is `follow`; None moves no joints
    clock : clock of the rig [ns]
    wait : lets time pass on it [ns]; in lockstep this advances the simulated device
    lockstep : the device runs on the plant's time
    watch : send nothing; the rig must not be armed then
    live : estimates need time to settle; false for a recording

    Attributes
    ----------
    rig, wait : as given
    readings : of the latest poll
    turntable : pulse width for the third servo, 0 for neutral [s]
    dropped : bytes of readings that came too fast and were dropped during the run
    base : map of the turntable the rig stands on; None on a fixed bench
    note : what is worth knowing of its calibration, in one line; "" where it was measured
    bench : of a simulated rig
    notices : events before the run, for its first tick
    """

    def __init__(
        self,
        rig: Rig | RecordedRig,
        plant: Plant | None,
        *,
        clock: Callable[[], int],
        wait: Callable[[int], None],
        lockstep: bool,
        watch: bool = False,
        live: bool = True,
    ) -> None:
        self.rig = rig
        self.readings = Readings()
        self.wait = wait
        self._plant, self._clock = plant, clock
        self._lockstep, self._watch = lockstep, watch
        self._live = live
        self.turntable = 0.0
        self.base: BaseMap | None = None
        self.note = ""
        self.bench: Bench | None = None
        self.notices: list[Event] = []
        self._origin = 0
        self._started = self._caught_up = False
        self.dropped = self._dropped = 0
        self._lost = self._damaged = 0  # frames, before the run
        self._fresh_ns = 0
        self._received = False
        self._next_command = 0
        self._ready = False
        self._lost_ns = 0
        self._health = ""
        self._snapshot: str | None = None
        self._stale = GimbalState(0, (0.0, 0.0), healthy=False)
        self._follower = plant if plant is not None and plant.follows else None
        self._followed: Pair | None = None

    def start(self) -> None:
        """Connect and let the estimate settle; blocks.

        Raises
        ------
        RigError : nothing answers, something else does, or the calibration is of another rig
        """
        self.rig.connect()
        self.settle()

    def settle(self) -> None:
        """Restart all estimates and wait until they have settled; blocks.

        Raises
        ------
        RigError : no readings come
        """
        self.rig.renew(self.base)
        began, before = self._clock(), self.rig.statistics.frames
        while self._live and (
            self._clock() - began < SETTLE_NS or self.rig.statistics.frames == before
        ):
            if self._clock() - began > LONGEST_SETTLE_NS:
                raise RigError(
                    "the rig answers but sends no readings; check its sensors and supply"
                )
            self.rig.poll()
            self.wait(_STEP_NS)
        self._ready = True

    def catch_up(self) -> None:
        """Process the frames that arrived while the run was set up; they are not recorded."""
        end = self._clock() + LONGEST_CATCH_UP_NS
        self.rig.poll()
        while self._live and not self._lockstep and not self._fresh() and self._clock() < end:
            self.wait(_STEP_NS)  # a terminal returns a backlog in pieces
            self.rig.poll()
        self._stale = self.rig.fusion.state(0)
        before = self.rig.statistics
        self._dropped = before.dropped
        if self._live:
            self._lost, self._damaged = before.lost, before.crc_errors
        memory = {"session": self.rig.session, "fusion": self.rig.fusion.snapshot()}
        self._snapshot = json.dumps(memory, allow_nan=False)
        self._caught_up = True

    def _fresh(self) -> bool:
        if self.rig.phase is not Phase.READY:  # no frames arrive
            return True
        states = self.rig.states
        return bool(states) and self._clock() - states[-1].time_ns < FRESH_NS

    def listen(self) -> bool:
        """Receive the answer to a PING; return whether one is awaited."""
        return self.rig.listen()

    def now_ns(self) -> int:
        """Experiment time on the clock of the rig [ns]."""
        return self._clock() - self._origin

    def send(self, command: GimbalCommand) -> None:
        """Send a command, at most every 2 ms."""
        if self._watch or command.time_ns < self._next_command:
            return
        self._next_command = command.time_ns + COMMAND_NS
        self.rig.send(command, self.turntable)

    def pulse_angle(self, frame: SensorFrame) -> Pair:
        """Gimbal angle of the pulse widths in a frame [rad]."""
        return self.rig.calibration.angles(frame.pulse[:2])

    def poll(self) -> GimbalState:
        """Return the latest estimate, in experiment time; frames and states are in `readings`."""
        if not self._started:
            if not self._caught_up:
                self.catch_up()
            self._origin = self._clock() - (self._plant.time_ns if self._plant else 0)
            self._started = True
        if self._lockstep and self._plant is not None:
            while (behind := self._plant.time_ns - self.now_ns()) > 0:
                self.wait(min(behind, _STEP_NS))
                self.rig.listen()  # a PONG stamped a tick late would falsify the clock estimate
        frames = self.rig.poll()
        self._read(frames)
        state = self.readings.states[-1] if self.readings.states else self._stale
        if not self._ready:
            state = replace(state, healthy=False)
        if self._plant is not None and not self._watch:
            state = self._neutral_unless_fresh(state, self._plant.time_ns)
        self._stale = state
        self._move(state)
        return state

    def _move(self, state: GimbalState) -> None:
        """Let the joints follow an estimate that is new, or has gone to neutral."""
        new = bool(self.readings.states)
        if self._follower is None or not (new or state.angle != self._followed):
            return
        self._followed = state.angle
        x, y = state.angle
        t = LARGEST_ANGLE  # an estimate beyond it is wrong, and the plant would diverge
        angle = (min(max(x, -t), t), min(max(y, -t), t))
        self._follower.follow(angle, state.rate if new else (0.0, 0.0))

    def _neutral_unless_fresh(self, state: GimbalState, now_ns: int) -> GimbalState:
        if self.readings.states:
            self._fresh_ns = now_ns
        elif now_ns - self._fresh_ns > NEUTRAL_NS:
            return replace(state, angle=(0.0, 0.0), rate=(0.0, 0.0), healthy=False)
        return state

    def close(self) -> None:
        """Send the servos to neutral, disarm, close the line."""
        self.rig.close()

    def _read(self, frames: list[SensorFrame]) -> None:
        rig, origin, r = self.rig, self._origin, self.readings
        r.frames = [replace(f, time_ns=f.time_ns - origin) for f in frames]
        r.states = [replace(s, time_ns=s.time_ns - origin) for s in rig.states]
        r.events = []
        r.snapshot, self._snapshot = self._snapshot, None
        self._follow_connection()
        newest = r.states[-1] if r.states else self._stale
        if r.states and not self._received:
            self._received = True
            r.events += self.notices
            if note := rig.fusion.monitor.note:
                r.events.append(MonitoringLimited(note))
        known = self._ready and self._received and newest.sigma != (0.0, 0.0)
        r.age_ns = self.now_ns() - newest.time_ns if known else None
        statistics = rig.statistics
        r.round_trip_ns = statistics.round_trip_ns if known and r.frames else None
        r.round_trips = statistics.round_trips
        r.lost = statistics.lost - self._lost
        r.crc_errors = statistics.crc_errors - self._damaged
        if statistics.dropped > self._dropped and not self.dropped:
            r.events.append(ReadingsDropped())
        self.dropped = statistics.dropped - self._dropped
        r.health, r.ready = rig.health, self._ready
        if r.health != self._health:
            self._health = r.health
            self._report_health()
        r.session, r.gyro_delay = rig.session, rig.gyro_delay

    def _report_health(self) -> None:
        """Report the new health, and which sensors have gone wrong or recovered."""
        r, before = self.readings, self.readings.faults
        r.faults = self.rig.fusion.monitor.faults
        known, wrong = {_event_of(f) for f in before}, {f.sensor for f in r.faults}
        r.events.append(HealthChanged(r.health))
        r.events += [SensorFault(f.sensor, f.kind) for f in r.faults if _event_of(f) not in known]
        r.events += [SensorRecovered(f.sensor) for f in before if f.sensor not in wrong]

    def _follow_connection(self) -> None:
        ready = self.rig.phase is Phase.READY
        if ready is self._ready:
            return
        self._ready = ready
        now = self.now_ns()
        if ready:
            away = (now - self._lost_ns) * 1e-9
            self.readings.events.append(RigBack(away, self.rig.started))
            return
        self._lost_ns = now
        self.readings.events.append(RigLost(self.rig.reason))


def _event_of(fault: Fault) -> tuple[str, str]:
    """What makes a fault another event: its sensor, and of a servo also its kind."""
    return fault.sensor, fault.kind if fault.sensor in SERVO_NAMES else ""
