"""The Pi's gateway against a stand-in sysfs tree, a fake SMBus and a fake SPI."""

import contextlib
import threading
import time

import numpy as np
import pytest

from hardware.frames import HardwareError
from hardware.protocol import (
    Arm,
    Command,
    Decoder,
    Disarm,
    Encoder,
    Flags,
    Hello,
    HelloRequest,
    Mode,
    Telemetry,
)
from hardware.raspberry_pi import __main__ as command
from hardware.raspberry_pi.__main__ import main
from hardware.raspberry_pi.gateway import Gateway, serial_number
from hardware.raspberry_pi.pwm import KernelPwm, PwmError, find_chip
from hardware.raspberry_pi.sensors import BusError, Imu, Mcp3008, open_bus
from tests.conftest import patient
from tests.hardware.fake_pi import FakeBus, FakePi, FakePort, FakeSpi, make_sysfs, pwm_value


@pytest.fixture
def sysfs(tmp_path):
    return make_sysfs(tmp_path)


class _Pi(FakePi):
    def __init__(self, sysfs, adc=True):
        super().__init__(sysfs, adc)
        self.encoder, self.decoder = Encoder(), Decoder()

    def run(self, *messages, milliseconds=10):
        for message in messages:
            self.port.inbox += self.encoder.encode(message)
        for _ in range(milliseconds):
            self.decoder.receive_data(self.step())
        return [frame.message for frame in self.decoder]


@pytest.fixture
def pi(sysfs):
    return _Pi(sysfs)


def test_chip_is_found_by_its_channels_not_by_its_number(sysfs):
    assert find_chip(sysfs).name == "pwmchip2"


def _pi_5(root, *blocks):
    """A tree as on a Pi 5: blocks of four channels that point to their devices on the RP1."""
    for number, device in blocks:
        chip, target = root / f"pwmchip{number}", root / "devices" / device
        target.mkdir(parents=True)
        chip.mkdir()
        (chip / "npwm").write_text("4\n")
        (chip / "device").symlink_to(target)
        for channel in range(4):
            (chip / f"pwm{channel}").mkdir()
            for file in ("period", "duty_cycle", "enable"):
                (chip / f"pwm{channel}" / file).write_text("0\n")
    return root


FAN, HEADER = "1f0009c000.pwm", "1f00098000.pwm"


@pytest.mark.parametrize("numbers", [(0, 1), (1, 0), (2, 0)])  # they differ between kernels
def test_on_a_pi_5_the_servos_are_on_channels_2_and_3_beside_the_fans_block(tmp_path, numbers):
    header, fan = numbers
    chip = find_chip(_pi_5(tmp_path, (fan, FAN), (header, HEADER)))
    assert chip.name == f"pwmchip{header}"
    KernelPwm(chip).set((3100, 2900, 0))
    duty = [int((chip / f"pwm{k}" / "duty_cycle").read_text()) for k in range(4)]
    assert duty == [0, 0, 1_550_000, 1_450_000]
    left = tmp_path / f"pwmchip{fan}"
    assert all((left / f"pwm{k}" / "enable").read_text() == "0\n" for k in range(4))


def test_the_fans_block_of_a_pi_5_without_the_overlay_is_refused(tmp_path):
    with pytest.raises(PwmError, match=r"GPIO 18 and 19 .*dtoverlay=pwm-2chan"):
        find_chip(_pi_5(tmp_path, (0, FAN)))


def test_without_a_chip_the_overlay_is_named(tmp_path):
    with pytest.raises(PwmError, match="dtoverlay=pwm-2chan"):
        find_chip(tmp_path)


def test_pulses_begin_at_neutral_every_20_ms(pi, sysfs):
    pi.run()
    for channel in (0, 1):
        assert pwm_value(sysfs, channel, "period") == 20_000_000
        assert pwm_value(sysfs, channel, "duty_cycle") == 1_500_000
        assert pwm_value(sysfs, channel, "enable") == 1


def test_commands_reach_the_kernel_in_nanoseconds(pi, sysfs):
    pi.run(Arm(), Command((3100, 2900, 0), 50, Mode.DRIVE))
    assert pwm_value(sysfs, 0, "duty_cycle") == 1_550_000
    assert pwm_value(sysfs, 1, "duty_cycle") == 1_450_000


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
    assert last.flags & Flags.PULSE_UNTIMED  # no phase of the frame is known, and none is claimed
    assert pi.bus.registers[0x68] == {0x6B: 1, 0x1A: 2, 0x1B: 8, 0x1C: 8, 0x19: 0}


def test_unplugged_imu_loses_its_flag_and_is_set_up_again(pi):
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
    assert pwm_value(sysfs, 0, "enable") == 0
    assert pi.port.closed


def test_a_duty_that_another_program_left_does_not_stop_the_period(sysfs, monkeypatch):
    """The kernel refuses a period below the duty, a duty above it, and a start without one."""
    write = type(sysfs).write_text

    def as_the_kernel(path, text):
        def value(name):
            return int(path.with_name(name).read_text())

        wanted = int(text)
        refused = (
            (path.name == "period" and wanted < value("duty_cycle"))
            or (path.name == "duty_cycle" and wanted > value("period"))
            or (path.name == "enable" and wanted and not value("period"))
        )
        if refused:
            raise OSError(22, "Invalid argument")
        return write(path, text)

    for channel in (0, 1):
        for name, value in (("period", 100_000_000), ("duty_cycle", 50_000_000), ("enable", 1)):
            (sysfs / "pwmchip2" / f"pwm{channel}" / name).write_text(f"{value}\n")
    monkeypatch.setattr(type(sysfs), "write_text", as_the_kernel)
    pwm = KernelPwm(find_chip(sysfs))
    pwm.set((3000, 3100, 0))
    assert [pwm_value(sysfs, k, "period") for k in (0, 1)] == [20_000_000] * 2
    assert [pwm_value(sysfs, k, "duty_cycle") for k in (0, 1)] == [1_500_000, 1_550_000]


def test_forbidden_files_are_reported_with_the_remedy(sysfs, monkeypatch):
    def refuse(self, *_args, **_kwargs):
        raise PermissionError(13, "Permission denied")

    chip = find_chip(sysfs)
    pwm = KernelPwm(chip)
    monkeypatch.setattr("pathlib.Path.write_text", refuse)
    with pytest.raises(PwmError, match="group gpio"):
        pwm.set((3000, 3000, 0))


def test_imu_of_negative_counts_is_read_as_signed():
    bus = FakeBus()
    bus.measured[0x68] = ((-32768, 32767, -1), (0, 1, -2))
    assert Imu(bus, 0x68).read(2) == (-32768, 32767, -1, 0, 1, -2)


def test_imu_that_answers_zeros_has_fallen_asleep_and_is_set_up_again(pi):
    pi.run()
    pi.bus.registers[0x68] = {0x6B: 0x40}  # a dip of its supply: reset, asleep, on the bus
    frames = [m for m in pi.run(milliseconds=20) if isinstance(m, Telemetry)]
    assert not frames[0].flags & Flags.HOLDER_IMU
    assert frames[0].holder_gyro == (100, -200, 300)  # the last reading, not zeros
    assert frames[-1].flags & Flags.HOLDER_IMU
    assert pi.bus.registers[0x68] == {0x6B: 1, 0x1A: 2, 0x1B: 8, 0x1C: 8, 0x19: 0}


def test_spi_error_reads_as_open_wires_and_a_joystick_at_rest(pi):
    pi.run()

    def fail(_values):
        raise OSError(5, "Input/output error")

    pi.gateway.adc.spi.xfer2 = fail
    last = pi.run()[-1]
    assert last.potentiometer == (0, 0, 0, 0)
    assert last.joystick == (512, 512)
    assert last.holder_gyro == (100, -200, 300)


def test_command_that_waited_longer_than_its_timeout_is_not_obeyed(pi, sysfs):
    pi.run(Arm())
    pi.time_ns += 2_000_000_000  # the gateway is held up, and the socket fills
    last = pi.run(Command((3500, 3500, 0), 100, Mode.DRIVE))[-1]
    assert pwm_value(sysfs, 0, "duty_cycle") == 1_500_000
    assert last.flags & Flags.TIMED_OUT
    pi.run(Command((3500, 3500, 0), 100, Mode.DRIVE))
    assert pwm_value(sysfs, 0, "duty_cycle") == 1_750_000


def test_all_that_waited_is_taken_at_once_and_what_is_no_command_is_obeyed(pi, sysfs):
    pi.run(Arm())
    pi.time_ns += 2_000_000_000
    stale = [Command((3500, 3500, 0), 100, Mode.DRIVE)] * 20
    messages = pi.run(*stale, HelloRequest(), Disarm(), milliseconds=3)
    assert pwm_value(sysfs, 0, "duty_cycle") == 1_500_000
    assert any(isinstance(m, Hello) for m in messages)
    assert not messages[-1].flags & Flags.ARMED


class _StuckBus(FakeBus):
    """Holds every read until it is released, as a sensor that pulls the clock down does."""

    def __init__(self):
        super().__init__()
        self.free, self.held = threading.Event(), threading.Event()
        self.free.set()

    def read_i2c_block_data(self, *arguments):
        if not self.free.is_set():
            self.held.set()
            assert self.free.wait(60.0)
        return super().read_i2c_block_data(*arguments)


@contextlib.contextmanager
def _running(sysfs, bus, spi=None):
    """A gateway on the wall clock; gives its port and what sends to it."""
    port, encoder = FakePort(), Encoder()
    adc = Mcp3008(spi or FakeSpi([500, 510, 520, 530, 512, 700, 0, 0]))
    gateway = Gateway(KernelPwm(find_chip(sysfs)), bus, port, adc)
    thread = threading.Thread(target=gateway.run)
    thread.start()

    def send(*messages):
        port.put(b"".join(encoder.encode(m) for m in messages))

    try:
        yield port, send
    finally:
        gateway.stop()
        thread.join(5)
        assert not thread.is_alive()


def _until(condition, seconds=20.0):
    """Wait for what takes milliseconds, and longer when other processes take the processor."""
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.002)


def _reports(port):
    decoder = Decoder()
    decoder.receive_data(port.outbox)
    return [f.message for f in decoder if isinstance(f.message, Telemetry)]


def test_stuck_bus_holds_up_neither_the_timeout_nor_the_potentiometers(sysfs):
    bus = _StuckBus()
    with _running(sysfs, bus) as (port, send):
        _until(lambda: any(r.flags & Flags.HOLDER_IMU for r in _reports(port)))
        bus.free.clear()
        assert bus.held.wait(20.0)  # every read waits until the bus is free
        send(Arm())
        drive = Command((4000, 3000, 0), 100, Mode.DRIVE)
        _until(lambda: send(drive) or pwm_value(sysfs, 0, "duty_cycle") == 2_000_000)
        _until(lambda: pwm_value(sysfs, 0, "duty_cycle") == 1_500_000)
        port.forget()
        _until(lambda: len(port.outbox) > 2000)
        last = _reports(port)[-1]
        assert not last.flags & (Flags.HOLDER_IMU | Flags.BASE_IMU)
        assert last.holder_gyro == (100, -200, 300)
        assert last.imu_age_us[0] > 20_000
        assert last.potentiometer == (500, 510, 520, 530)
        bus.free.set()
        _until(lambda: _reports(port)[-1].flags & Flags.HOLDER_IMU)


def test_stuck_adc_reads_as_open_wires_and_what_it_gives_late_is_not_reported(sysfs):
    class StuckSpi(FakeSpi):
        free = threading.Event()

        def xfer2(self, values):
            assert self.free.wait(5.0)
            return super().xfer2(values)

    StuckSpi.free.set()
    with _running(sysfs, FakeBus(), StuckSpi([500, 510, 520, 530, 512, 700, 0, 0])) as (port, _):
        _until(lambda: len(port.outbox) > 2000)
        StuckSpi.free.clear()
        _until(lambda: _reports(port)[-1].potentiometer == (0, 0, 0, 0))
        _until(lambda: _reports(port)[-1].flags & Flags.HOLDER_IMU)  # the gyro is still read
        StuckSpi.free.set()
        _until(lambda: _reports(port)[-1].potentiometer == (500, 510, 520, 530))
        stamps = [r.device_us for r in _reports(port)]
    assert stamps == sorted(set(stamps))


@pytest.mark.realtime
def test_readings_of_a_running_gateway_have_the_stated_age(sysfs):
    with _running(sysfs, FakeBus()) as (port, _):
        _until(lambda: len(port.outbox) > 10_000)
        reports = _reports(port)[2:]
    # a busy machine may take the thread's turn away now and then
    assert np.mean([bool(r.flags & Flags.HOLDER_IMU) for r in reports]) > 0.8
    stamps = [r.device_us for r in reports]
    assert stamps == sorted(stamps)
    assert min(r.imu_age_us[0] for r in reports) < 2000


@patient
def test_slow_buses_make_reports_fewer_and_none_of_them_false(sysfs):
    class SlowBus(FakeBus):
        def read_i2c_block_data(self, *arguments):
            time.sleep(1.6e-3)  # 17 bytes at 100 kHz
            return super().read_i2c_block_data(*arguments)

    with _running(sysfs, SlowBus()) as (port, _):
        _until(lambda: len(port.outbox) > 10_000)
        reports = _reports(port)[2:]
    assert {r.potentiometer for r in reports} == {(500, 510, 520, 530)}
    assert all(r.flags & Flags.HOLDER_IMU for r in reports)


def test_a_fault_of_a_sensors_thread_ends_the_gateway_and_not_the_thread_alone(sysfs):
    class Broken(FakeBus):
        def read_i2c_block_data(self, *_):
            raise RuntimeError("no such thing")

    gateway = Gateway(KernelPwm(find_chip(sysfs)), Broken(), FakePort())
    with pytest.raises(RuntimeError, match="no such thing"):
        gateway.run()
    assert pwm_value(sysfs, 0, "enable") == 0


def test_closed_gateway_has_sent_the_servos_to_neutral_first(sysfs, monkeypatch):
    written = []
    real = type(sysfs).write_text

    def note(path, text):
        written.append((path.parent.name, path.name, text.strip()))
        return real(path, text)

    with _running(sysfs, FakeBus()) as (_, send):
        send(Arm())
        drive = Command((4000, 4000, 0), 2000, Mode.DRIVE)
        _until(lambda: send(drive) or pwm_value(sysfs, 1, "duty_cycle") == 2_000_000)
        monkeypatch.setattr(type(sysfs), "write_text", note)
    files = [w[:2] for w in written]
    for name in ("pwm0", "pwm1"):
        assert (name, "duty_cycle", "1500000") in written
        assert files.index((name, "duty_cycle")) < files.index((name, "enable"))
    assert pwm_value(sysfs, 0, "enable") == 0


def test_refused_pulse_is_one_line_and_the_other_servo_is_still_sent_to_neutral(
    sysfs, monkeypatch, capsys
):
    chip, real = find_chip(sysfs), type(sysfs).write_text

    class Begun(FakePort):
        def read(self):  # driven once, then the kernel takes nothing more for servo x
            if not self.inbox:
                monkeypatch.setattr(type(sysfs), "write_text", refuse)
                return b""
            return super().read()

        drop = restore = FakePort.close

    def refuse(path, text):
        if path.parent.name == "pwm0":
            raise OSError(5, "Input/output error")
        return real(path, text)

    encoder, port = Encoder(), Begun()
    port.inbox = encoder.encode(Arm()) + encoder.encode(Command((4000, 4000, 0), 50, Mode.DRIVE))
    monkeypatch.setattr(command, "open_bus", lambda _: FakeBus())
    monkeypatch.setattr(command, "open_adc", lambda: None)
    monkeypatch.setattr(command, "KernelPwm", lambda: KernelPwm(chip))
    monkeypatch.setattr(command, "TcpPort", lambda *_: port)
    monkeypatch.setattr(command.signal, "signal", lambda *_: None)
    assert main([]) == 2
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 2  # where to reach it, and why it ended
    assert "pwm0/duty_cycle: Input/output error" in lines[1]
    assert pwm_value(sysfs, 1, "duty_cycle") == 1_500_000
    assert port.closed


def test_missing_bus_or_library_is_one_line_and_exit_2(capsys):
    with pytest.raises(BusError) as caught:
        open_bus(99)
    assert "\n" not in str(caught.value)
    assert isinstance(caught.value, HardwareError)
    assert main(["--bus", "99"]) == 2
    assert capsys.readouterr().err.count("\n") == 1


@pytest.mark.parametrize(
    ("text", "number"),
    [
        ("Hardware\t: BCM2835\nSerial\t\t: 00000000a3b2c1d0\nModel\t\t: Pi 3\n", 0xA3B2C1D0),
        ("Serial : 10000000ffffffff\n", 0),  # all ones stands for none on the wire
        ("Serial : zebra\n", 0),
        ("processor : 0\n", 0),
        (None, 0),
    ],
)
def test_serial_number_is_that_of_the_chip(tmp_path, text, number):
    file, system = tmp_path / "cpuinfo", tmp_path / "machine-id"
    if text is not None:
        file.write_text(text)
    assert serial_number(file, system) == number
    system.write_text("8d2c4e6f1a3b4c5d9e8f7a6b12345678\n")
    assert serial_number(file, system) == (number or 0x12345678)
    system.write_text("no number\n")
    assert serial_number(file, system) == number
