"""The Pi's gateway against a stand-in sysfs tree, a fake SMBus and a fake SPI."""

import struct

import pytest

from hardware.frames import HardwareError
from hardware.protocol import Arm, Board, Command, Decoder, Encoder, Flags, Hello, Mode, Telemetry
from hardware.raspberry_pi.__main__ import main
from hardware.raspberry_pi.gateway import Gateway
from hardware.raspberry_pi.pwm import KernelPwm, PwmError, find_chip
from hardware.raspberry_pi.sensors import BusError, Imu, Mcp3008, open_bus


class _FakeBus:
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
        assert register == 0x3B
        assert length == 14
        if self.registers[i2c_addr][0x6B] & 0x40:
            return [0] * 14
        gyro, acc = self.measured[i2c_addr]
        return list(struct.pack(">7h", *acc, 0, *gyro))


class _FakeSpi:
    def __init__(self, codes):
        self.codes = codes

    def xfer2(self, values):
        start, channel, _ = values
        assert start == 1
        assert channel & 0x80  # single-ended
        code = self.codes[channel >> 4 & 7]
        return [0, 0b11111000 | code >> 8, code & 0xFF]  # upper bits float on the wire


@pytest.fixture
def sysfs(tmp_path):
    """A tree as the kernel shows it; a PWM of one channel comes first and must be passed over."""
    for name, channels in (("pwmchip0", 1), ("pwmchip2", 2)):
        chip = tmp_path / name
        chip.mkdir()
        (chip / "npwm").write_text(f"{channels}\n")
        (chip / "export").write_text("")
        (chip / "unexport").write_text("")
        for k in range(channels):
            (chip / f"pwm{k}").mkdir()
            for file in ("period", "duty_cycle", "enable"):
                (chip / f"pwm{k}" / file).write_text("0\n")
    return tmp_path


def _value(folder, channel, file):
    return int((folder / "pwmchip2" / f"pwm{channel}" / file).read_text())


class _Port:
    url = "test"

    def __init__(self):
        self.inbox, self.outbox, self.closed = b"", b"", False

    def read(self):
        data, self.inbox = self.inbox, b""
        return data

    def write(self, data):
        self.outbox += data

    def close(self):
        self.closed = True


class _Pi:
    def __init__(self, sysfs, adc=True):
        self.time_ns = 0
        self.bus, self.port, self.root = _FakeBus(), _Port(), sysfs
        spi = Mcp3008(_FakeSpi([500, 510, 520, 530, 512, 700, 0, 0])) if adc else None
        self.gateway = Gateway(
            KernelPwm(find_chip(sysfs)), self.bus, self.port, spi, clock=lambda: self.time_ns
        )
        self.encoder, self.decoder = Encoder(), Decoder()

    def run(self, *messages, milliseconds=10):
        for message in messages:
            self.port.inbox += self.encoder.encode(message)
        for _ in range(milliseconds):
            self.gateway.step()
            self.time_ns += 1_000_000
        self.decoder.receive_data(self.port.outbox)
        self.port.outbox = b""
        return [frame.message for frame in self.decoder]


@pytest.fixture
def pi(sysfs):
    return _Pi(sysfs)


def test_chip_is_found_by_its_channels_not_by_its_number(sysfs):
    assert find_chip(sysfs).name == "pwmchip2"


def test_without_a_chip_the_overlay_is_named(tmp_path):
    with pytest.raises(PwmError, match="dtoverlay=pwm-2chan"):
        find_chip(tmp_path)


def test_boot_says_hello_as_a_pi_and_holds_neutral(pi, sysfs):
    messages = pi.run()
    assert isinstance(messages[0], Hello)
    assert messages[0].board == Board.RASPBERRY_PI
    for channel in (0, 1):
        assert _value(sysfs, channel, "period") == 20_000_000
        assert _value(sysfs, channel, "duty_cycle") == 1_500_000
        assert _value(sysfs, channel, "enable") == 1


def test_commands_reach_the_kernel_in_nanoseconds_and_time_out_to_neutral(pi, sysfs):
    pi.run(Arm(), Command((3100, 2900, 0), 50, Mode.DRIVE))
    assert _value(sysfs, 0, "duty_cycle") == 1_550_000
    assert _value(sysfs, 1, "duty_cycle") == 1_450_000
    last = pi.run(milliseconds=60)[-1]
    assert _value(sysfs, 0, "duty_cycle") == 1_500_000
    assert last.flags & Flags.TIMED_OUT


def test_pulses_are_clamped_like_the_firmwares(pi, sysfs):
    pi.run(Arm(), Command((60_000, 1, 0), 50, Mode.DRIVE))
    assert _value(sysfs, 0, "duty_cycle") == 2_000_000
    assert _value(sysfs, 1, "duty_cycle") == 1_000_000


def test_telemetry_carries_imu_and_adc(pi):
    frames = [m for m in pi.run(milliseconds=100) if isinstance(m, Telemetry)]
    assert len(frames) == 50
    last = frames[-1]
    assert last.holder_gyro == (100, -200, 300)
    assert last.base_accelerometer == (0, 0, -8192)
    assert last.potentiometer == (500, 510, 520, 530)
    assert last.joystick == (512, 700)
    assert last.flags & Flags.HOLDER_IMU
    assert last.flags & Flags.BASE_IMU
    assert pi.bus.registers[0x68] == {0x6B: 1, 0x1A: 2, 0x1B: 8, 0x1C: 8, 0x19: 0}


def test_pulled_imu_loses_its_flag_and_is_set_up_again(pi):
    pi.run()
    pi.bus.gone.add(0x68)
    last = pi.run()[-1]
    assert not last.flags & Flags.HOLDER_IMU
    assert last.flags & Flags.BASE_IMU
    pi.bus.registers[0x68] = {0x6B: 0x40}
    pi.bus.gone.clear()
    last = pi.run()[-1]
    assert last.flags & Flags.HOLDER_IMU
    assert last.holder_gyro == (100, -200, 300)


def test_without_an_adc_the_potentiometers_read_as_open_wires(sysfs):
    last = _Pi(sysfs, adc=False).run()[-1]
    assert last.potentiometer == (0, 0, 0, 0)


def test_end_of_the_gateway_stops_the_pulses(pi, sysfs):
    pi.run()
    pi.gateway.stop()
    pi.gateway.run()
    assert _value(sysfs, 0, "enable") == 0
    assert pi.port.closed


def test_forbidden_files_say_what_to_do(sysfs, monkeypatch):
    def refuse(self, *_args, **_kwargs):
        raise PermissionError(13, "Permission denied")

    chip = find_chip(sysfs)
    pwm = KernelPwm(chip)
    monkeypatch.setattr("pathlib.Path.write_text", refuse)
    with pytest.raises(PwmError, match="group gpio"):
        pwm.set((3000, 3000, 0))


def test_imu_of_negative_counts_is_read_as_signed():
    bus = _FakeBus()
    bus.measured[0x68] = ((-32768, 32767, -1), (0, 1, -2))
    assert Imu(bus, 0x68).read(2) == (-32768, 32767, -1, 0, 1, -2)


def test_missing_bus_or_library_is_one_line_and_exit_2(capsys):
    with pytest.raises(BusError) as caught:
        open_bus(99)
    assert "\n" not in str(caught.value)
    assert isinstance(caught.value, HardwareError)
    assert main(["--bus", "99"]) == 2
    assert capsys.readouterr().err.count("\n") == 1
