"""The message table: Python classes; the firmware's header and the manual are generated from it.

Sources of the numbers: ATmega328P datasheet (clock, ADC, Timer1), MPU-6000/6050 register map
revision 4.2 (ranges, DLPF); servo pulse range as sold for 9 g hobby servos.
"""

import math
from enum import IntEnum, IntFlag
from typing import Annotated

from hardware.parts import STANDARD_GRAVITY
from hardware.protocol.wire import Wire, message

PROTOCOL = 1
"""Version of the protocol; raised when the meaning of a frame changes. LAYOUT shows its layout."""

FIRMWARE = (1, 0, 0)
"""Version of the firmware in this tree."""

BAUD = 500_000  # exact with a 16 MHz clock and U2X: UBRR = 3
CLOCK_HZ = 16_000_000
TICK_NS = 500  # Timer1 at 16 MHz / 8
PWM_PERIOD_US = 20_000
PULSE_NEUTRAL = 3_000  # 1.5 ms in ticks
PULSE_MINIMUM, PULSE_MAXIMUM = 2_000, 4_000  # limits after boot: 1…2 ms
PULSE_LOWEST, PULSE_HIGHEST = 1_000, 5_000  # range of CONFIG's limits: 0.5…2.5 ms
TIMEOUT_LONGEST_MS = 2_000
TELEMETRY_PERIOD_MS = 2
TELEMETRY_PERIOD_SHORTEST_MS, TELEMETRY_PERIOD_LONGEST_MS = 2, 250
ADC_LEVELS = 1_024  # code = V / V_ref · 1024
GYRO_RANGE_DPS = 500  # FS_SEL 1: 32768 counts
ACCELEROMETER_RANGE_G = 4  # AFS_SEL 1: 32768 counts
DLPF = 2  # gyro bandwidth 98 Hz
DLPF_HIGHEST = 6
SERIAL_NONE, SERIAL_BLANK = 0, 0xFFFF_FFFF  # no number yet; an erased EEPROM

# Arduino names: digital pins by number, analog pins as 14 + n (A0 = 14).
SERVO_PINS = (9, 10, 3)  # OC1A, OC1B, OC2B
POTENTIOMETER_PINS = (14, 15, 16, 17)
JOYSTICK_PINS = (20, 21)
SWITCH_PINS = (2, 4, 5, 7)
IMU_ADDRESSES = (0x68, 0x69)

TICK = TICK_NS / 1e9
PWM_PERIOD = PWM_PERIOD_US / 1e6
IMU_COUNTS = 32_768  # at full scale: registers of 16 bit, signed
GYRO_SCALE = math.radians(GYRO_RANGE_DPS) / IMU_COUNTS
ACCELEROMETER_SCALE = ACCELEROMETER_RANGE_G * STANDARD_GRAVITY / IMU_COUNTS


class Board(IntEnum):
    """Kind of board."""

    NANO = 1
    EMULATOR = 2
    RASPBERRY_PI = 3


class Mode(IntEnum):
    """Mode of a COMMAND."""

    NEUTRAL = 0
    DRIVE = 1


class Flags(IntFlag):
    """Status bits of TELEMETRY."""

    ARMED = 1 << 0  # commands are obeyed
    DRIVING = 1 << 1  # a command is in force and has not timed out
    TIMED_OUT = 1 << 2  # commands stopped while driving; set until ARM
    CLAMPED = 1 << 3  # the latest command was outside the limits
    REFUSED = 1 << 4  # the latest COMMAND, ARM, DISARM, CONFIG or NAME was not obeyed
    HOLDER_IMU = 1 << 5  # this frame has a new reading of 0x68
    BASE_IMU = 1 << 6  # this frame has a new reading of 0x69
    RECEIVE_OVERRUN = 1 << 7  # bytes from the host were lost; set until HELLO_REQUEST
    PULSE_UNTIMED = 1 << 8  # `pulse` is the one wanted; when it goes into force is not known


Pair = tuple[int, int]
Triple = tuple[int, int, int]
Quad = tuple[int, int, int, int]

_pulse = "servo x, servo y, turntable"


@message(0x01)
class HelloRequest:
    """Requests HELLO."""


@message(0x02)
class Command:
    """Pulse widths to drive until the next command or the timeout."""

    pulse: Annotated[Triple, Wire("H", "0.5 µs", f"{_pulse}; 0 for neutral", 3)]
    timeout_ms: Annotated[int, Wire("H", "ms", "neutral if no command follows within it; 1…2000")]
    mode: Annotated[int, Wire("B", "", "0 neutral, 1 drive")]


@message(0x03)
class Ping:
    """Requests PONG."""

    host_ns: Annotated[int, Wire("Q", "ns", "time stamp of the host's clock")]


@message(0x04)
class Arm:
    """Enables commands; clears TIMED_OUT."""


@message(0x05)
class Disarm:
    """Servos to neutral; disables commands."""


@message(0x06)
class Config:
    """Settings; refused as a whole if one is out of range."""

    telemetry_period_ms: Annotated[int, Wire("B", "ms", "2…250")]
    dlpf: Annotated[int, Wire("B", "", "low-pass setting of both IMUs, 0…6")]
    neutral: Annotated[Triple, Wire("H", "0.5 µs", f"{_pulse}; within the limits", 3)]
    minimum: Annotated[Triple, Wire("H", "0.5 µs", f"{_pulse}; 1000 or more", 3)]
    maximum: Annotated[Triple, Wire("H", "0.5 µs", f"{_pulse}; 5000 or less", 3)]


@message(0x07)
class Name:
    """Serial number for a board without one, kept without power; refused by a board with one."""

    serial: Annotated[int, Wire("I", "", "1…0xFFFFFFFE")]


@message(0x81)
class Hello:
    """Identity, versions, scales and settings of the board; sent at boot and on request."""

    # `protocol` and `layout` are first in every version, so that any version can read them.
    protocol: Annotated[int, Wire("H", "", "version of the protocol")]
    layout: Annotated[int, Wire("H", "", "checksum of the message table")]
    firmware: Annotated[Triple, Wire("B", "", "version: major, minor, patch", 3)]
    build: Annotated[int, Wire("I", "", "first four bytes of the sources' SHA-256")]
    serial: Annotated[int, Wire("I", "", "serial number of the board; 0 without one")]
    board: Annotated[int, Wire("B", "", "1 Nano, 2 emulator, 3 Raspberry Pi")]
    reset_cause: Annotated[
        int, Wire("B", "", "MCUSR: bit 0 power, 1 reset pin, 2 brown-out, 3 watchdog; 0 unknown")
    ]
    servo_pins: Annotated[Triple, Wire("B", "", _pulse, 3)]
    potentiometer_pins: Annotated[Quad, Wire("B", "", "x_a, x_b, y_a, y_b", 4)]
    joystick_pins: Annotated[Pair, Wire("B", "", "x, y", 2)]
    switch_pins: Annotated[Quad, Wire("B", "", "+x, -x, +y, -y", 4)]
    imu_addresses: Annotated[Pair, Wire("B", "", "holder, base", 2)]
    tick_ns: Annotated[int, Wire("H", "ns", "unit of pulse widths")]
    pwm_period_us: Annotated[int, Wire("H", "µs", "servo frame")]
    adc_levels: Annotated[int, Wire("H", "", "codes at full supply")]
    gyro_range_dps: Annotated[int, Wire("H", "°/s", "32768 counts")]
    accelerometer_range_g: Annotated[int, Wire("B", "g", "32768 counts")]
    telemetry_period_ms: Annotated[int, Wire("B", "ms", "as configured")]
    dlpf: Annotated[int, Wire("B", "", "low-pass setting of both IMUs")]
    neutral: Annotated[Triple, Wire("H", "0.5 µs", _pulse, 3)]
    minimum: Annotated[Triple, Wire("H", "0.5 µs", _pulse, 3)]
    maximum: Annotated[Triple, Wire("H", "0.5 µs", _pulse, 3)]
    imu_identity: Annotated[
        Pair,
        Wire("B", "", "WHO_AM_I of holder and base: 0x68 MPU6050, 0x70 MPU6500; 0 unread", 2),
    ]


@message(0x82)
class Telemetry:
    """One sample of all sensors, with status and counters."""

    device_us: Annotated[int, Wire("I", "µs", "device clock at the sample; wraps")]
    frame_us: Annotated[int, Wire("H", "µs", "age of the running PWM frame at the sample")]
    potentiometer: Annotated[Quad, Wire("H", "1/1024", "x_a, x_b, y_a, y_b", 4)]
    holder_gyro: Annotated[Triple, Wire("h", "count", "MPU6050 axes x, y, z", 3)]
    holder_accelerometer: Annotated[Triple, Wire("h", "count", "MPU6050 axes x, y, z", 3)]
    base_gyro: Annotated[Triple, Wire("h", "count", "MPU6050 axes x, y, z", 3)]
    base_accelerometer: Annotated[Triple, Wire("h", "count", "MPU6050 axes x, y, z", 3)]
    imu_age_us: Annotated[Pair, Wire("H", "µs", "age of holder and base reading at the sample", 2)]
    pulse: Annotated[Triple, Wire("H", "0.5 µs", f"in force: {_pulse}", 3)]
    switches: Annotated[int, Wire("B", "", "bits 0…3 closed: +x, -x, +y, -y")]
    joystick: Annotated[Pair, Wire("H", "1/1024", "x, y", 2)]
    flags: Annotated[int, Wire("H", "", "bits of `Flags`")]
    crc_errors: Annotated[int, Wire("H", "", "frames from the host that failed; wraps")]
    lost: Annotated[int, Wire("H", "", "sequence numbers missed from the host; wraps")]
    overruns: Annotated[int, Wire("H", "", "bytes from the host lost for lack of room; wraps")]
    skipped: Annotated[int, Wire("H", "", "frames to the host dropped for lack of room; wraps")]
    acknowledged: Annotated[int, Wire("H", "", "sequence number of the last host frame obeyed")]


@message(0x83)
class Pong:
    """Answer to PING, for clock offset and skew."""

    host_ns: Annotated[int, Wire("Q", "ns", "as received")]
    received_us: Annotated[int, Wire("I", "µs", "device clock at PING's last byte")]
    sent_us: Annotated[int, Wire("I", "µs", "device clock at PONG's first byte")]


class Refusal(IntEnum):
    """Reason why a server on TCP refuses a host."""

    KEY = 1  # the host has another key
    BUSY = 2  # another host is connected


_nonce = "random number of this connection"


@message(0x10)
class Proof:
    """First frame of a host on TCP: proof that it has the session key."""

    nonce: Annotated[tuple[int, ...], Wire("B", "", _nonce, 16)]
    proof: Annotated[
        tuple[int, ...], Wire("B", "", "HMAC-SHA256 of `tvc host`, CHALLENGE's nonce, nonce", 32)
    ]


@message(0x90)
class Challenge:
    """First frame of a server on TCP: asks the host for PROOF."""

    nonce: Annotated[tuple[int, ...], Wire("B", "", _nonce, 16)]


@message(0x91)
class Welcome:
    """The host is connected; proof that the server has the session key too."""

    proof: Annotated[
        tuple[int, ...], Wire("B", "", "HMAC-SHA256 of `tvc device`, CHALLENGE's nonce, nonce", 32)
    ]


@message(0x92)
class Refused:
    """The host is not connected; the server closes the connection."""

    reason: Annotated[int, Wire("B", "", "1 another session key, 2 in use by another host")]


SessionMessage = Proof | Challenge | Welcome | Refused
SESSION: tuple[type[SessionMessage], ...] = (Proof, Challenge, Welcome, Refused)
"""Messages between the ends of a TCP connection; no board sees them, and LAYOUT omits them."""

Message = (
    HelloRequest
    | Command
    | Ping
    | Arm
    | Disarm
    | Config
    | Name
    | Hello
    | Telemetry
    | Pong
    | SessionMessage
)
MESSAGES: tuple[type[Message], ...] = (
    HelloRequest,
    Command,
    Ping,
    Arm,
    Disarm,
    Config,
    Name,
    Hello,
    Telemetry,
    Pong,
)
