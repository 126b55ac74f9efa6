"""The firmware's portable core, compiled for the host under ASan and UBSan."""

import random
from dataclasses import dataclass, field, replace

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from hardware.firmware.build import build_hash
from hardware.protocol import (
    Arm,
    Board,
    Command,
    Config,
    Decoder,
    Disarm,
    Encoder,
    Flags,
    Frame,
    HelloRequest,
    Mode,
    Ping,
    Pong,
    Telemetry,
    default_config,
    encode,
    hello,
    plausible,
)
from tests.hardware.core import BLANK, WRAP, Core

NEUTRAL = (3000, 3000, 3000)


@pytest.fixture
def core(running) -> Core:
    return running.fresh()


shared_core = settings(
    deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=60
)
u16 = st.integers(0, 0xFFFF)
pulses = st.tuples(u16, u16, u16)
limits = st.lists(st.integers(900, 5100), min_size=3, max_size=3).map(sorted)
configs = st.builds(
    lambda period, dlpf, axes: Config(
        period, dlpf, *zip(*[(n, lo, hi) for lo, n, hi in axes], strict=True)
    ),
    st.integers(0, 255),
    st.integers(0, 9),
    st.tuples(limits, limits, limits),
)
commands = st.builds(Command, pulses, st.integers(0, 3000), st.integers(0, 3))
steps = st.lists(
    st.tuples(
        st.one_of(commands, configs, st.just(Arm()), st.just(Disarm()), st.just(None)),
        st.integers(0, 500_000),
    ),
    max_size=25,
)


def test_hello_at_boot_equals_pythons_byte_for_byte(core):
    greeting = hello(Board.NANO, build_hash(), default_config(), reset_cause=4)
    assert core.boot(cause=4).sent == b"\0" + encode(greeting, 0)


telemetries = st.builds(
    Telemetry,
    device_us=st.integers(0, WRAP - 1),
    frame_us=u16,
    potentiometer=st.tuples(u16, u16, u16, u16),
    holder_gyro=st.tuples(*[st.integers(-32768, 32767)] * 3),
    holder_accelerometer=st.tuples(*[st.integers(-32768, 32767)] * 3),
    base_gyro=st.tuples(*[st.integers(-32768, 32767)] * 3),
    base_accelerometer=st.tuples(*[st.integers(-32768, 32767)] * 3),
    imu_age_us=st.tuples(u16, u16),
    pulse=pulses,
    switches=st.integers(0, 15),
    joystick=st.tuples(u16, u16),
    flags=st.integers(0, 3).map(lambda bits: bits << 5),
    crc_errors=st.just(0),
    lost=st.just(0),
    overruns=st.just(0),
    skipped=st.just(0),
    acknowledged=st.just(0),
)


@shared_core
@given(telemetries)
def test_telemetry_equals_pythons_byte_for_byte(running, sample):
    assert running.fresh().report(sample).sent == encode(sample, 0)


@pytest.mark.parametrize("start", [0, 5_000_000, WRAP - 60_000, WRAP - 1])
def test_the_timeout_ends_a_command_exactly_on_time_even_as_the_clock_wraps(core, start):
    core.send(Arm(), start)
    core.send(Command((3500, 2500, 3300), 100, Mode.DRIVE), start)
    assert core.update(start + 1).pulse == (3500, 2500, 3300)
    assert core.update(start + 99_999).pulse == (3500, 2500, 3300)
    assert core.update(start + 100_000).pulse == NEUTRAL
    assert Flags(core.telemetry().flags) == Flags.ARMED | Flags.TIMED_OUT


@dataclass
class Reference:
    """The manual's "What keeps the servos safe", in Python."""

    config: Config = field(default_factory=default_config)
    armed: bool = False
    timed_out: bool = False
    pulse: tuple = NEUTRAL
    deadline: int | None = None

    def neutral(self) -> None:
        self.pulse, self.deadline = self.config.neutral, None

    def receive(self, message, now: int) -> bool:
        match message:
            case Arm() | Disarm():
                self.armed = isinstance(message, Arm)
                self.timed_out &= not self.armed
            case Config():
                if not plausible(message):
                    return False
                self.config = message
            case Command():
                if not self.armed or message.mode > 1 or message.timeout_ms == 0:
                    return False
                if message.mode == Mode.DRIVE:
                    axes = zip(
                        message.pulse,
                        self.config.neutral,
                        self.config.minimum,
                        self.config.maximum,
                        strict=True,
                    )
                    self.pulse = tuple(min(max(p or n, lo), hi) for p, n, lo, hi in axes)
                    self.deadline = now + 1000 * min(message.timeout_ms, 2000)
                    return True
        self.neutral()
        return True

    def elapse(self, now: int) -> None:
        if self.deadline is not None and now >= self.deadline:
            self.neutral()
            self.timed_out = True


@shared_core
@given(steps)
def test_any_conversation_drives_the_servos_by_the_manual(running, conversation):
    core, reference, now = running.fresh(), Reference(), 0
    for message, wait in conversation:
        now += wait
        core.update(now)
        reference.elapse(now)
        obeyed = True
        if message is not None:
            core.send(message, now)
            obeyed = reference.receive(message, now)
        t = core.telemetry()
        assert core.update(now).pulse == reference.pulse
        assert bool(t.flags & Flags.ARMED) == reference.armed
        assert bool(t.flags & Flags.DRIVING) == (reference.deadline is not None)
        assert bool(t.flags & Flags.TIMED_OUT) == reference.timed_out
        assert message is None or bool(t.flags & Flags.REFUSED) != obeyed


@shared_core
@given(steps)
def test_no_conversation_moves_a_pulse_outside_the_limits(running, conversation):
    core, now = running.fresh(), 0
    limits = default_config()
    for message, wait in conversation:
        now += wait
        answer = core.send(message, now) if message is not None else core.update(now)
        if isinstance(message, Config) and plausible(message):
            limits = message
        for pulse, low, high in zip(answer.pulse, limits.minimum, limits.maximum, strict=True):
            assert max(low, 1000) <= pulse <= min(high, 5000)


def test_pong_carries_both_device_stamps(core):
    ping = core.encoder.encode(Ping(2**63 + 5))
    answer = core.receive(ping, at=1000, now=1234)
    assert answer.frames == [Frame(0, Pong(2**63 + 5, 1000, 1234))]


def test_pong_behind_a_queue_is_dated_when_its_first_byte_will_leave(core):
    core.ask("room", 0)
    core.report(BLANK)
    core.receive(core.encoder.encode(Ping(9)), at=500, now=600)
    telemetry, pong = core.ask("room", 1000).frames
    queued = len(encode(telemetry.message, 0)) + 2  # two more in the UART's own registers
    assert pong.message.sent_us == 600 + queued * 20  # 10 bits at 500 kbaud


def test_a_full_line_drops_whole_frames_and_counts_them(core):
    core.ask("room", 0)
    for _ in range(5):
        core.report(BLANK)
    frames = core.ask("room", 1000).frames
    # 255 bytes of ring hold three frames of 72.
    assert [frame.sequence for frame in frames] == [0, 1, 2]
    assert core.telemetry().skipped == 2


def test_receive_overruns_are_flagged_until_the_host_says_hello(core):
    loss = replace(BLANK, overruns=3)
    assert core.report(loss).frames[0].message.flags & Flags.RECEIVE_OVERRUN
    core.send(HelloRequest())
    assert not core.report(loss).frames[0].message.flags & Flags.RECEIVE_OVERRUN


def test_the_core_counts_the_same_errors_as_the_python_decoder_on_a_hostile_stream(core):
    source = random.Random(5)
    decoder, encoder = Decoder(), Encoder()
    for _ in range(400):
        block = bytearray()
        for _ in range(10):
            frame = bytearray(encoder.encode(source.choice([Ping(source.getrandbits(64)), Arm()])))
            if source.random() < 0.2:
                frame[source.randrange(len(frame))] = source.randrange(256)
            if source.random() < 0.1:
                frame = source.randbytes(source.randrange(200))
            block += frame
        core.receive(bytes(block))
        decoder.receive_data(bytes(block))
        list(decoder)
    t = core.telemetry()
    assert decoder.counters.crc_errors > 500
    assert (t.crc_errors, t.lost) == (decoder.counters.crc_errors, decoder.counters.lost % 65536)


def test_a_million_random_bytes_neither_crash_the_core_nor_arm_it(core):
    source = random.Random(6)
    for _ in range(50):
        answer = core.receive(source.randbytes(20_000))
        # Arm needs one type in 256 and an empty payload besides a CRC match: once in 10^9 runs.
        assert not answer.armed
        assert answer.pulse == NEUTRAL


def _imu(core: Core, *words: object) -> list[int]:
    return [int(number) for number in core.line(*words)]


def _round(core: Core, answers: dict[int, str | None], now: int = 0) -> list[tuple[int, ...]]:
    """Run one round over the bus; returns its transactions as (address, reg, value, count)."""
    state = _imu(core, "imu_begin")
    seen = []
    while state[0]:
        seen.append(tuple(state[1:5]))
        data = answers[state[1]]
        state = _imu(core, "imu_done", data is not None, now, data or "00" * 14)
    return seen


READING = bytes.fromhex("0102 fffe 7fff 0b0c 8000 0001 0203").hex()


def test_imus_are_set_up_register_by_register_and_then_read(core):
    _imu(core, "imu_new")
    both = {0x68: READING, 0x69: READING}
    written = [_round(core, both) for _ in range(6)]
    # RM-MPU-6000A-00: PLL on gyro x; DLPF 2; ±500 °/s; ±4 g; sample rate undivided.
    expected = [(0x75, 0), (0x6B, 1), (0x1A, 2), (0x1B, 8), (0x1C, 8), (0x19, 0)]
    assert [(r[0][1], r[0][2]) for r in written] == expected
    assert [(r[1][1], r[1][2]) for r in written] == expected
    assert [r[0][3] for r in written] == [1, 0, 0, 0, 0, 0]  # the first reads WHO_AM_I
    assert _round(core, both, now=77) == [(0x68, 0x3B, 0, 14), (0x69, 0x3B, 0, 14)]
    state = _imu(core, "imu_configure", 2)
    assert state[5:13] == [1, 77, -32768, 1, 0x0203, 0x0102, -2, 0x7FFF]


@pytest.mark.parametrize("trouble", [None, "00" * 14], ids=["unplugged", "asleep"])
def test_an_imu_that_does_not_answer_is_set_up_again(core, trouble):
    _imu(core, "imu_new")
    for _ in range(7):
        _round(core, {0x68: READING, 0x69: READING})
    _round(core, {0x68: trouble, 0x69: READING})
    state = _imu(core, "imu_configure", 2)
    assert (state[5], state[13]) == (0, 1)
    assert _round(core, {0x68: READING, 0x69: READING})[0][1:3] == (0x75, 0)


def test_another_filter_setting_sets_both_imus_up_again(core):
    _imu(core, "imu_new")
    for _ in range(7):
        _round(core, {0x68: READING, 0x69: READING})
    _imu(core, "imu_configure", 6)
    rounds = [_round(core, {0x68: READING, 0x69: READING}) for _ in range(2)]
    assert rounds[1] == [(0x68, 0x1A, 6, 0), (0x69, 0x1A, 6, 0)]
