"""The emulated rig: wire behaviour, servo frame timing, sensor errors, faults, ports."""

import contextlib
import re
import threading
import time
from dataclasses import replace
from itertools import pairwise
from math import degrees, radians
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hardware.device import PtyPort, Server, ServerError, TcpPort, serve
from hardware.emulator import (
    Emulator,
    FaultNameError,
    Servo,
    ServoParameters,
    UnpluggedError,
    parse,
    reference_rig,
    sample_rig,
    valid_names,
)
from hardware.emulator.bench import OPEN_WIRE_TIME, Bench
from hardware.emulator.sensors import ImuPair, Mpu6050, Potentiometer
from hardware.parts import GYRO_DELAY_S, GYRO_NOISE, POTENTIOMETER_TRAVEL
from hardware.protocol import (
    Arm,
    Command,
    Decoder,
    Encoder,
    Flags,
    Hello,
    Mode,
    Ping,
    Pong,
    Telemetry,
    constants,
)
from tests.hardware.boards import Ramp


def quiet(parameters):
    """The rig without noise of potentiometers and supply."""
    s = parameters.sensors
    a, b, d, e = (replace(p, noise=0.0) for p in s.potentiometers)
    return replace(parameters, sensors=replace(s, potentiometers=(a, b, d, e), supply_ripple=0.0))


class _Host:
    """The other end of an emulator, a millisecond at a time."""

    def __init__(self, device):
        self.device = device
        self.encoder, self.decoder = Encoder(), Decoder()

    def send(self, *messages):
        for message in messages:
            self.device.write(self.encoder.encode(message))

    def receive(self, milliseconds=1):
        messages = []
        for _ in range(milliseconds):
            self.device.advance_us(1000)
            self.decoder.receive_data(self.device.read())
            messages += [frame.message for frame in self.decoder]
        return messages

    def telemetry(self, milliseconds=10):
        return [m for m in self.receive(milliseconds) if isinstance(m, Telemetry)]


@pytest.fixture
def host():
    return _Host(Emulator())


def drive(x, y=3000, timeout=100):
    return Command((x, y, 0), timeout, Mode.DRIVE)


def test_pulses_change_only_when_a_frame_begins(host):
    host.send(Arm())
    seen = []
    for k in range(100):
        host.send(drive(2900 + 2 * k))
        seen += [(m.device_us, m.frame_us, m.pulse[0]) for m in host.telemetry(3)]
    changes = [b for a, b in pairwise(seen) if a[2] != b[2]]
    assert len(changes) > 10
    assert all(frame_us <= 2000 for _, frame_us, _ in changes)  # the first report of a frame


def test_pong_carries_the_stamps_of_a_skewed_clock():
    device = Emulator(replace(reference_rig(), skew=2e-3), boot_us=5_000_000)
    host = _Host(device)
    host.receive(1000)
    host.send(Ping(42))
    pong = next(m for m in host.receive(10) if isinstance(m, Pong))
    assert pong.host_ns == 42
    # 1 s of world time is 1.002 s of the device's; the answer takes some milliseconds
    assert pong.received_us - 5_000_000 == pytest.approx(1_002_000, abs=3_000)


def test_same_seed_same_bytes():
    def stream():
        host = _Host(Emulator(sample_rig(3), injections=(parse("link:corrupt:0.01"),), seed=9))
        host.send(Arm(), drive(3300))
        out = b""
        for _ in range(200):
            host.device.advance_us(1000)
            out += host.device.read()
        return out

    assert stream() == stream()


def test_line_carries_no_more_than_its_baud_rate():
    device = Emulator()
    count = 0
    for _ in range(500):
        device.advance_us(1000)
        count += len(device.read())
    assert count <= 0.5 * constants.BAUD / 10


def _settle(servo, command, seconds=1.0, dt=1e-3):
    track = []
    for _ in range(round(seconds / dt)):
        servo.advance(dt, command)
        track.append(servo.shaft)
    return np.array(track)


def test_servo_turns_60_degrees_in_the_time_of_its_class():
    track = _settle(Servo(ServoParameters(backlash=0)), radians(60))
    # 0.10–0.12 s/60° as sold; the model's unloaded servo takes the rest to settle
    assert 0.08 < np.argmax(track > radians(57)) * 1e-3 < 0.14


def test_servo_ignores_errors_within_its_dead_band():
    servo = Servo(ServoParameters(dead_band=radians(1.0), friction=0.0))
    _settle(servo, radians(0.9))
    assert servo.shaft == 0.0


def test_slew_limit_holds_and_zero_switches_it_off():
    def fastest(limit):
        servo = Servo(ServoParameters(slew_limit=limit))
        return np.diff(_settle(servo, 1.0)).max() / 1e-3

    assert fastest(2.0) == pytest.approx(2.0, rel=1e-9)
    assert fastest(0.0) > 5.0


def test_backlash_is_the_width_between_both_directions():
    servo = Servo(ServoParameters(backlash=radians(2), dead_band=0, friction=0))

    def creep(start, end):  # slowly: an overshoot would take up the play
        for command in np.linspace(start, end, 2000):
            servo.advance(1e-3, float(command))
        return servo.angle

    up = creep(0.0, 0.2)
    creep(0.2, 0.4)
    # Both approaches lag by the same 0.1 rad/s over a loop gain of some 70/s: 2 · 0.08°.
    assert degrees(creep(0.4, 0.2) - up) == pytest.approx(2.0, abs=0.2)


def test_adc_rounds_down_to_one_of_1024_codes():
    device = Emulator(quiet(reference_rig()))
    codes = device.bench.potentiometer_codes()
    assert codes == (512, 512, 512, 512)
    angle = 10.4 * POTENTIOMETER_TRAVEL / 1024
    assert int(Potentiometer().fraction(angle) * 1024) == 522


def test_gyro_noise_has_the_datasheets_density():
    imus = ImuPair((Mpu6050(bias_walk=0.0),) * 2, np.random.default_rng(1))
    readings = []
    for _ in range(20_000):
        imus.advance(1e-3, np.zeros(12), 2.8e-3)
        readings.append(imus.counts()[0] * constants.GYRO_SCALE)
    # Far below the low-pass: the variance of 50 ms means is density² / 2 / 0.05 s.
    means = np.reshape(readings, (-1, 50)).mean(axis=1)
    # 400 means scatter by 3.5 %; quantisation of 0.015 °/s adds less than 1 %
    assert means.std() == pytest.approx(GYRO_NOISE * (0.5 / 0.05) ** 0.5, rel=0.12)


@pytest.mark.parametrize("dlpf", range(7))
def test_gyro_is_late_by_the_delay_of_its_setting(dlpf):
    imus = ImuPair((Mpu6050(bias_walk=0.0),) * 2, np.random.default_rng(1))
    imus._noise[:] = 0
    truth, delay = np.zeros(12), GYRO_DELAY_S[dlpf]
    imus.advance(1e-3, truth, delay)
    lag = 0.0
    for k in range(200):
        truth[0] = 1e-3 * k
        imus.advance(1e-3, truth, delay)
        lag = truth[0] - imus._stage[1][0]
    assert lag == pytest.approx(delay, rel=1e-6)  # a ramp of 1 rad/s² lags by its delay


def test_imu_counts_have_the_age_given_in_telemetry_and_that_of_the_chips_latest_sample():
    rig = quiet(replace(reference_rig(), skew=2e-3))
    still = Mpu6050(bias_walk=0.0, clock=8e-3)  # against the board's 2e-3: all phases in 167 ms
    rig = replace(rig, sensors=replace(rig.sensors, imus=(still, still)))
    plant = Ramp()
    device = Emulator(rig, plant=plant)
    device.bench._imus._noise[:] = 0
    lag = []
    device.observer = lambda *_: lag.append(2.0 * plant.time)
    frames = _Host(device).telemetry(868)
    late = 2.8e-3  # DLPF 2, register map 4.2
    for name, k in (("holder_gyro", 0), ("base_gyro", 1)):
        read = np.array([getattr(m, name)[0] for m in frames[100:]]) * constants.GYRO_SCALE
        behind = np.array(lag[100 : 100 + len(read)]) - read
        stated = late + np.mean([m.imu_age_us[k] for m in frames]) * 1e-6
        held = 1e3 * (behind / 2.0 - stated)  # ms; one step of the gyro is 0.13 ms of this ramp
        # Uniform over the 1 ms between two samples, over two rounds of all phases.
        assert held.mean() == pytest.approx(0.5, abs=0.02)
        assert held.std() == pytest.approx(1 / 12**0.5, abs=0.03)
        assert held.min() > -0.15
        assert held.max() < 1.15


def test_imu_samples_by_its_own_clock_and_holds_what_it_sampled():
    fast, slow = Mpu6050(bias_walk=0.0, clock=0.01), Mpu6050(bias_walk=0.0, clock=-0.01)
    imus = ImuPair((fast, slow), np.random.default_rng(1))
    taken = [[], []]
    for k in range(1000):
        imus.advance(1e-3, np.zeros(12), 2.8e-3)
        for age, chip in imus.updates():
            taken[chip].append(1e-3 * (k + 1) - age)
    for chip, rate in ((0, 1010.0), (1, 990.0)):
        assert np.diff(taken[chip]) == pytest.approx(1 / rate, abs=1e-7)
    for _ in range(8):  # 8 kHz without the low-pass: register map 4.2, register 25
        imus.advance(1e-3, np.zeros(12), 0.98e-3, 0.125e-3)
    ages = [age for age, chip in imus.updates() if chip == 0]
    assert len(ages) == 8
    assert -np.diff(ages) == pytest.approx(0.125e-3 / 1.01, abs=1e-7)


def test_report_at_a_frames_beginning_shows_the_pulses_of_that_frame(host):
    host.send(Arm())
    host.receive(11)
    host.send(drive(3200))
    first = next(m for m in host.telemetry(40) if m.pulse[0] == 3200)
    assert (first.device_us, first.frame_us) == (20_000, 0)


def test_switches_close_at_their_angle_and_open_before_it():
    host = _Host(Emulator(quiet(reference_rig())))
    host.send(Arm())
    seen = []
    for pulse in [*range(3000, 3440, 4), *range(3440, 3000, -4)]:
        host.send(drive(pulse))
        host.receive(40)
        x = host.device.truth()[0][0]
        seen.append((degrees(x), bool(host.device.bench.switch_bits() & 1)))
    closed = [x for x, shut in seen if shut]
    opening = seen[len(seen) // 2 :]
    assert min(closed) > 8.5
    # one step of 2 µs is 0.09°
    assert max(x for x, shut in seen[: len(seen) // 2] if not shut) == pytest.approx(9.0, abs=0.1)
    assert min(x for x, shut in opening if shut) == pytest.approx(8.6, abs=0.1)


@pytest.mark.parametrize("name", valid_names().split(", "))
def test_every_listed_fault_can_be_requested(name):
    fault = parse(f"{name}@1-2")
    assert f"{fault.target}:{fault.kind}" == name
    assert fault.active(1.5)
    assert not fault.active(0.5)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("potentiometer_x_c:stuck", "must be one of potentiometer_x_a:glitch"),
        ("gyro:melt", "must be one of"),
        ("", "must be one of"),
        ("supply:sag:2", r"must be 0…0.9"),
        ("supply:sag:nan", "not a number"),
        ("gyro:bias:fast", "not a number"),
        ("gyro:bias:20@5-3", "rising"),
        ("gyro:bias:20@", "start '' is not a number"),
        ("gyro:bias:1:2", "must be one of"),
    ],
)
def test_an_invalid_fault_is_refused_in_one_line(text, words):
    with pytest.raises(FaultNameError, match=words) as caught:
        parse(text)
    assert "\n" not in str(caught.value)


@given(st.text(max_size=40))
def test_any_string_is_a_fault_or_a_clear_error(text):
    with contextlib.suppress(FaultNameError):
        parse(text)


def _codes(fault, milliseconds=400):
    host = _Host(Emulator(injections=(parse(fault),)))
    host.send(Arm(), drive(3200, timeout=2000))
    return np.array([m.potentiometer for m in host.telemetry(milliseconds)])


def test_glitch_spoils_the_given_fraction():
    codes = _codes("potentiometer_x_a:glitch:0.2", 2000)[:, 0]
    wrong = np.abs(codes - np.median(codes)) > 40
    # the step to 3200 moves the others by 20 codes; 1000 readings scatter by 1.3 %
    assert wrong.mean() == pytest.approx(0.2 * 0.92, abs=0.05)


def test_stuck_reading_keeps_its_place_and_open_wire_falls_to_ground():
    stuck = _codes("potentiometer_x_a:stuck@0.05")
    assert np.ptp(stuck[40:, 0]) <= 5  # electrical noise stays
    assert np.ptp(stuck[:, 1]) > 10
    assert (_codes("potentiometer_y_a:open@0.1")[60:, 2] <= 3).all()  # 5 σ of electrical noise


def test_open_wire_falls_as_fast_as_the_parts_of_the_wiring_page_let_it():
    page = (Path(__file__).parents[2] / "docs" / "wiring.md").read_text(encoding="utf-8")
    ohm = re.search(r"^\| 4 \| resistor (\d+) MΩ \|", page, re.MULTILINE)
    farad = re.search(r"^\| 4 \| ceramic capacitor (\d+) nF \|", page, re.MULTILINE)
    assert int(ohm[1]) * 1e6 * int(farad[1]) * 1e-9 == pytest.approx(OPEN_WIRE_TIME)


def test_sag_scales_all_four():
    codes = _codes("supply:sag:0.1@0.2")
    ratio = codes[-50:].mean(axis=0) / codes[80:95].mean(axis=0)
    np.testing.assert_allclose(ratio, 0.9, atol=0.004)


def test_sag_of_the_supply_slows_the_servos_that_share_it_with_the_potentiometers():
    """The free speed of a motor is proportional to its voltage, less the dry friction's."""

    def slew(*faults):
        bench = Bench(injections=tuple(map(parse, faults)))
        bench.set_pulses((2.2e-3, 1.5e-3, 1.5e-3))  # 68°: no end comes near in 60 ms
        angles = []
        for _ in range(60):
            bench.advance(1e-3)
            angles.append(bench.plant.servos[0].shaft)
        return angles[-1] - angles[-11]

    p = ServoParameters()
    ratio = (0.7 * p.voltage - p.friction) / (p.voltage - p.friction)
    assert slew("supply:sag:0.3") / slew() == pytest.approx(ratio, rel=0.01)


@pytest.mark.parametrize(
    "fault", ["supply:sag:0", "gyro:bias:0", "base_gyro:bias:0", "potentiometer_x_a:offset:0"]
)
def test_fault_of_value_zero_changes_nothing(fault):
    def seen(*faults):
        host = _Host(Emulator(injections=tuple(map(parse, faults))))
        return [(m.potentiometer, m.holder_gyro, m.base_gyro) for m in host.telemetry(50)]

    assert seen(fault) == seen()


@pytest.mark.parametrize("other", ["glitch:0.2@50-60", "stuck@50-60", "offset:5@50-60"])
def test_stuck_reading_stays_stuck_beside_a_fault_still_to_come(other):
    faults = (parse("potentiometer_x_a:stuck@0.02"), parse(f"potentiometer_x_a:{other}"))
    host = _Host(Emulator(injections=faults))
    host.send(Arm(), drive(3200, timeout=2000))
    codes = np.array([m.potentiometer for m in host.telemetry(400)])
    moved = np.abs(codes[-50:].mean(axis=0) - codes[:8].mean(axis=0))
    assert moved[0] < 1.0  # 0.6 codes of noise, 8 readings
    assert moved[1] > 10


@pytest.mark.parametrize(
    ("target", "flag", "other", "k"),
    [
        ("imu", Flags.HOLDER_IMU, Flags.BASE_IMU, 0),
        ("base_imu", Flags.BASE_IMU, Flags.HOLDER_IMU, 1),
    ],
)
def test_unplugged_imu_loses_its_flag_keeps_its_last_reading_and_comes_back(target, flag, other, k):
    host = _Host(Emulator(injections=(parse(f"{target}:unplug:0.05@0.1"),)))
    frames = host.telemetry(200)
    gone = [m for m in frames if not m.flags & flag]
    assert len(gone) == 25
    assert all(m.flags & other for m in frames)
    readings = [(m.holder_gyro, m.base_gyro)[k] for m in gone]
    assert len(set(readings)) == 1
    assert gone[-1].imu_age_us[k] - gone[0].imu_age_us[k] == 48_000
    assert frames[-1].flags & flag
    assert frames[-1].imu_age_us == frames[0].imu_age_us


def test_age_of_an_imu_that_stays_away_stops_at_the_wires_largest():
    frames = _Host(Emulator(injections=(parse("imu:unplug:60"),))).telemetry(200)
    assert frames[-1].imu_age_us[0] == 0xFFFF
    assert frames[-1].holder_gyro == (0, 0, 0)


def test_reset_boots_the_board_again_disarmed_and_with_its_clock_at_zero():
    device = Emulator(injections=(parse("supply:reset@0.3"),), boot_us=7_000_000)
    host = _Host(device)
    host.send(Arm(), drive(3400, timeout=2000))
    assert host.telemetry(300)[-1].pulse[0] == 3400
    messages = host.receive(100)
    hello = next(m for m in messages if isinstance(m, Hello))
    assert hello.reset_cause == 4
    after = [m for m in messages[messages.index(hello) :] if isinstance(m, Telemetry)]
    assert [m.device_us for m in after[:3]] == [2000, 4000, 6000]
    assert [m.frame_us for m in after[:11]] == [m.device_us % 20_000 for m in after[:11]]
    assert all(m.pulse[0] == constants.PULSE_NEUTRAL and not m.flags & Flags.ARMED for m in after)
    assert not any(isinstance(m, Hello) for m in host.receive(300))


def test_dropped_and_corrupted_bytes_are_counted_and_no_wrong_value_is_accepted():
    faults = (parse("link:drop:0.002"), parse("link:corrupt:0.002"))
    host = _Host(Emulator(quiet(reference_rig()), injections=faults))
    frames = host.telemetry(1000)
    assert 200 < len(frames) < 480
    assert host.decoder.counters.crc_errors > 10
    assert {m.potentiometer for m in frames} == {(512, 512, 512, 512)}


def test_unplugged_cable_raises_and_the_servos_go_neutral():
    host = _Host(Emulator(injections=(parse("link:unplug:0.5@0.3"),)))
    host.send(Arm(), drive(3400))
    host.receive(299)
    host.device.advance_us(2000)
    with pytest.raises(UnpluggedError):
        host.device.read()
    with pytest.raises(UnpluggedError):
        host.device.write(b"x")
    host.device.advance_us(400_000)
    assert host.device.device.pulse[0] == constants.PULSE_NEUTRAL
    host.device.advance_us(200_000)
    assert host.telemetry()


def _serving(port):
    server = Server(Emulator(), port)
    thread = threading.Thread(target=server.run, daemon=True)
    thread.start()
    return server, thread


@pytest.mark.parametrize("kind", ["pty", "tcp"])
@pytest.mark.realtime
def test_served_rig_answers_over_a_real_port(kind):
    from hardware.link import Link

    port = PtyPort() if kind == "pty" else TcpPort()
    server, thread = _serving(port)
    try:
        with server, Link(port.url) as link:
            link.send(Ping(7))
            end, seen = time.monotonic() + 5, set()
            while time.monotonic() < end and not {Pong, Telemetry} <= seen:
                seen |= {type(frame.message) for frame in link.poll()}
                time.sleep(0.002)
            assert {Pong, Telemetry} <= seen
            server.stop()
            thread.join(2)
    finally:
        server.stop()


def test_tcp_listens_on_loopback_only_and_a_taken_port_is_reported():
    with Server(Emulator(), TcpPort()) as server:
        assert server.port._listener.getsockname()[0] == "127.0.0.1"
        number = int(server.port.url.rpartition(":")[2])
        with pytest.raises(ServerError, match=f"127.0.0.1:{number}"):
            serve(Emulator(), tcp=number)
    with pytest.raises(ServerError, match="65535"):
        TcpPort(99_999)
