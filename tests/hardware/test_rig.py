"""The rig seat: handshake, clock, losses, reconnect; over the emulator and over scripted lines."""

import os
import threading
import time
from dataclasses import replace
from math import radians

import numpy as np
import pytest

from hardware.calibration import nominal
from hardware.device import PtyPort, Server
from hardware.emulator import Emulator, parse, sample_rig
from hardware.emulator.emulator import IMU_AGE_US
from hardware.emulator.truth import exact_calibration
from hardware.frames import GimbalCommand
from hardware.protocol import (
    Arm,
    Board,
    Encoder,
    Flags,
    Frame,
    Hello,
    Telemetry,
    Unknown,
    constants,
    default_config,
    hello,
)
from hardware.rig import ClockEstimate, Converter, LockstepLine, Phase, Rig, RigError, in_process
from hardware.rig import unwrap as continue_stamp


def _advance(rig, device, milliseconds, command=None):
    frames = []
    for k in range(milliseconds):
        if command is not None and k % 4 == 0:
            rig.send(GimbalCommand(device.time_ns, command))
        device.advance_us(1000)
        frames += rig.poll()
    return frames


@pytest.fixture
def skewed():
    parameters = replace(sample_rig(3), skew=2e-3)
    device = Emulator(parameters, boot_us=2**32 - 1_000_000, seed=3)
    rig = in_process(device, exact_calibration(parameters))
    return device, rig


def test_connect_greets_synchronises_and_arms(skewed):
    device, rig = skewed
    assert rig.connect().board == Board.EMULATOR
    assert rig.phase is Phase.READY
    _advance(rig, device, 10)
    assert device.device.armed


def test_gimbal_goes_where_it_is_sent_and_the_state_says_so(skewed):
    device, rig = skewed
    rig.connect()
    target = (radians(4), radians(-3))
    _advance(rig, device, 1500, target)
    truth, _ = device.truth()
    # backlash and dead band of this rig: 0.5° of hysteresis, either side
    assert np.abs(np.subtract(truth, target)).max() < radians(0.6)
    assert np.abs(np.subtract(rig.state.angle, truth)).max() < radians(0.1)
    assert rig.state.healthy
    assert rig.health == "ok"


def test_frames_are_dated_in_host_time_across_the_wrap_of_a_skewed_clock(skewed):
    device, rig = skewed
    dated = {}
    device.observer = lambda stamp, *_: dated.__setitem__(stamp, device.bench.time)
    rig.connect()
    _advance(rig, device, 1000)
    frames = _advance(rig, device, 2000)
    assert frames[-1].device_us > 2**32
    error = [f.time_ns * 1e-9 - dated[f.device_us] for f in frames]
    # PING waits up to 1 ms for the emulator's tick, PONG for ours: half the difference remains
    assert np.abs(error).max() < 0.6e-3
    # the end of the line wanders by that much over a span of a second or two
    assert rig.statistics.skew == pytest.approx(2e-3, abs=3e-4)


def test_every_frame_of_a_poll_has_its_state(skewed):
    device, rig = skewed
    rig.connect()
    device.advance_us(40_000)
    frames = rig.poll()
    assert len(frames) > 15
    assert [s.time_ns for s in rig.states] == [f.time_ns for f in frames]
    assert rig.states[-1] is rig.state


def test_a_pong_is_heard_between_polls_and_frames_wait_for_the_next(skewed):
    device, rig = skewed
    rig.connect()
    frames = _advance(rig, device, 20)
    while not rig.listen():  # until a PING has gone out
        frames += _advance(rig, device, 1)
    began = device.time_ns
    while rig.listen():
        device.advance_us(1000)
    # the device's tick is 1 ms, and the PING went out one before
    assert rig.estimate.round_trip_ns <= device.time_ns - began + 1_000_000
    assert not rig.listen()
    device.advance_us(40_000)
    frames += (late := rig.poll())
    assert len(late) >= 20
    assert set(np.diff([f.device_us for f in frames])) == {2000}
    assert len(rig.states) == len(late)


def test_every_low_pass_gives_the_delay_of_the_data_sheet_and_half_a_sampling_period(skewed):
    """Register map 4.2, registers 25 and 26 [ms]: 8 kHz without the low-pass, else 1 kHz."""
    device, rig = skewed
    rig.connect()
    published = (0.98, 1.9, 2.8, 4.8, 8.3, 13.4, 18.6)
    sampled = (0.0625, 0.5, 0.5, 0.5, 0.5, 0.5, 0.5)  # on the mean, unsynchronised with the read
    for setting in (2, 0, 1, 3, 4, 5, 6):
        if setting != 2:  # the default
            rig.configure(replace(default_config(), dlpf=setting))
        _advance(rig, device, 20)
        age = 1e-3 * (published[setting] + sampled[setting]) + 1e-6 * IMU_AGE_US[0]
        assert rig.fusion.noise.gyro_delay == pytest.approx(age)


def test_close_drives_to_neutral(skewed):
    device, rig = skewed
    rig.connect()
    _advance(rig, device, 100, (0.1, 0.1))
    rig.close()
    device.advance_us(5000)
    assert device.device.pulse == (constants.PULSE_NEUTRAL,) * 3
    assert not device.device.armed


def test_pulses_stay_within_what_the_device_allows(skewed):
    device, rig = skewed
    rig.connect()
    _advance(rig, device, 20, (3.0, -3.0))
    assert constants.PULSE_MAXIMUM in device.device.pulse
    assert not device.device.flags & Flags.CLAMPED


def test_cable_pulled_three_times_leaves_three_gaps_and_the_run_goes_on():
    parameters = sample_rig(5)
    pulls = tuple(parse(f"link:unplug:0.3@{t}") for t in (1.0, 2.0, 3.0))
    device = Emulator(parameters, injections=pulls, seed=5)
    rig = in_process(device, exact_calibration(parameters))
    rig.connect()
    for start in (1000, 2000, 3000):
        _advance(rig, device, start - device.time_us // 1000, (0.05, 0.0))
        _advance(rig, device, 200, (0.05, 0.0))
        assert rig.phase is Phase.AWAY
        assert rig.health == "rig away"
        assert rig.send(GimbalCommand(0, (0.0, 0.0))) is None
        assert device.device.pulse == (constants.PULSE_NEUTRAL,) * 3
        _advance(rig, device, 400, (0.05, 0.0))
        assert rig.phase is Phase.READY
    gaps = rig.statistics.gaps
    assert len(gaps) == 3
    for gap, start in zip(gaps, (1.0, 2.0, 3.0), strict=True):
        assert gap.start_ns * 1e-9 == pytest.approx(start, abs=0.003)
        assert (gap.end_ns - gap.start_ns) * 1e-9 == pytest.approx(0.3, abs=0.003)
    frames = _advance(rig, device, 300, (0.05, 0.0))
    assert len(frames) > 100
    assert abs(rig.state.angle[0] - device.truth()[0][0]) < radians(0.2)


def test_losses_are_counted_on_both_sides():
    device = Emulator(injections=(parse("link:corrupt:0.001@0.5"),), seed=1)
    rig = in_process(device)
    rig.connect()
    frames = _advance(rig, device, 2500, (0.02, 0.0))
    s = rig.statistics
    assert s.crc_errors > 10
    assert s.device_crc_errors > 0
    # What did not arrive is counted, whichever way: 500 frames a second.
    sent = (frames[-1].device_us - frames[0].device_us) / 2000 + 1
    telemetry_lost = sent - len(frames)
    assert 0 < telemetry_lost <= s.lost + 1


class _Line:
    """A line that says what it is told to."""

    def __init__(self, frames=(), connected=True):
        self.frames, self.connected = list(frames), connected
        self.generation, self.polled_ns = 1, 0
        self.sent = []
        self.statistics = LockstepLine(Emulator(), lambda: 0).statistics

    def poll(self):
        frames, self.frames = self.frames, []
        return frames

    def send(self, message):
        self.sent.append(message)
        return 0

    def close(self):
        self.connected = False


def _rig(line, calibration=None):
    now = [0]

    def wait(ns):
        now[0] += ns

    return Rig(line, calibration, clock=lambda: now[0], wait=wait)


def _hello(**changes):
    return replace(hello(Board.NANO, 0, default_config(), serial=0x1234), **changes)


@pytest.mark.parametrize(
    ("message", "words"),
    [
        (_hello(protocol=2), "speaks protocol 2 .*this program protocol 1.*flash"),
        (_hello(layout=1), r"layout 0001.*flash"),
        (_hello(adc_levels=0), "scale of zero.*flash"),
        (_hello(tick_ns=0), "scale of zero.*flash"),
        (Unknown(0x81, b"\1\0"), "another version.*flash"),
    ],
)
def test_device_of_another_version_is_refused_in_one_line(message, words):
    rig = _rig(_Line([Frame(0, message)]))
    with pytest.raises(RigError, match=words) as caught:
        rig.connect()
    assert "\n" not in str(caught.value)


def test_calibration_of_another_rig_is_refused():
    rig = _rig(_Line([Frame(0, _hello())]), nominal(0x99))
    with pytest.raises(RigError, match="is of rig 00000099, this one is 00001234"):
        rig.connect()


def test_two_boards_with_one_firmware_are_two_rigs():
    from hardware.emulator import FirmwareRig
    from hardware.simavr import nano as avr

    if missing := avr.missing():
        assert not os.environ.get("CI"), f"missing in CI: {missing}"
        pytest.skip(f"AVR tools are not installed: {missing}")
    for k, refused in ((1, False), (2, True)):
        device = FirmwareRig(sample_rig(k))
        rig = in_process(device, exact_calibration(sample_rig(1)))
        if refused:
            with pytest.raises(RigError, match="the calibration is of rig"):
                rig.connect()
        else:
            rig.connect()
        rig.close()
        device.close()


def test_silence_is_told_apart_from_noise():
    with pytest.raises(RigError, match=r"nothing answered within 0\.5 s"):
        _rig(_Line()).connect(500_000_000)
    noisy = _Line()
    noisy.statistics = replace(noisy.statistics, received=900)
    with pytest.raises(RigError, match=r"900 bytes came but no frame .*baud"):
        _rig(noisy).connect(500_000_000)
    with pytest.raises(RigError, match=r"answered no PING"):
        _rig(_Line([Frame(0, _hello())])).connect(500_000_000)


def test_device_that_falls_silent_on_an_open_line_is_greeted_again(skewed):
    device, rig = skewed
    rig.connect()
    _advance(rig, device, 50)
    report, device._report = device._report, lambda _: None
    device.device.receive = lambda *_: None
    _advance(rig, device, 320)
    assert rig.phase is Phase.GREETING
    assert rig.health == "rig greeting"
    del device.device.receive
    device._report = report
    _advance(rig, device, 400)
    assert rig.phase is Phase.READY


@pytest.mark.parametrize("clock_us", [5_000_000, 3_000_000_000])  # before and past half a wrap
def test_a_device_whose_clock_starts_again_is_greeted_anew_though_its_hello_was_lost(clock_us):
    device = Emulator(boot_us=clock_us)
    rig = in_process(device)
    rig.connect()
    _advance(rig, device, 100)
    device._boot_us = -device._tick * 1000
    device.device.flags = 0
    (frame, *_) = _advance(rig, device, 6) or [None]
    assert frame is None or frame.device_us > clock_us  # none is dated by the clock of before
    assert rig.phase is not Phase.READY
    assert "its clock" in rig.reason
    assert "started again" in rig.reason
    _advance(rig, device, 300)
    assert rig.phase is Phase.READY
    frame = _advance(rig, device, 10)[-1]
    assert abs(frame.time_ns - device.time_ns) < 5_000_000
    assert device.device.armed


@pytest.mark.parametrize("held_ms", [80, 200, 290])
def test_frames_that_come_late_in_a_burst_are_no_clock_that_jumped(held_ms):
    """Looked for in pieces, between polls too, as a link hands out what a tunnel held back."""
    device = Emulator()
    rig = in_process(device)
    poll, backlog = rig.line.poll, []

    def in_pieces():
        backlog.extend(poll())
        piece = backlog[: 0 if device.time_ns < in_pieces.until else 14]
        del backlog[: len(piece)]
        return piece

    in_pieces.until = 0
    rig.line.poll = in_pieces
    rig.connect()
    frames = 0
    for _ in range(10):
        in_pieces.until = device.time_ns + held_ms * 1_000_000
        for _ in range(held_ms + 200):
            device.advance_us(1000)
            rig.listen()
            if device.time_us % 4000 == 0:
                frames += len(rig.poll())
    assert (rig.session, rig.reason) == (1, "")
    assert frames > 10 * (held_ms + 150) / 2


def test_an_arm_that_is_lost_is_sent_again_and_a_rig_that_refuses_is_lost(skewed):
    device, rig = skewed
    send, sent = rig.line.send, []

    def losing(message):
        if isinstance(message, Arm):
            sent.append(device.time_ns)
            if len(sent) <= losing.lost:
                return 0
        return send(message)

    losing.lost = 2
    rig.line.send = losing
    rig.connect()
    _advance(rig, device, 400)
    assert len(sent) == 3
    assert device.device.armed
    assert rig.phase is Phase.READY
    device.device.flags, losing.lost = 0, 10**6  # a brown-out that left its clock going, say
    _advance(rig, device, 530)
    assert rig.reason == "it refuses to be armed"
    assert rig.session == 1
    losing.lost = 0
    _advance(rig, device, 800)
    assert rig.session == 2
    assert device.device.armed


def test_a_rig_that_only_watches_leaves_the_device_disarmed():
    device = Emulator()
    rig = in_process(device, arm=False)
    rig.connect()
    _advance(rig, device, 900)
    assert rig.phase is Phase.READY
    assert not device.device.armed


def test_reboot_behind_our_back_begins_anew(skewed):
    device, rig = skewed
    rig.connect()
    _advance(rig, device, 50)
    device.device.flags = 0
    device.device._encoder = Encoder()
    device.device.hello()
    _advance(rig, device, 8)
    assert rig.phase is Phase.SYNCING
    _advance(rig, device, 300)
    assert rig.phase is Phase.READY
    assert device.device.armed


def test_skew_and_offset_survive_one_sided_delays():
    rng = np.random.default_rng(1)
    estimate, skew, offset = ClockEstimate(), 1.5e-3, 7_000_000
    for k in range(150):
        sent = 1_000_000_000 + 200_000_000 * k
        there = 300_000 + (rng.exponential(3e6) if rng.random() < 0.6 else 0)
        back = 300_000 + (rng.exponential(3e6) if rng.random() < 0.6 else 0)
        device = round((sent + there) / 1000 * (1 + skew)) + offset
        estimate.add(sent, round(sent + there + back), device, device)
    # A quarter of the exchanges is nearly undelayed on both ways.
    assert estimate.skew == pytest.approx(skew, abs=5e-6)
    at = round(20e9 / 1000 * (1 + skew)) + offset
    assert abs(estimate.host_ns(at) - 20e9) < 100_000


def test_stamps_go_on_over_the_wrap_and_back_again():
    assert continue_stamp(2**32 - 10, 5) == 2**32 + 5
    assert continue_stamp(2**32 + 5, 2**32 - 10) == 2**32 - 10
    assert continue_stamp(5 * 2**32 + 7, 9) == 5 * 2**32 + 9


def test_counts_become_si_units_by_the_scales_of_hello():
    h = _hello(gyro_range_dps=250, accelerometer_range_g=2, tick_ns=1000)
    raw = Telemetry(
        device_us=0, frame_us=0, potentiometer=(0, 256, 512, 1023), holder_gyro=(16384, 0, -16384),
        holder_accelerometer=(0, 0, 16384), base_gyro=(0, 0, 0), base_accelerometer=(0, 0, 0),
        imu_age_us=(0, 0), pulse=(1500, 0, 0), switches=0b0101, joystick=(512, 1023), flags=3,
        crc_errors=0, lost=0, overruns=0, skipped=0, acknowledged=0,
    )  # fmt: skip
    frame = Converter(h).frame(raw, 5, 6)
    assert frame.potentiometer == (0.0, 0.25, 0.5, 1023 / 1024)
    assert frame.gyro == pytest.approx((radians(125), 0, -radians(125)))
    assert frame.accelerometer[2] == pytest.approx(9.80665)
    assert frame.pulse[0] == pytest.approx(1.5e-3)
    assert frame.switches == (True, False, True, False)
    assert frame.joystick == pytest.approx((0.0, 1023 / 512 - 1))
    assert (frame.time_ns, frame.device_us, frame.flags) == (5, 6, 3)


@pytest.mark.parametrize(
    ("chip", "low_pass"), [(0x68, 2.8e-3), (0x70, 3.9e-3), (0x71, 3.9e-3), (0x12, 2.8e-3)]
)
def test_the_gyros_delay_is_that_of_the_chip_named_in_hello(chip, low_pass, monkeypatch):
    """Data sheets at DLPF 2: MPU-6050 98 Hz, 2.8 ms; MPU-6500 92 Hz, 3.9 ms."""
    monkeypatch.setattr("hardware.emulator.emulator.MPU6050", chip)
    device = Emulator()  # its HELLO at boot is of before the chips are read, as a Nano's is
    rig = in_process(device)
    assert rig.connect().imu_identity == (0, 0)
    for _ in range(50):
        device.advance_us(2000)
        rig.poll()
    assert rig.hello.imu_identity == (chip, chip)
    assert rig.gyro_delay == pytest.approx(low_pass + 0.5e-3 + IMU_AGE_US[0] * 1e-6)


@pytest.mark.realtime
def test_rig_over_a_real_pty_survives_a_pull():
    from hardware.link import Link

    device = Emulator(injections=(parse("link:unplug:0.4@1.0"),))
    server = Server(device, PtyPort())
    thread = threading.Thread(target=server.run, daemon=True)
    thread.start()
    try:
        with server:
            rig = Rig(Link(server.port.url))
            assert isinstance(rig.connect(), Hello)
            end, after = time.monotonic() + 8, 0
            while time.monotonic() < end and after < 50:
                got = rig.poll()
                after += len(got) if rig.statistics.gaps else 0
                rig.send(GimbalCommand(time.monotonic_ns(), (0.02, 0.0)))
                time.sleep(0.002)
            assert after >= 50
            assert len(rig.statistics.gaps) == 1
            rig.close()
            server.stop()
            thread.join(2)
    finally:
        server.stop()


def test_firmware_and_emulator_run_one_experiment_alike():
    from hardware.emulator import FirmwareRig
    from hardware.simavr import nano as avr

    if missing := avr.missing():
        pytest.skip(f"AVR tools are not installed: {missing}")
    parameters = sample_rig(6)
    tracks = []
    for kind in (Emulator, FirmwareRig):
        device = kind(parameters, seed=6)
        rig = in_process(device, replace(exact_calibration(parameters), rig=0))
        rig.connect()
        _advance(rig, device, 300 - device.time_us // 1000)
        track = []
        for k in range(900):
            angle = radians(4) if (k // 300) % 2 else radians(-4)
            _advance(rig, device, 1, (angle, -angle))
            track.append(device.truth()[0])
        tracks.append(np.array(track))
        rig.close()
        device.close()
    rms = np.sqrt(((tracks[0] - tracks[1]) ** 2).mean(axis=0))
    assert np.degrees(rms).max() < 0.3
