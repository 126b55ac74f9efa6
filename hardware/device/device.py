"""The firmware's behaviour in Python: frames to pulse widths and frames.

Follows `firmware/tvc_gimbal/core.cpp` decision by decision; the Raspberry Pi gateway runs it too.
"""

from dataclasses import dataclass

from hardware.protocol import (
    BAUD,
    Arm,
    Board,
    Command,
    Config,
    Decoder,
    Disarm,
    Encoder,
    Flags,
    HelloRequest,
    Message,
    Mode,
    Name,
    Ping,
    Pong,
    Telemetry,
    constants,
    default_config,
    hello,
    plausible,
)

LOOP_US = 1000  # period of a board's main loop, on its own clock
BYTE_US = 10_000_000 // BAUD  # start bit, eight data bits, stop bit
TRANSMIT_ROOM = 255  # bytes; a frame without room is dropped and counted
_WRAP = 0xFFFF_FFFF
_INPUT = Flags.HOLDER_IMU | Flags.BASE_IMU

Ticks = tuple[int, int, int]


@dataclass(frozen=True, slots=True)
class Sample:
    """Sensor readings of one telemetry frame; units as in `Telemetry`."""

    device_us: int
    frame_us: int
    potentiometer: tuple[int, int, int, int]
    imu: list[int]  # (12,) gyro and accelerometer of holder, then of base
    imu_age_us: tuple[int, int]
    imu_fresh: tuple[bool, bool]
    pulse: Ticks
    switches: int
    joystick: tuple[int, int]


class Device:
    """Protocol, limits, timeout and arming of one rig.

    Parameters
    ----------
    board : kind of board
    build : identifier of its program, u32
    serial : serial number, u32; 0 without one

    Attributes
    ----------
    imu_identity : WHO_AM_I of holder and base; 0 before it is read
    """

    def __init__(
        self, board: Board, build: int, reset_cause: int = 1, serial: int = constants.SERIAL_NONE
    ) -> None:
        self.board = board
        self.build = build
        self.serial = serial
        self.reset_cause = reset_cause
        self.config = default_config()
        self.transmit = bytearray()
        self.pulse: Ticks = self.config.neutral
        self.flags = 0
        self.imu_identity = (0, 0)
        self._encoder = Encoder()
        self._decoder = Decoder()
        self._acknowledged = 0
        self._deadline_us = 0
        self._skipped = 0

    @property
    def armed(self) -> bool:
        """Whether commands are obeyed."""
        return bool(self.flags & Flags.ARMED)

    def boot(self) -> None:
        """Send HELLO, after a delimiter that ends whatever the line carried before."""
        self.transmit += b"\0"
        self.hello()

    def hello(self) -> None:
        """Send HELLO."""
        self._send(
            hello(
                self.board,
                self.build,
                self.config,
                self.reset_cause,
                self.serial,
                self.imu_identity,
            )
        )

    def receive(self, data: bytes, received_us: int, now_us: int) -> None:
        """Process bytes, the last of which arrived at `received_us` of the device's clock."""
        self._decoder.receive_data(data)
        for frame in self._decoder:
            if self._obey(frame.message, received_us, now_us):
                self._acknowledged = frame.sequence

    def _obey(self, message: object, received_us: int, now_us: int) -> bool:
        if isinstance(message, HelloRequest):
            self.hello()
            return True
        if isinstance(message, Ping):
            self._pong(message, received_us, now_us)
            return True
        obeyed = False
        if isinstance(message, Arm | Disarm):
            self._arm(isinstance(message, Arm))
            obeyed = True
        elif isinstance(message, Command):
            obeyed = self._command(message, received_us)
        elif isinstance(message, Config) and plausible(message):
            self.config = message
            self._neutral()
            obeyed = True
        elif isinstance(message, Name):
            obeyed = self._name(message.serial)
        self._set(Flags.REFUSED, not obeyed)
        return obeyed

    def _set(self, flag: int, on: bool) -> None:
        self.flags = self.flags | flag if on else self.flags & ~flag

    def _neutral(self) -> None:
        self.pulse = self.config.neutral
        self._set(Flags.DRIVING, False)

    def _arm(self, armed: bool) -> None:
        self._neutral()
        self._set(Flags.ARMED, armed)
        if armed:
            self._set(Flags.TIMED_OUT, False)

    def _name(self, serial: int) -> bool:
        unnamed = self.serial == constants.SERIAL_NONE
        if not unnamed or serial in (constants.SERIAL_NONE, constants.SERIAL_BLANK):
            return False
        self.serial = serial
        return True

    def _command(self, command: Command, received_us: int) -> bool:
        if not self.armed or command.timeout_ms == 0 or command.mode > Mode.DRIVE:
            return False
        self._set(Flags.CLAMPED, False)
        if command.mode == Mode.NEUTRAL:
            self._neutral()
            return True
        c = self.config
        wanted = [p or n for p, n in zip(command.pulse, c.neutral, strict=True)]
        held = [min(max(w, a), b) for w, a, b in zip(wanted, c.minimum, c.maximum, strict=True)]
        self._set(Flags.CLAMPED, held != wanted)
        self.pulse = (held[0], held[1], held[2])
        timeout = min(command.timeout_ms, constants.TIMEOUT_LONGEST_MS)
        self._deadline_us = received_us + 1000 * timeout
        self._set(Flags.DRIVING, True)
        return True

    def _pong(self, ping: Ping, received_us: int, now_us: int) -> None:
        queued = len(self.transmit)
        sent = now_us + ((queued + 2) * BYTE_US if queued else 0)
        self._send(Pong(ping.host_ns, received_us & _WRAP, sent & _WRAP))

    def update(self, now_us: int) -> None:
        """Go to neutral once the command in force has timed out."""
        if self.flags & Flags.DRIVING and now_us >= self._deadline_us:
            self._neutral()
            self._set(Flags.TIMED_OUT, True)

    def report(self, s: Sample) -> None:
        """Send one telemetry frame."""
        fresh = Flags.HOLDER_IMU * s.imu_fresh[0] | Flags.BASE_IMU * s.imu_fresh[1]
        self.flags = self.flags & ~_INPUT | fresh
        i, seen = s.imu, self._decoder.counters
        self._send(
            Telemetry(
                device_us=s.device_us & _WRAP,
                frame_us=s.frame_us,
                potentiometer=s.potentiometer,
                holder_gyro=(i[0], i[1], i[2]),
                holder_accelerometer=(i[3], i[4], i[5]),
                base_gyro=(i[6], i[7], i[8]),
                base_accelerometer=(i[9], i[10], i[11]),
                imu_age_us=s.imu_age_us,
                pulse=s.pulse,
                switches=s.switches,
                joystick=s.joystick,
                flags=int(self.flags),
                crc_errors=seen.crc_errors & 0xFFFF,
                lost=seen.lost & 0xFFFF,
                overruns=0,
                skipped=self._skipped,
                acknowledged=self._acknowledged,
            )
        )

    def _send(self, message: Message) -> None:
        sequence = self._encoder.sequence
        data = self._encoder.encode(message)
        if len(self.transmit) + len(data) > TRANSMIT_ROOM:
            self._skipped = (self._skipped + 1) & 0xFFFF
            self._encoder.sequence = sequence
            return
        self.transmit += data
