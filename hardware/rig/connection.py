"""Connection to a rig: handshake, clock synchronisation, arming, loss and reconnection.

The phases of a connection are a table; every poll moves along it, so a pulled cable leads back to
the greeting without a thread and without the caller's help. Nothing here blocks but `connect`.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable

from hardware.protocol import (
    Arm,
    Flags,
    Frame,
    Hello,
    HelloRequest,
    Ping,
    Pong,
    Unknown,
    constants,
    default_config,
    layout,
)
from hardware.rig.clock import ClockEstimate
from hardware.rig.hello import RigError, check, settings
from hardware.rig.line import Line
from hardware.rig.phases import TRANSITIONS, Phase, Sign
from hardware.rig.reading import Converter, unwrap

GREETING_NS = 100_000_000  # between HELLO_REQUESTs
SYNC_NS = 10_000_000  # between PINGs until the clock is synchronised
PING_NS = 200_000_000  # and later
SYNC_COUNT = 10
PONG_NS = 20_000_000  # after a PING; then its PONG counts as lost
CONNECT_NS = 4_000_000_000  # a Nano's bootloader takes 2 s
SILENCE_NS = 300_000_000  # without a frame on an open line: hung, or only half plugged in
ARM_NS, ARMING_NS = 100_000_000, 500_000_000  # between ARMs, and until the rig is given up
# No stamp is so much older than the one before it, or from so far in the future.
BACK_US, AHEAD_NS = 50_000, 50_000_000
MOST_CORRECTIONS = 20  # answers that arrive late count as well
CAUSES = ("power-up", "a reset", "a brown-out", "its watchdog")  # bits of HELLO's reset_cause
_POLL_NS = 1_000_000


class Connection(ABC):
    """State of the connection to one rig; `hardware.rig.Rig` adds readings and commands.

    Parameters
    ----------
    line : `hardware.link.Link` or `LockstepLine`
    serial : number of the board to accept; 0 accepts any
    clock : experiment time [ns], the one the line uses
    wait : lets time pass [ns] while `connect` waits
    arm : arm the servos once connected, with the device's settings restored; else both are left

    Attributes
    ----------
    settings : that the device must have
    hello : latest HELLO of the device
    phase : state of the connection
    estimate : the device's clock against the experiment's
    session : number of times the rig has become ready; estimates begin anew with each
    reason : why the rig was last lost
    started : cause of the device's latest start since it was last ready, "" without one
    """

    def __init__(
        self,
        line: Line,
        serial: int,
        clock: Callable[[], int],
        wait: Callable[[int], None],
        *,
        arm: bool,
    ) -> None:
        self.line = line
        self.settings = default_config()
        self.hello: Hello | None = None
        self.phase = Phase.AWAY
        self.estimate = ClockEstimate()
        self.session = 0
        self.reason = self.started = ""
        self._serial = serial
        self._clock, self._wait, self._arm = clock, wait, arm
        self._converter: Converter | None = None
        self._generation = 0
        self._corrections = 0  # CONFIGs sent since the settings were last right
        self._next_ns = 0
        self._received_ns = 0
        self._device_us: int | None = None
        self._unarmed_ns: int | None = None
        self._arm_ns = 0
        self._delay_known = False
        self._pong_until = 0  # when an awaited PONG is given up; 0 while none is awaited
        self._early: list[Frame] = []

    @abstractmethod
    def poll(self) -> object:
        """Receive and send what is due; raises RigError for a device of another version."""

    @abstractmethod
    def _restart(self) -> None:
        """Reset estimates that depend on the device's clock."""

    def connect(self, timeout_ns: int = CONNECT_NS) -> Hello:
        """Wait until the rig is ready and return its HELLO.

        Raises
        ------
        RigError : no answer, another device, or a rig of another version
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

    def listen(self) -> bool:
        """Receive a PONG between two polls and keep other frames; true while one is awaited.

        A loop that polls every 4 ms would else date it up to 4 ms late, and the estimate of the
        device's clock would be wrong by half of that.
        """
        if not self._clock() < self._pong_until:
            return False
        for event in self.line.poll():
            if isinstance(event.message, Pong):
                self._handshake(event)
            else:
                self._early.append(event)
        return self._pong_until > 0

    def _arrived(self) -> list[Frame]:
        """Return the frames on the line, and move along the phases where it was lost or opened."""
        arrived = self._early + self.line.poll()
        self._early = []
        if not self.line.connected:
            gaps = self.line.statistics.gaps
            self._lose(Sign.LOST, gaps[-1].reason if gaps else "it is not connected")
            return []
        if self.line.generation != self._generation:
            self._generation = self.line.generation
            self._move(Sign.OPENED)
        if arrived:
            self._received_ns = self._clock()
        elif self._clock() - self._received_ns > SILENCE_NS:
            self._lose(Sign.SILENT, "it fell silent")
        return arrived

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
            self._restart()
        elif new is Phase.READY:
            self.session += 1
            self._unarmed_ns, self._arm_ns = None, 0
            if self._arm:
                self._send_arm()

    def _send_arm(self) -> None:
        self.line.send(Arm())
        self._arm_ns = self._clock() + ARM_NS

    def _armed(self, flags: int) -> bool:
        """Send ARM again where it was lost; false for a rig that refuses it for long."""
        now = self._clock()
        if not self._arm or flags & Flags.ARMED:
            self._unarmed_ns = None
        elif self._unarmed_ns is None:
            self._unarmed_ns = now
        elif now - self._unarmed_ns > ARMING_NS:
            self._lose(Sign.SILENT, "it refuses to be armed")
            return False
        elif now >= self._arm_ns:
            self._send_arm()
        return True

    def _send_due(self) -> None:
        """Send the message of the phase when it is due."""
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

    def _handshake(self, event: Frame) -> None:
        """Process a message that is not telemetry."""
        message = event.message
        if isinstance(message, Hello):
            self._greet(message, event.sequence)
        elif isinstance(message, Pong) and self.phase in (Phase.SYNCING, Phase.READY):
            self._sync(message)
        elif isinstance(message, Unknown) and message.type_id == layout(Hello).type_id:
            raise RigError(
                "the rig's firmware is of another version (its HELLO has another length); flash "
                "the one in hardware/firmware"
            )

    def _greet(self, hello: Hello, sequence: int) -> None:
        check(hello, self._serial)
        # Within a session another low-pass, or knowing which chip it is, changes the gyro's delay.
        before = self.hello
        self._delay_known &= before is not None and before.dlpf == hello.dlpf
        self._delay_known &= before is not None and before.imu_identity == hello.imu_identity
        self.hello = hello
        self._converter = Converter(hello)
        # Number 0 is a boot; any other answers a request and changes nothing once the rig is ready.
        right = self._restored(hello)
        if (self.phase is Phase.GREETING and right) or sequence == 0:
            self._lose(Sign.HELLO, "it started again")
        if sequence == 0:
            causes = [c for bit, c in enumerate(CAUSES) if hello.reset_cause >> bit & 1]
            self.started = f"after {' and '.join(causes) or 'a start'}"

    def _restored(self, hello: Hello) -> bool:
        """Whether the device has the settings of this run; else send them and ask again.

        Another host may have left its own, such as a neutral position or limits.
        """
        if not self._arm or settings(hello) == self.settings:
            self._corrections = 0
            return True
        if self._corrections >= MOST_CORRECTIONS:
            raise RigError("the rig does not take this run's settings; restart it")
        self._corrections += 1
        self.line.send(self.settings)
        self.line.send(HelloRequest())
        return False

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
        """Device stamp without its wraps [µs]; None where the device has restarted its clock.

        Its HELLO would show that as well, but may be lost.

        Parameters
        ----------
        early : it may have overtaken frames that still wait, as a PONG that `listen` receives
        """
        if self._device_us is None:
            self._device_us = stamp
            return stamp
        time_us = unwrap(self._device_us, stamp)
        if time_us < self._device_us - BACK_US:
            self._lose(Sign.SILENT, "its clock went back: it started again")
            return None
        ahead = self.phase is Phase.READY and (
            self.estimate.host_ns(time_us) > self._clock() + AHEAD_NS
        )
        if ahead:
            self._lose(Sign.SILENT, "its clock is ahead: it started again, or this computer slept")
            return None
        if not early:
            self._device_us = max(self._device_us, time_us)
        return time_us
