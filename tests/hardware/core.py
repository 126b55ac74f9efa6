"""The firmware's portable core, built for the host and driven from Python."""

import os
import shutil
import subprocess
from dataclasses import dataclass, field
from pathlib import Path

import pytest

from hardware.firmware.build import SKETCH
from hardware.protocol import Decoder, Encoder, Flags, Frame, Telemetry, constants

DRIVER = Path(__file__).with_name("host_driver.cpp")
UNITS = ("core.cpp", "framing.cpp", "imu.cpp")
WARNINGS = ("-std=gnu++11", "-Wall", "-Wextra", "-Wshadow", "-Wconversion", f"-I{SKETCH}")
SANITIZERS = ("-O1", "-g", "-fsanitize=address,undefined", "-fno-sanitize-recover=all")
COVERAGE = ("-O0", "-g", "--coverage")
WRAP = 2**32


def build(folder: Path, flags: tuple[str, ...] = SANITIZERS) -> Path:
    """Program that runs the core, in `folder`; the test is skipped where g++ is missing."""
    if shutil.which("g++") is None:
        assert not os.environ.get("CI"), "g++ is missing in CI"
        pytest.skip("g++ is not installed: the firmware's core is not tested on the host")
    objects = []
    for source in (DRIVER, *(SKETCH / name for name in UNITS)):
        objects.append(str(folder / f"{source.stem}.o"))
        _run(["g++", *WARNINGS, *flags, "-c", str(source), "-o", objects[-1]])
    program = folder / "core"
    _run(["g++", *flags, *objects, "-o", str(program)])
    return program


def _run(command: list[str]) -> None:
    done = subprocess.run(command, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")


@dataclass(frozen=True)
class Answer:
    """What the core did: bytes sent, pulses wanted, settings in force."""

    sent: bytes
    pulse: tuple[int, int, int]
    armed: bool
    period_ms: int
    dlpf: int
    serial: int

    @property
    def frames(self) -> list[Frame]:
        decoder = Decoder()
        decoder.receive_data(self.sent)
        return list(decoder)


BLANK = Telemetry(
    device_us=0,
    frame_us=0,
    potentiometer=(0, 0, 0, 0),
    holder_gyro=(0, 0, 0),
    holder_accelerometer=(0, 0, 0),
    base_gyro=(0, 0, 0),
    base_accelerometer=(0, 0, 0),
    imu_age_us=(0, 0),
    pulse=(constants.PULSE_NEUTRAL,) * 3,
    switches=0,
    joystick=(0, 0),
    flags=0,
    crc_errors=0,
    lost=0,
    overruns=0,
    skipped=0,
    acknowledged=0,
)


@dataclass
class Core:
    """The core in a separate process; each call exchanges one line each way."""

    process: subprocess.Popen
    encoder: Encoder = field(default_factory=Encoder)

    @classmethod
    def start(cls, program: Path) -> "Core":
        pipe = subprocess.PIPE
        return cls(subprocess.Popen([program], stdin=pipe, stdout=pipe, stderr=pipe, text=True))

    def stop(self) -> None:
        self.process.stdin.close()
        assert self.process.wait() == 0, self.process.stderr.read()

    def line(self, *words: object) -> list[str]:
        self.process.stdin.write(
            " ".join(str(int(w) if isinstance(w, bool) else w) for w in words) + "\n"
        )
        self.process.stdin.flush()
        answer = self.process.stdout.readline()
        assert answer, f"the core died:\n{self.process.stderr.read()}"
        return answer.split()

    def ask(self, *words: object) -> Answer:
        sent, *numbers = self.line(*words)
        x, y, z, armed, period, dlpf, serial = map(int, numbers)
        return Answer(bytes.fromhex(sent[1:]), (x, y, z), bool(armed), period, dlpf, serial)

    def fresh(self) -> "Core":
        self.encoder = Encoder()
        self.ask("new")
        return self

    def boot(self, cause: int = 1, serial: int = constants.SERIAL_BLANK) -> Answer:
        return self.ask("boot", cause, serial)

    def receive(self, data: bytes, at: int = 0, now: int | None = None) -> Answer:
        return self.ask("receive", at % WRAP, (at if now is None else now) % WRAP, data.hex())

    def send(self, message, at: int = 0) -> Answer:
        return self.receive(self.encoder.encode(message), at)

    def update(self, now: int) -> Answer:
        return self.ask("update", now % WRAP)

    def report(self, t: Telemetry) -> Answer:
        words = [t.device_us, t.frame_us, *t.potentiometer, *t.joystick]
        words += [*t.holder_gyro, *t.holder_accelerometer, *t.base_gyro, *t.base_accelerometer]
        words += [*t.imu_age_us, bool(t.flags & Flags.HOLDER_IMU), bool(t.flags & Flags.BASE_IMU)]
        return self.ask("report", *words, *t.pulse, t.switches, t.overruns)

    def telemetry(self) -> Telemetry:
        return self.report(BLANK).frames[0].message
