"""The gimbal seat over a link: handshake, clock, counts to SI, fusion, health, losses, reconnect.

Nothing here blocks but `connect`. The phases of a connection are a table; every `poll` moves along
it, so a pulled cable leads back to the greeting without a thread and without the caller's help.
"""

import time
from collections.abc import Callable

from hardware.calibration.result import Calibration, nominal
from hardware.faults import Fault
from hardware.frames import GimbalCommand, GimbalState, HardwareError, Pair, SensorFrame
from hardware.fusion import BaseMap, Fusion, Noise
from hardware.parts import GYRO_DELAY_S
from hardware.protocol import (
    LAYOUT,
    PROTOCOL,
    Arm,
    Command,
    Config,
    Disarm,
    Flags,
    Frame,
    Hello,
    HelloRequest,
    Mode,
    Name,
    Ping,
    Pong,
    Telemetry,
    Unknown,
    constants,
    layout,
)
from hardware.rig.clock import ClockEstimate
from hardware.rig.line import Line
from hardware.rig.phases import TRANSITIONS, Phase, RigStatistics, Sign
from hardware.rig.reading import Converter, unwrap

GREETING_NS = 100_000_000  # between HELLO_REQUESTs
SYNC_NS = 10_000_000  # between PINGs while the clock is not known yet
PING_NS = 200_000_000  # and later
SYNC_COUNT = 10
PONG_NS = 20_000_000  # after a PING; then its PONG is taken for lost
CONNECT_NS = 4_000_000_000  # a Nano's bootloader takes 2 s
SILENCE_NS = 300_000_000  # without a frame on an open line: hung, or only half plugged in
ARM_NS, ARMING_NS = 100_000_000, 500_000_000  # between ARMs that get lost, and given up after
# No stamp is so much older than the one before it, or from so far in the future.
BACK_US, AHEAD_NS = 50_000, 50_000_000
CAUSES = ("power-up", "a reset", "a brown-out", "its watchdog")  # bits of HELLO's reset_cause
TIMEOUT_MS = 100
PULSES = constants.PULSE_MINIMUM * constants.TICK, constants.PULSE_MAXIMUM * constants.TICK  # s
_POLL_NS = 1_000_000


class RigError(HardwareError):
    """The device behind the port is not a rig of this version, or does not answer."""


class Rig:
    """A gimbal on a line.

    Parameters
    ----------
    line : `hardware.link.Link` or `LockstepLine`
    calibration : of this rig; the drawings' values when left out
    clock : experiment time [ns], the one the line uses
    wait : lets time pass [ns] while `connect` waits; lockstep advances the device here
    noise : assumptions of the fusion
    arm : obey commands once connected; a mirror that only watches leaves the servos alone
    fuse : estimate the gimbal's state; a calibration has no use for it

    Attributes
    ----------
    state : latest estimate, None before the first frame
    states : estimates of the frames that the latest poll returned
    hello : what the device said of itself
    phase : where the connection stands
    fusion : the estimator, with the fault monitor in it
    session : how often the rig has become ready; estimates begin anew with each
    gyro_delay : of the holder gyro's readings, as this session's first frame told it [s]
    reason : why the rig was not ready when it last was not
    started : after what it has started anew since it was last ready, "" if it has not
    """

    def __init__(
        self,
        line: Line,
        calibration: Calibration | None = None,
        *,
        clock: Callable[[], int] = time.monotonic_ns,
        wait: Callable[[int], None] = lambda ns: time.sleep(ns * 1e-9),
        noise: Noise | None = None,
        arm: bool = True,
        fuse: bool = True,
    ) -> None:
        self.line = line
        self.calibrated = calibration is not None
        self.calibration = calibration or nominal()
        self._noise = noise
        self.fusion = Fusion(self.calibration, noise)
        self.state: GimbalState | None = None
        self.states: list[GimbalState] = []
        self.hello: Hello | None = None
        self.phase = Phase.AWAY
        self.estimate = ClockEstimate()
        self._clock, self._wait, self._arm, self._fuse = clock, wait, arm, fuse
        self._converter: Converter | None = None
        self._generation = 0
        self._next_ns = 0
        self._heard_ns = 0
        self._device_us: int | None = None
        self._frames = 0
        self.session = 0
        self.gyro_delay = self.fusion.noise.gyro_delay
        self.reason = self.started = ""
        self._unarmed_ns: int | None = None
        self._arm_ns = 0
        self._delay_known = False
        self._latest: Telemetry | None = None
        self._pong_until = 0  # when an awaited PONG is given up; 0 while none is awaited
        self._early: list[Frame] = []

    def connect(self, timeout_ns: int = CONNECT_NS) -> Hello:
        """Wait until the rig is ready and return its HELLO.

        Raises
        ------
        RigError : nothing answers, something else does, or a rig of another version
        """
        end = self._clock() + timeout_ns
        while self.phase is not Phase.READY:
            self.poll()
            if self._clock() > end:
                raise RigError(self._silence(timeout_ns))
            self._wait(_POLL_NS)
        assert self.hello is not None
        return self.hello

    def _silence(self, timeout_ns: int) -> str:
        seen = self.line.statistics
        seconds = timeout_ns * 1e-9
        if self.hello is not None:
            return f"the rig said hello but answered no PING within {seconds:g} s"
        if seen.received > 0 and seen.decoder.frames == 0:
            return (
                f"{seen.received} bytes came but no frame within {seconds:g} s: another device, "
                f"another baud rate than {constants.BAUD}, or old firmware; flash it anew"
            )
        return (
            f"nothing answered within {seconds:g} s: is the firmware flashed and is this the "
            "right port?"
        )

    def renew(self, base: BaseMap | None = None) -> None:
        """Forget every estimate, as if no frame had been seen yet.

        Parameters
        ----------
        base : map of the base's IMU where the base turns from now on
        """
        self.fusion = Fusion(self.calibration, self._noise, base)
        self._delay_known = False

    def poll(self) -> list[SensorFrame]:
        """Return the sensor frames that have arrived; never blocks.

        Raises
        ------
        RigError : a device of another version has appeared on the line
        """
        arrived = self._early + self.line.poll()
        self._early = []
        self.states = []
        if not self.line.connected:
            gaps = self.line.statistics.gaps
            self._lose(Sign.LOST, gaps[-1].reason if gaps else "it is not connected")
            return []
        if self.line.generation != self._generation:
            self._generation = self.line.generation
            self._move(Sign.OPENED)
        if arrived:
            self._heard_ns = self._clock()
        elif self._clock() - self._heard_ns > SILENCE_NS:
            self._lose(Sign.SILENT, "it fell silent")
        frames = [f for event in arrived if (f := self._take(event)) is not None]
        self._speak()
        return frames

    def listen(self) -> bool:
        """Take in a PONG between two polls and keep the rest for the next; whether one is awaited.

        A loop that polls every 4 ms would else date it up to 4 ms late, and the estimate of the
        device's clock would be wrong by half of that.
        """
        if not self._clock() < self._pong_until:
            return False
        for event in self.line.poll():
            if isinstance(event.message, Pong):
                self._take(event)
            else:
                self._early.append(event)
        return self._pong_until > 0

    def send(self, command: GimbalCommand, turntable: float = 0.0) -> int | None:
        """Send a command; return its sequence number, None when it could not be sent.

        Parameters
        ----------
        command : gimbal angles [rad]
        turntable : pulse width of the third servo, 0 for neutral [s]
        """
        if self.phase is not Phase.READY:
            return None
        x, y = self.calibration.pulses(command.angle)
        return self.send_pulses(x, y, turntable)

    def send_pulses(self, x: float, y: float, turntable: float = 0.0) -> int | None:
        """Send pulse widths [s], held within the limits the device announced."""
        if self._converter is None or self.hello is None:
            return None
        wanted = [self._converter.ticks(p) for p in (x, y, turntable)]
        low, high = self.hello.minimum, self.hello.maximum
        held = [min(max(w, a), b) if w else 0 for w, a, b in zip(wanted, low, high, strict=True)]
        return self.line.send(Command((held[0], held[1], held[2]), TIMEOUT_MS, Mode.DRIVE))

    def neutral(self) -> None:
        """Send the servos to neutral and leave them armed."""
        self.line.send(Command((0, 0, 0), TIMEOUT_MS, Mode.NEUTRAL))

    def name(self, serial: int) -> None:
        """Give a board without a number one, and ask for it."""
        self.line.send(Name(serial))
        self.line.send(HelloRequest())

    def configure(self, config: Config) -> None:
        """Change the device's settings and ask what it made of them."""
        self.line.send(config)
        self.line.send(HelloRequest())

    def close(self) -> None:
        """Disarm, which drives to neutral at once, and give the line back."""
        self.line.send(Disarm())
        self.line.close()

    @property
    def turntable_limits(self) -> Pair:
        """Shortest and longest pulse of the third servo, as the device announced them [s]."""
        if self.hello is None:
            return (
                constants.PULSE_MINIMUM * constants.TICK,
                constants.PULSE_MAXIMUM * constants.TICK,
            )
        tick = self.hello.tick_ns * 1e-9
        return self.hello.minimum[2] * tick, self.hello.maximum[2] * tick

    @property
    def faults(self) -> tuple[Fault, ...]:
        """The sensors that are known to be wrong."""
        return self.fusion.monitor.faults

    @property
    def health(self) -> str:
        """Health of connection and sensors in one line, "ok" when there is nothing to say."""
        if self.phase is not Phase.READY:
            return f"rig {self.phase}"
        return self.fusion.monitor.describe()

    @property
    def statistics(self) -> RigStatistics:
        """Losses and timing so far."""
        s, t = self.line.statistics, self._latest
        return RigStatistics(
            frames=self._frames,
            lost=s.decoder.lost,
            crc_errors=s.decoder.crc_errors,
            device_lost=t.lost if t else 0,
            device_crc_errors=t.crc_errors if t else 0,
            skipped=t.skipped if t else 0,
            refused=s.refused,
            gaps=s.gaps,
            round_trips=self.estimate.added,
            round_trip_ns=self.estimate.round_trip_ns,
            shortest_ns=self.estimate.shortest_ns,
            skew=self.estimate.skew,
        )

    def _lose(self, sign: Sign, reason: str) -> None:
        if self.phase is Phase.READY:
            self.reason, self.started = reason, ""
        self._move(sign)

    def _move(self, sign: Sign) -> None:
        new = TRANSITIONS.get((self.phase, sign), self.phase)
        if new is self.phase:
            return
        self.phase = new
        self._next_ns = 0
        if new in (Phase.GREETING, Phase.SYNCING):
            self.estimate = ClockEstimate(self.estimate.skew)
            self._device_us = None
            self._delay_known = False
            self.fusion.restart()
        elif new is Phase.READY:
            self.session += 1
            self._unarmed_ns, self._arm_ns = None, 0
            if self._arm:
                self._ask_to_arm()

    def _ask_to_arm(self) -> None:
        self.line.send(Arm())
        self._arm_ns = self._clock() + ARM_NS

    def _obeys(self, flags: int) -> bool:
        """Ask again where an ARM was lost; false for a rig that refuses for long."""
        now = self._clock()
        if not self._arm or flags & Flags.ARMED:
            self._unarmed_ns = None
        elif self._unarmed_ns is None:
            self._unarmed_ns = now
        elif now - self._unarmed_ns > ARMING_NS:
            self._lose(Sign.SILENT, "it refuses to be armed")
            return False
        elif now >= self._arm_ns:
            self._ask_to_arm()
        return True

    def _speak(self) -> None:
        """Send what the phase asks for, when it is time."""
        now = self._clock()
        if now < self._next_ns:
            return
        if self.phase is Phase.GREETING:
            self.line.send(HelloRequest())
            self._next_ns = now + GREETING_NS
        elif self.phase in (Phase.SYNCING, Phase.READY):
            self.line.send(Ping(now))
            self._pong_until = now + PONG_NS
            self._next_ns = now + (PING_NS if self.phase is Phase.READY else SYNC_NS)

    def _take(self, event: Frame) -> SensorFrame | None:
        message = event.message
        if isinstance(message, Telemetry):
            return self._telemetry(message)
        if isinstance(message, Hello):
            self._greet(message, event.sequence)
        elif isinstance(message, Pong) and self.phase in (Phase.SYNCING, Phase.READY):
            self._sync(message)
        elif isinstance(message, Unknown) and message.type_id == layout(Hello).type_id:
            raise RigError(
                "the rig's firmware is of another version (its HELLO has another length); flash "
                "the one in hardware/firmware"
            )
        return None

    def _greet(self, hello: Hello, sequence: int) -> None:
        if hello.protocol != PROTOCOL or hello.layout != LAYOUT:
            major, minor, patch = hello.firmware
            raise RigError(
                f"the rig speaks protocol {hello.protocol} (layout {hello.layout:04x}, firmware "
                f"{major}.{minor}.{patch}), this program protocol {PROTOCOL} (layout "
                f"{LAYOUT:04x}); flash the firmware in hardware/firmware"
            )
        if self.calibrated and self.calibration.rig not in (0, hello.serial):
            this = f"{hello.serial:08x}" if hello.serial else "without a number"
            raise RigError(
                f"the calibration is of rig {self.calibration.rig:08x}, this one is {this}; run"
                " `twin calibrate` on it"
            )
        if 0 in (hello.tick_ns, hello.adc_levels, hello.gyro_range_dps):
            raise RigError("the rig's HELLO has a scale of zero; flash the firmware in hardware/")
        # Within a session only a low-pass that was set anew makes the gyro later.
        self._delay_known &= self.hello is not None and self.hello.dlpf == hello.dlpf
        self.hello = hello
        self._converter = Converter(hello)
        # Number 0 is a boot; any other answers our request and changes nothing once we are ready.
        if self.phase is Phase.GREETING or sequence == 0:
            self._lose(Sign.HELLO, "it started again")
        if sequence == 0:
            causes = [c for bit, c in enumerate(CAUSES) if hello.reset_cause >> bit & 1]
            self.started = f"after {' and '.join(causes) or 'a start'}"

    def _sync(self, pong: Pong) -> None:
        self._pong_until = 0
        start = self._unwrapped(pong.received_us, early=bool(self._early))
        if start is None:
            return
        out = start + ((pong.sent_us - pong.received_us) & 0xFFFF_FFFF)
        self.estimate.add(pong.host_ns, self.line.polled_ns, start, out)
        if self.phase is Phase.SYNCING and self.estimate.count >= SYNC_COUNT:
            self._move(Sign.SYNCED)

    def _unwrapped(self, stamp: int, *, early: bool = False) -> int | None:
        """Device stamp without its wraps [µs]; None where the device has started its clock anew.

        Its HELLO says so as well, but may be lost.

        Parameters
        ----------
        early : it may have overtaken frames that still wait, as a PONG that `listen` takes
        """
        if self._device_us is None:
            self._device_us = stamp
            return stamp
        found = unwrap(self._device_us, stamp)
        if found < self._device_us - BACK_US:
            self._lose(Sign.SILENT, "its clock went back: it started again")
            return None
        ahead = self.phase is Phase.READY and (
            self.estimate.host_ns(found) > self._clock() + AHEAD_NS
        )
        if ahead:
            self._lose(Sign.SILENT, "its clock is ahead: it started again, or this computer slept")
            return None
        if not early:
            self._device_us = max(self._device_us, found)
        return found

    def _telemetry(self, t: Telemetry) -> SensorFrame | None:
        self._latest = t
        if self._converter is None or self.phase is not Phase.READY:
            return None
        device_us = self._unwrapped(t.device_us)
        if device_us is None:
            return None
        if not self._obeys(t.flags):
            return None
        if not self._delay_known and self.hello is not None and t.flags & Flags.HOLDER_IMU:
            low_pass = GYRO_DELAY_S[min(self.hello.dlpf, constants.DLPF_HIGHEST)]
            self.gyro_delay = low_pass + t.imu_age_us[0] * 1e-6
            self.fusion.set_gyro_delay(self.gyro_delay)
            self._delay_known = True
        time_ns = self.estimate.host_ns(device_us)
        frame = self._converter.frame(t, time_ns, device_us)
        if self._fuse:
            self.state = self.fusion.update(frame)
            self.states.append(self.state)
        self._frames += 1
        return frame
