"""A fake Raspberry Pi: a sysfs tree, an SMBus with two MPU6050s, an MCP3008."""

import struct
import threading
from pathlib import Path

from hardware.raspberry_pi.gateway import Gateway
from hardware.raspberry_pi.pwm import KernelPwm, find_chip
from hardware.raspberry_pi.sensors import Mcp3008


class FakeBus:
    """Two MPU6050s: registers per address; asleep until they are woken, as after power-up."""

    def __init__(self, addresses=(0x68, 0x69)):
        self.registers = {a: {0x6B: 0x40} for a in addresses}
        self.measured = dict.fromkeys(addresses, ((100, -200, 300), (0, 0, -8192)))
        self.gone = set()

    def write_byte_data(self, i2c_addr, register, value):
        if i2c_addr in self.gone or i2c_addr not in self.registers:
            raise OSError(121, "Remote I/O error")
        self.registers[i2c_addr][register] = value

    def read_i2c_block_data(self, i2c_addr, register, length):
        if i2c_addr in self.gone or i2c_addr not in self.registers:
            raise OSError(121, "Remote I/O error")
        if (register, length) == (0x75, 1):
            return [0x68]
        assert register == 0x3B
        assert length == 14
        if self.registers[i2c_addr][0x6B] & 0x40:
            return [0] * 14
        gyro, acc = self.measured[i2c_addr]
        return list(struct.pack(">7h", *acc, 0, *gyro))


class FakeSpi:
    def __init__(self, codes):
        self.codes = codes

    def xfer2(self, values):
        start, channel, _ = values
        assert start == 1
        assert channel & 0x80  # single-ended
        code = self.codes[channel >> 4 & 7]
        return [0, 0b11111000 | code >> 8, code & 0xFF]  # upper bits float on the wire


def make_sysfs(root: Path) -> Path:
    """A tree as the kernel's; a PWM chip with one channel comes first and must be skipped."""
    for name, channels in (("pwmchip0", 1), ("pwmchip2", 2)):
        chip = root / name
        chip.mkdir()
        (chip / "npwm").write_text(f"{channels}\n")
        (chip / "export").write_text("")
        (chip / "unexport").write_text("")
        for k in range(channels):
            (chip / f"pwm{k}").mkdir()
            for file in ("period", "duty_cycle", "enable"):
                (chip / f"pwm{k}" / file).write_text("0\n")
    return root


def pwm_value(root: Path, channel: int, file: str) -> int:
    """Value of a file of a PWM channel; -1 while a gateway's thread writes it."""
    text = (root / "pwmchip2" / f"pwm{channel}" / file).read_text()
    return int(text or -1)


class FakePort:
    url = "test"

    def __init__(self):
        self.inbox, self.outbox, self.closed = b"", b"", False
        self.lock = threading.Lock()  # a gateway may run in another thread

    def put(self, data):
        with self.lock:
            self.inbox += data

    def read(self):
        with self.lock:
            data, self.inbox = self.inbox, b""
        return data

    def write(self, data):
        with self.lock:
            self.outbox += data

    def forget(self):
        """Drop what was written so far; what follows may begin in the middle of a message."""
        with self.lock:
            self.outbox = b""

    def close(self):
        self.closed = True


class FakePi:
    """A gateway over these, whose clock the caller advances."""

    def __init__(self, sysfs: Path, adc: bool = True, serial: int = 0):
        self.time_ns = 0
        self.bus, self.port = FakeBus(), FakePort()
        spi = Mcp3008(FakeSpi([500, 510, 520, 530, 512, 700, 0, 0])) if adc else None
        self.gateway = Gateway(
            KernelPwm(find_chip(sysfs)),
            self.bus,
            self.port,
            spi,
            clock=lambda: self.time_ns,
            serial=serial,
        )

    def step(self) -> bytes:
        """Advance a millisecond; return what the gateway sent."""
        self.gateway.step()
        self.time_ns += 1_000_000
        sent, self.port.outbox = self.port.outbox, b""
        return sent
