"""One suite for all boards: the behaviour that docs/protocol.md specifies."""

import json
import os
import random
import shutil
import subprocess
from dataclasses import replace
from inspect import signature
from itertools import pairwise

import pytest

from hardware.firmware.build import SKETCH
from hardware.protocol import (
    LAYOUT,
    PROTOCOL,
    Arm,
    Board,
    Command,
    Config,
    Disarm,
    Flags,
    Hello,
    HelloRequest,
    Mode,
    Name,
    Ping,
    Pong,
    Telemetry,
    constants,
    default_config,
    encode,
)
from hardware.protocol.codec import HEADER, crc16
from hardware.simavr import missing
from hardware.simavr import nano as simavr
from tests.hardware.boards import FRAME_MS, WAIT_MS, CoreRig, EmulatorRig, NanoRig, PiRig
from tests.hardware.core import COVERAGE, Core, build

NEUTRAL = (constants.PULSE_NEUTRAL,) * 3
AWAY = (3500, 2500, 3300)
BOARDS = ("emulator", "core", "nano", "raspberry-pi")


def drive(pulse=AWAY, timeout_ms=1000, mode=Mode.DRIVE):
    return Command(pulse, timeout_ms, mode)


@pytest.fixture(params=BOARDS)
def make(request, tmp_path):
    """Makes boards of one kind; `make(serial)` has a serial number in its memory."""
    made = []

    def make(serial=0):
        match request.param:
            case "emulator":
                made.append(EmulatorRig(serial))
            case "core":
                made.append(CoreRig(request.getfixturevalue("running"), serial))
            case "nano":
                if absent := missing():
                    assert not os.environ.get("CI"), f"missing in CI: {absent}"
                    pytest.skip(f"the simulated Nano needs {simavr.PACKAGES}")
                made.append(NanoRig(serial))
            case _:
                folder = tmp_path / str(len(made))
                folder.mkdir()
                made.append(PiRig(folder, serial))
        return made[-1]

    yield make
    for rig in made:
        rig.close()


@pytest.fixture
def rig(make):
    rig = make()
    rig.run(10)
    return rig


@pytest.mark.thorough
def test_hello_at_boot_carries_the_kind_of_board_and_the_default_settings(make):
    rig = make()
    first = rig.run(5)[0]
    assert first.sequence == 0
    hello, config = first.message, default_config()
    assert (hello.protocol, hello.layout, hello.board) == (PROTOCOL, LAYOUT, rig.kind)
    for name in ("telemetry_period_ms", "dlpf", "neutral", "minimum", "maximum"):
        assert getattr(hello, name) == getattr(config, name)
    assert rig.driven() == NEUTRAL


def test_hello_names_the_imus_once_they_have_been_read(rig):
    rig.run(60)
    known = (0, 0) if isinstance(rig, CoreRig) else (0x68, 0x68)  # the core alone reads no IMU
    assert rig.hello().imu_identity == known


def test_telemetry_is_sent_every_2_ms_without_a_gap(rig):
    rig.run(30)  # a Nano sets up its IMUs first, which takes longer than reading them
    frames = rig.run(400)
    assert all(b.sequence == a.sequence + 1 for a, b in pairwise(frames))
    stamps = [f.message.device_us for f in frames]
    assert len(stamps) in (199, 200, 201)
    # A Nano's conversions begin when its bus is done, some 0.1 ms sooner or later.
    assert all(abs(b - a - 2000) < 200 for a, b in pairwise(stamps))
    last = frames[-1].message
    assert (last.crc_errors, last.lost, last.overruns, last.skipped) == (0, 0, 0, 0)
    untimed = Flags.PULSE_UNTIMED if rig.kind is Board.RASPBERRY_PI else Flags(0)
    assert Flags(last.flags) == Flags.HOLDER_IMU | Flags.BASE_IMU | untimed


def test_commands_are_refused_and_not_acknowledged_before_arm(rig):
    acknowledged = rig.after(Ping(0)).acknowledged
    shown = rig.after(drive())
    assert shown.flags & Flags.REFUSED
    assert shown.acknowledged == acknowledged
    assert rig.driven() == NEUTRAL


def test_an_armed_command_is_obeyed_and_acknowledged(rig):
    shown = rig.after(Arm(), drive())
    assert shown.acknowledged == rig.encoder.sequence - 1
    states = Flags.ARMED | Flags.DRIVING | Flags.REFUSED | Flags.CLAMPED | Flags.TIMED_OUT
    assert Flags(shown.flags) & states == Flags.ARMED | Flags.DRIVING
    assert rig.driven() == AWAY


def test_pulses_are_clamped_to_the_tick(rig):
    rig.send(Arm())
    low, high = constants.PULSE_MINIMUM, constants.PULSE_MAXIMUM
    for asked in (0, 1, low - 1, low, low + 1, high - 1, high, high + 1, 65535):
        given = min(max(asked or NEUTRAL[0], low), high)
        shown = rig.after(drive((asked,) * 3))
        assert bool(shown.flags & Flags.CLAMPED) == (asked not in (0, given))
        assert rig.driven() == (given,) * 3


def test_servos_go_to_neutral_within_a_frame_when_commands_stop(rig):
    for timeout_ms in (1, 50, 133):
        rig.send(Arm(), drive(timeout_ms=timeout_ms))
        since = rig.time_ms
        shown = [(rig.time_ms - since, m) for _ in range(200) for m in rig.messages(Telemetry, 1)]
        for age, m in shown:
            # The command has to arrive and a frame to begin; later, one more frame to begin.
            if FRAME_MS + WAIT_MS < age < timeout_ms:
                assert m.pulse == AWAY
            if age > timeout_ms + FRAME_MS + WAIT_MS:
                assert m.pulse == NEUTRAL
            if age > timeout_ms + WAIT_MS:
                assert m.flags & Flags.TIMED_OUT
                assert not m.flags & Flags.DRIVING
        assert rig.driven() == NEUTRAL


def test_no_command_lasts_longer_than_2_s(rig):
    rig.send(Arm(), drive(timeout_ms=60_000))
    rig.run(constants.TIMEOUT_LONGEST_MS - 100)
    assert rig.telemetry().pulse == AWAY
    rig.run(100)
    assert rig.driven() == NEUTRAL


def test_the_timeout_flag_stays_until_arm_though_driving_goes_on(rig):
    rig.send(Arm(), drive(timeout_ms=20))
    rig.run(50)
    driving = rig.after(drive())
    assert driving.flags & Flags.DRIVING
    assert driving.flags & Flags.TIMED_OUT
    assert not rig.after(Arm()).flags & (Flags.TIMED_OUT | Flags.DRIVING)
    assert rig.driven() == NEUTRAL


def test_disarmed_servos_go_to_neutral_and_stay_at_it(rig):
    rig.send(Arm(), drive())
    assert rig.driven() == AWAY
    shown = rig.after(Disarm())
    assert not shown.flags & (Flags.ARMED | Flags.DRIVING | Flags.REFUSED)
    assert rig.driven() == NEUTRAL
    assert rig.after(drive()).flags & Flags.REFUSED
    assert rig.driven() == NEUTRAL


def test_a_neutral_command_ends_driving(rig):
    rig.send(Arm(), drive())
    shown = rig.after(drive(mode=Mode.NEUTRAL))
    assert not shown.flags & (Flags.DRIVING | Flags.REFUSED)
    assert rig.driven() == NEUTRAL


def test_a_command_without_a_timeout_or_of_an_unknown_mode_is_refused(rig):
    rig.send(Arm(), drive())
    for bad in (drive(NEUTRAL, timeout_ms=0), drive(NEUTRAL, mode=2), drive(NEUTRAL, mode=255)):
        shown = rig.after(bad)
        assert shown.flags & Flags.REFUSED
        assert shown.flags & Flags.DRIVING
    assert rig.driven() == AWAY


WANTED = Config(10, 5, (2900, 3000, 3100), (2000, 2100, 2200), (4000, 4100, 4200))


def test_settings_are_applied_and_returned_in_hello(rig):
    rig.send(Arm(), drive())
    shown = rig.after(WANTED)
    assert not shown.flags & (Flags.REFUSED | Flags.DRIVING)
    assert rig.driven() == WANTED.neutral
    hello = rig.hello()
    for name in ("telemetry_period_ms", "dlpf", "neutral", "minimum", "maximum"):
        assert getattr(hello, name) == getattr(WANTED, name)
    stamps = [m.device_us for m in rig.messages(Telemetry, 200)]
    assert all(abs(b - a - 10_000) < 200 for a, b in pairwise(stamps))
    rig.send(Arm(), drive((5000, 1, 0)))
    assert rig.driven() == (4000, 2100, 3100)


def test_implausible_settings_are_refused_as_a_whole(rig):
    good = replace(WANTED, telemetry_period_ms=2)
    rig.send(good)
    for bad in (
        replace(good, telemetry_period_ms=1, dlpf=0),
        replace(good, telemetry_period_ms=251, dlpf=0),
        replace(good, telemetry_period_ms=4, dlpf=7),
        replace(good, telemetry_period_ms=4, minimum=(999, 2000, 2000)),
        replace(good, telemetry_period_ms=4, neutral=(3000, 2099, 3000)),
        replace(good, telemetry_period_ms=4, neutral=(3000, 3000, 4201)),
        replace(good, telemetry_period_ms=4, maximum=(4000, 4000, 5001)),
    ):
        assert rig.after(bad).flags & Flags.REFUSED
        hello = rig.hello()
        assert (hello.telemetry_period_ms, hello.dlpf) == (2, 5)
        assert (hello.neutral, hello.minimum, hello.maximum) == (
            good.neutral,
            good.minimum,
            good.maximum,
        )


def test_a_board_takes_one_serial_number_and_no_other(rig):
    assert rig.hello().serial == constants.SERIAL_NONE
    for number in (constants.SERIAL_NONE, constants.SERIAL_BLANK):
        assert rig.after(Name(number)).flags & Flags.REFUSED
        assert rig.hello().serial == constants.SERIAL_NONE
    assert not rig.after(Name(0xDEADBEEF)).flags & Flags.REFUSED
    assert rig.after(Name(5)).flags & Flags.REFUSED
    assert rig.hello().serial == 0xDEADBEEF


def test_a_board_with_a_serial_number_reports_and_keeps_it(make):
    rig = make(77)
    assert rig.messages(Hello, 5)[0].serial == 77
    assert rig.after(Name(5)).flags & Flags.REFUSED
    assert rig.hello().serial == 77


def test_pong_returns_the_stamp_and_dates_the_arrival(rig):
    ages = []
    for k in range(12):
        rig.run(k)
        sent_us, ping = 1000 * rig.time_ms, Ping(2**63 + k)
        rig.send(ping)
        (pong,) = rig.messages(Pong, WAIT_MS)
        assert pong.host_ns == ping.host_ns
        assert 0 <= pong.sent_us - pong.received_us < 1000 * WAIT_MS
        ages.append(pong.received_us - sent_us)
    # The device's clock began with its program, so the offset is one constant of some ms.
    assert max(ages) - min(ages) <= rig.stamp_us
    assert abs(ages[0]) < 1000 * WAIT_MS


def test_a_flood_loses_frames_but_neither_the_rig_nor_its_safety(rig):
    rig.send(Arm(), drive(timeout_ms=200))
    for flood in (HelloRequest(), Ping(1), drive((4000,) * 3, timeout_ms=200)):
        rig.write(b"".join(rig.encoder.encode(flood) for _ in range(300)))
        rig.run(200)
    rig.send(Ping(2))  # what arrived last of the flood may have lost its delimiter
    rig.run(200 + 2 * FRAME_MS)  # the flood's last command runs out
    rig.send(Ping(3))
    frames = [f.message for f in rig.run(50)]
    assert [m.host_ns for m in frames if isinstance(m, Pong)] == [3]
    shown = [m for m in frames if isinstance(m, Telemetry)]
    assert len(shown) >= 24
    assert shown[-1].pulse == NEUTRAL
    assert shown[-1].flags & Flags.TIMED_OUT


def test_frames_without_room_on_the_line_are_dropped_whole_and_counted(rig):
    for _ in range(40):
        rig.send(HelloRequest())  # 6 bytes that ask for 68
    frames = rig.run(200)
    assert rig.decoder.counters.crc_errors == rig.decoder.counters.lost == 0
    hellos = sum(isinstance(f.message, Hello) for f in frames)
    skipped = rig.telemetry().skipped
    assert hellos == 40 if skipped == 0 else hellos < 40


def _broken(rig, frame):
    return bytes(b ^ 0x40 if k == 5 else b for k, b in enumerate(frame))


def test_a_broken_frame_is_counted_and_changes_nothing(rig):
    rig.send(Arm())
    before = rig.after(Ping(1))
    rig.write(_broken(rig, rig.encoder.encode(drive((4000,) * 3))))
    shown = rig.after(Ping(2))
    assert shown.crc_errors == before.crc_errors + 1
    assert shown.lost == before.lost + 1
    assert rig.driven() == NEUTRAL


def test_it_resynchronises_at_the_next_delimiter_after_any_garbage(rig):
    rig.after(Ping(0))
    source, frame = random.Random(4), encode(Ping(9), 0)
    noise = bytes(source.randrange(1, 256) for _ in range(300))  # too long for any frame
    runs = (noise, noise[:40], frame[:7], b"\0\0\0", b"\1", b"\x05\1\1", frame[:-1] + b"\7")
    for garbage in runs:
        rig.write(garbage + b"\0")
        rig.send(Ping(5))
        assert [m.host_ns for m in rig.messages(Pong, WAIT_MS + len(garbage) // 40)] == [5]


def _frame(type_id, payload, sequence):
    """A valid frame of any type and payload."""
    from cobs import cobs

    body = HEADER.pack(type_id, sequence) + payload
    return cobs.encode(body + crc16(body).to_bytes(2, "little")) + b"\0"


def test_frames_of_unknown_type_or_length_have_no_effect(rig):
    rig.send(Arm(), drive())
    sizes = {0x01: 1, 0x02: 8, 0x03: 7, 0x05: 1, 0x06: 19, 0x07: 3, 0x70: 4}
    for type_id, size in sizes.items():
        acknowledged = rig.after(drive()).acknowledged
        rig.write(_frame(type_id, bytes(size), rig.encoder.sequence))
        rig.encoder.sequence += 1
        shown = rig.telemetry()
        assert shown.acknowledged == acknowledged, hex(type_id)
        assert shown.flags & Flags.DRIVING
    assert rig.driven() == AWAY


def test_lost_frames_are_counted_but_not_the_restart_of_a_host(rig):
    for sequence in (4990, 5000, 0, 1):
        rig.write(encode(Ping(0), sequence))
    assert rig.telemetry().lost == 9


def test_random_bytes_never_arm_it(rig):
    source = random.Random(6)
    for _ in range(20):
        rig.write(source.randbytes(1000))
        shown = rig.messages(Telemetry, 30)
        # ARM needs one type in 256 and an empty payload besides a CRC match.
        assert not any(m.flags & Flags.ARMED for m in shown)
    rig.write(b"\0")
    assert rig.driven() == NEUTRAL


SCENARIOS = {
    name: test
    for name, test in list(globals().items())
    if name.startswith("test_") and set(signature(test).parameters) <= {"rig", "make"}
}


@pytest.mark.thorough
def test_the_suite_runs_every_line_of_the_firmwares_core(tmp_path):
    if shutil.which("gcov") is None:
        assert not os.environ.get("CI"), "gcov is missing in CI"
        pytest.skip("gcov is not installed")
    core = Core.start(build(tmp_path, COVERAGE))

    def make(serial=0):
        return CoreRig(core, serial)

    def rig():
        made = make()
        made.run(10)
        return made

    for test in SCENARIOS.values():
        test(make) if "make" in signature(test).parameters else test(rig())
    core.stop()
    for unit in ("core", "framing"):
        assert not _missed(tmp_path, unit)


def _missed(folder, unit):
    """Lines of a unit that never ran, with their text."""
    command = ["gcov", "--json-format", "--stdout", f"{unit}.gcda"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=True)
    files = json.loads(done.stdout)["files"]
    (lines,) = [f["lines"] for f in files if f["file"].endswith(f"{unit}.cpp")]
    assert len(lines) > 50
    text = (SKETCH / f"{unit}.cpp").read_text(encoding="utf-8").splitlines()
    return [(n, text[n - 1].strip()) for n in (x["line_number"] for x in lines if not x["count"])]
