"""Every board of the project behind one interface, in steps of a millisecond."""

from abc import ABC, abstractmethod
from dataclasses import replace
from itertools import takewhile
from pathlib import Path

from hardware.device import BYTE_US, Device
from hardware.emulator import Emulator
from hardware.frames import Pair, Triple
from hardware.protocol import (
    Board,
    Decoder,
    Encoder,
    Flags,
    Frame,
    Hello,
    HelloRequest,
    Message,
    Telemetry,
    constants,
)
from hardware.simavr import SimulatedNano
from tests.hardware.core import BLANK, Core
from tests.hardware.fake_pi import FakePi, make_sysfs, pwm_value

FRAME_MS = constants.PWM_PERIOD_US // 1000
LINE = 1000 // BYTE_US  # bytes a millisecond at 500 kbaud
WAIT_MS = 5  # until telemetry shows what was sent: 0.3 ms on the line each way, 2 ms between frames


class Rig(ABC):
    """A board with a codec at the host's end of its line.

    Attributes
    ----------
    kind : in HELLO
    outputs : number of servo outputs
    stamp_us : resolution of PONG's arrival stamp [µs]
    """

    kind: Board
    outputs = 3
    stamp_us = 25

    def __init__(self) -> None:
        self.encoder, self.decoder = Encoder(), Decoder()
        self.time_ms = 0

    @abstractmethod
    def write(self, data: bytes) -> None:
        """Send bytes, beginning now."""

    @abstractmethod
    def step(self) -> bytes:
        """Advance a millisecond; return the bytes that have arrived."""

    @abstractmethod
    def output(self) -> tuple[int, ...]:
        """Latest pulse at each servo output, in ticks."""

    def close(self) -> None:  # noqa: B027  most have nothing to release
        """Release what it holds."""

    def send(self, *messages: Message) -> None:
        for message in messages:
            self.write(self.encoder.encode(message))

    def run(self, milliseconds: int) -> list[Frame]:
        frames: list[Frame] = []
        for _ in range(milliseconds):
            self.decoder.receive_data(self.step())
            frames += self.decoder
            self.time_ms += 1
        return frames

    def messages(self, kind: type, milliseconds: int) -> list:
        return [f.message for f in self.run(milliseconds) if isinstance(f.message, kind)]

    def telemetry(self, milliseconds: int = WAIT_MS) -> Telemetry:
        """Last telemetry of a while."""
        return self.messages(Telemetry, milliseconds)[-1]

    def after(self, *messages: Message) -> Telemetry:
        """Telemetry right after messages have been sent."""
        self.send(*messages)
        return self.telemetry()

    def hello(self) -> Hello:
        self.send(HelloRequest())
        return self.messages(Hello, WAIT_MS)[-1]

    def driven(self) -> tuple[int, ...]:
        """Pulses in force by telemetry after two servo frames; the outputs must agree."""
        shown = self.telemetry(2 * FRAME_MS + WAIT_MS).pulse
        assert self.output()[: self.outputs] == shown[: self.outputs]
        return shown


class EmulatorRig(Rig):
    """The board in Python."""

    kind = Board.EMULATOR

    def __init__(self, serial: int = 0) -> None:
        super().__init__()
        self.device = Emulator()
        self.device.device = Device(Board.EMULATOR, build=0, serial=serial)
        self.device.device.boot()

    def write(self, data: bytes) -> None:
        self.device.write(data)

    def step(self) -> bytes:
        self.device.advance_us(1000)
        return self.device.read()

    def output(self) -> tuple[int, ...]:
        return self.device._latched


class CoreRig(Rig):
    """The firmware's core on the host, with the timers and the line of a Nano around it."""

    kind = Board.NANO

    def __init__(self, core: Core, serial: int = 0) -> None:
        super().__init__()
        self.core = core.fresh()
        self.core.ask("room", 0)
        self.incoming: list[tuple[float, int]] = []
        self.line_free = 0.0  # when the host's last byte will have arrived [µs]
        answer = self.core.boot(serial=serial or constants.SERIAL_BLANK)
        self.latched, self.period = answer.pulse, answer.period_ms

    def write(self, data: bytes) -> None:
        at = max(self.line_free, 1000 * self.time_ms)
        self.incoming += [(at + BYTE_US * (k + 1), byte) for k, byte in enumerate(data)]
        self.line_free = at + BYTE_US * len(data)

    def step(self) -> bytes:
        now = 1000 * (self.time_ms + 1)
        arrived = list(takewhile(lambda item: item[0] <= now, self.incoming))
        del self.incoming[: len(arrived)]
        while arrived:  # each frame arrives at the stamp of its delimiter
            end = next((k for k, (_, byte) in enumerate(arrived) if not byte), len(arrived) - 1)
            data = bytes(byte for _, byte in arrived[: end + 1])
            self.core.receive(data, round(arrived[end][0]), now)
            del arrived[: end + 1]
        answer = self.core.update(now)
        self.period = answer.period_ms
        if now // 1000 % FRAME_MS == 0:
            self.latched = answer.pulse
        if now // 1000 % self.period == 0:
            frame_us = now % constants.PWM_PERIOD_US
            self.core.report(
                replace(
                    BLANK,
                    device_us=now,
                    frame_us=frame_us,
                    pulse=self.latched,
                    flags=Flags.HOLDER_IMU | Flags.BASE_IMU,
                )
            )
        sent = self.core.ask("room", LINE).sent
        self.core.ask("room", 0)
        return sent

    def output(self) -> tuple[int, ...]:
        return self.latched


class NanoRig(Rig):
    """The compiled firmware on a simulated ATmega328P."""

    kind = Board.NANO

    def __init__(self, serial: int = 0) -> None:
        super().__init__()
        self.nano = SimulatedNano(serial=serial or None)
        self.shown = [0, 0, 0]

    def write(self, data: bytes) -> None:
        self.nano.write(data)

    def step(self) -> bytes:
        self.nano.advance_us(1000)
        for pulse in self.nano.pulses():
            self.shown[pulse.servo] = pulse.ticks
        return self.nano.read()

    def output(self) -> tuple[int, ...]:
        return tuple(self.shown)

    def close(self) -> None:
        self.nano.close()


class PiRig(Rig):
    """The gateway over a fake Raspberry Pi, whose line is a socket."""

    kind = Board.RASPBERRY_PI
    outputs = 2
    stamp_us = 1000  # it reads its port once a millisecond

    def __init__(self, folder: Path, serial: int = 0) -> None:
        super().__init__()
        self.root = make_sysfs(folder)
        self.pi = FakePi(self.root, serial=serial)

    def write(self, data: bytes) -> None:
        self.pi.port.put(data)

    def step(self) -> bytes:
        return self.pi.step()

    def output(self) -> tuple[int, ...]:
        duty = (pwm_value(self.root, k, "duty_cycle") for k in range(self.outputs))
        return tuple(value // constants.TICK_NS for value in duty)


class Ramp:
    """A plant whose two IMUs turn with 2 rad/s² about x, so that a reading's age shows."""

    time = 0.0

    def advance(self, dt: float, _shaft: Triple) -> None:
        self.time += dt

    def angles(self) -> Pair:
        return 0.0, 0.0

    rates = angles

    def holder_imu(self) -> tuple[Triple, Triple]:
        return (2.0 * self.time, 0.0, 0.0), (0.0, 0.0, 0.0)

    base_imu = holder_imu

    def set_supply(self, _fraction: float) -> None:
        pass
