"""The codec against a straightforward reading of its specification, and against noise."""

import random
import struct
from binascii import crc_hqx
from dataclasses import fields, replace
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hardware.firmware import generated
from hardware.protocol import (
    MAX_ENCODED,
    MESSAGES,
    Arm,
    Board,
    Command,
    Config,
    Decoder,
    Encoder,
    Frame,
    Hello,
    Mode,
    Ping,
    Telemetry,
    Unknown,
    constants,
    default_config,
    encode,
    hello,
    layout,
    plausible,
)

ROOT = Path(__file__).resolve().parents[2]
LIMITS = {
    "B": (0, 0xFF),
    "H": (0, 0xFFFF),
    "h": (-0x8000, 0x7FFF),
    "I": (0, 2**32 - 1),
    "Q": (0, 2**64 - 1),
}


def _messages(cls):
    values = []
    for field in layout(cls).fields:
        number = st.integers(*LIMITS[field.wire.code])
        count = field.wire.count
        values.append(number if count == 1 else st.tuples(*[number] * count))
    return st.builds(cls, *values)


messages = st.one_of(*[_messages(cls) for cls in MESSAGES])
frames = st.lists(st.tuples(messages, st.integers(0, 0xFFFF)), max_size=6)


def _decode(data: bytes, *, piece: int | None = None) -> tuple[list[Frame], Decoder]:
    decoder = Decoder()
    received = []
    step = piece or max(len(data), 1)
    for at in range(0, len(data), step):
        decoder.receive_data(data[at : at + step])
        received += list(decoder)
    return received, decoder


def _stuff_by_hand(content: bytes) -> bytes:
    """COBS as Cheshire and Baker describe it (IEEE/ACM ToN 7(2), 1999), below 254 bytes."""
    return b"".join(bytes([len(run) + 1]) + run for run in content.split(b"\0"))


@given(messages, st.integers(0, 0xFFFF))
def test_a_frame_is_the_documented_bytes(message, sequence):
    place = layout(type(message))
    flat = []
    for field in place.fields:
        value = getattr(message, field.name)
        flat += [value] if field.wire.count == 1 else list(value)
    codes = "".join(f.wire.code * f.wire.count for f in place.fields)
    body = struct.pack("<BH" + codes, place.type_id, sequence, *flat)
    content = body + struct.pack("<H", crc_hqx(body, 0xFFFF))
    assert encode(message, sequence) == _stuff_by_hand(content) + b"\0"


@given(frames)
def test_frames_survive_whole_and_byte_by_byte(sent):
    wire = b"".join(encode(message, sequence) for message, sequence in sent)
    expected = [Frame(sequence, message) for message, sequence in sent]
    assert _decode(wire)[0] == expected
    assert _decode(wire, piece=1)[0] == expected


@given(messages, st.integers(0, 0xFFFF), st.binary(max_size=300))
def test_bytes_after_a_frame_do_not_touch_it(message, sequence, trailing):
    received, _ = _decode(encode(message, sequence) + trailing)
    assert received[0] == Frame(sequence, message)


@given(st.binary(max_size=300).filter(lambda b: b and b[-1]), messages)
def test_the_frame_after_noise_is_received_when_a_delimiter_parts_them(noise, message):
    received, decoder = _decode(noise + b"\0" + encode(message, 7))
    assert received[-1] == Frame(7, message)
    assert decoder.counters.garbage <= len(noise) + 1


@given(st.lists(st.binary(max_size=200), max_size=8))
def test_any_bytes_in_any_pieces_never_raise(pieces):
    decoder = Decoder()
    for piece in pieces:
        decoder.receive_data(piece)
        list(decoder)


runs = st.binary(max_size=250).map(lambda run: run.replace(b"\0", b"\1") + b"\0")
streams = st.lists(st.one_of(runs, messages.map(lambda m: encode(m, 1))), max_size=6)


@given(streams.map(b"".join), st.integers(1, 64))
def test_counters_do_not_depend_on_how_the_stream_was_cut(data, piece):
    assert _decode(data)[1].counters == _decode(data, piece=piece)[1].counters


def _telemetry(source: random.Random) -> Telemetry:
    flat = [
        [source.randint(*LIMITS[f.wire.code]) for _ in range(f.wire.count)]
        for f in layout(Telemetry).fields
    ]
    return Telemetry(*[v[0] if len(v) == 1 else tuple(v) for v in flat])


def _hostile(count: int, seed: int) -> tuple[int, int, int]:
    """Feed `count` bytes of noise and mutated frames; returns bytes, runs and forged frames."""
    source = random.Random(seed)
    templates = [encode(_telemetry(source), n) for n in range(64)]
    templates += [encode(Command((3000, n, 0), 100, Mode.DRIVE), n) for n in range(64)]
    genuine = set(templates)
    decoder = Decoder()
    fed = runs = forged = 0
    while fed < count:
        if source.random() < 0.3:
            data = source.randbytes(source.randint(1, 400)) + b"\0"
        else:
            mutated = bytearray(source.choice(templates))
            for _ in range(source.randint(1, 4)):
                mutated[source.randrange(len(mutated))] = source.randrange(256)
            data = bytes(mutated)
        fed += len(data)
        runs += data.count(0)
        decoder.receive_data(data)
        forged += sum(
            isinstance(frame.message, Unknown)
            or encode(frame.message, frame.sequence) not in genuine
            for frame in decoder
        )
    return fed, runs, forged


def _chance(runs: int) -> float:
    # A run that is not a frame passes CRC-16 with 2^-16; five standard deviations of the Poisson
    # count above its mean, and at least two, so that one run in about 10^6 fails by luck.
    mean = runs / 65536
    return max(2.0, mean + 5 * mean**0.5)


def test_ten_million_hostile_bytes_forge_no_frame_beyond_crc_chance():
    fed, runs, forged = _hostile(10_000_000, seed=2)
    assert fed >= 10_000_000
    assert forged <= _chance(runs)


def test_every_single_bit_error_is_caught():
    wire = encode(Ping(123456789), 77)
    for bit in range(8 * (len(wire) - 1)):
        broken = bytearray(wire)
        broken[bit // 8] ^= 1 << bit % 8
        received, _ = _decode(bytes(broken))
        # A flip that makes a zero splits the frame: neither part may pass either.
        assert received == []


def test_lost_frames_are_counted_across_the_wrap_of_the_sequence():
    decoder = Decoder()
    for sequence in (65533, 65534, 2, 3):  # 65535, 0 and 1 never arrive
        decoder.receive_data(encode(Arm(), sequence))
        list(decoder)
    assert decoder.counters.lost == 3


def test_a_reboot_is_not_counted_as_a_loss():
    decoder = Decoder()
    greeting = hello(Board.NANO, 0, default_config())
    decoder.receive_data(encode(Arm(), 40_000) + encode(greeting, 0) + encode(Arm(), 1))
    list(decoder)
    assert decoder.counters.lost == 0


def test_joining_a_running_stream_is_no_error_but_its_bytes_are_garbage():
    wire = encode(Ping(1), 10)
    _, decoder = _decode(wire[5:] + encode(Ping(2), 11))
    assert decoder.counters.crc_errors == 0
    assert decoder.counters.garbage == len(wire) - 5


def test_a_corrupted_frame_is_one_crc_error_and_one_loss():
    broken = bytearray(encode(Ping(2), 11))
    broken[6] ^= 0x10
    _, decoder = _decode(encode(Ping(1), 10) + bytes(broken) + encode(Ping(3), 12))
    assert (decoder.counters.crc_errors, decoder.counters.lost) == (1, 1)


def test_a_stream_without_delimiters_is_not_stored():
    decoder = Decoder()
    for _ in range(1000):
        decoder.receive_data(b"\x55" * 1000)
        assert decoder.next_event() is None
    assert len(decoder._buffer) <= MAX_ENCODED + 1000
    assert decoder.counters.garbage == 1_000_000


def test_a_run_too_long_for_a_frame_is_one_error_and_hides_nothing_after_it():
    decoder = Decoder()
    decoder.receive_data(encode(Ping(1), 0))
    list(decoder)
    for _ in range(5):
        decoder.receive_data(b"\x55" * 200)
        assert list(decoder) == []
    # The end of the run, though it looks like a frame, belongs to the run.
    decoder.receive_data(encode(Ping(2), 1))
    assert list(decoder) == []
    decoder.receive_data(encode(Ping(3), 2))
    assert list(decoder) == [Frame(2, Ping(3))]
    assert decoder.counters.crc_errors == 1


def test_a_sound_frame_of_another_version_is_shown_not_swallowed():
    body = struct.pack("<BH", Hello.TYPE_ID, 0) + b"\x09\x00future"
    content = body + struct.pack("<H", crc_hqx(body, 0xFFFF))
    received, decoder = _decode(_stuff_by_hand(content) + b"\0")
    assert received == [Frame(0, Unknown(Hello.TYPE_ID, b"\x09\x00future"))]
    assert decoder.counters.unknown == 1


@pytest.mark.parametrize("pulse", [(-1, 0, 0), (0, 65536, 0)])
def test_a_value_too_wide_for_the_wire_is_refused(pulse):
    with pytest.raises(ValueError, match="does not fit the wire"):
        encode(Command(pulse, 100, Mode.DRIVE), 0)


def test_an_encoder_numbers_its_frames_and_wraps():
    encoder = Encoder()
    encoder.sequence = 0xFFFF
    received, _ = _decode(encoder.encode(Arm()) + encoder.encode(Arm()))
    assert [frame.sequence for frame in received] == [0xFFFF, 0]


def test_every_message_fits_a_frame_and_has_its_own_type():
    assert all(layout(cls).size <= 96 for cls in MESSAGES)
    assert len({cls.TYPE_ID for cls in MESSAGES}) == len(MESSAGES)


def test_every_field_of_every_message_is_on_the_wire():
    for cls in MESSAGES:
        assert [f.name for f in fields(cls)] == [f.name for f in layout(cls).fields]


def test_scales_are_those_of_the_datasheets():
    # RM-MPU-6000A-00: 65.5 LSB/(°/s) at ±500 °/s, 8192 LSB/g at ±4 g; four digits are printed.
    assert pytest.approx(0.0174532925 / 65.5, rel=1e-3) == constants.GYRO_SCALE
    assert pytest.approx(9.80665 / 8192, rel=1e-12) == constants.ACCELEROMETER_SCALE
    assert constants.TICK == 0.5e-6


@given(_messages(Config))
@settings(max_examples=25)
def test_plausible_settings_keep_neutral_within_the_limits(config):
    if plausible(config):
        for low, middle, high in zip(config.minimum, config.neutral, config.maximum, strict=True):
            assert 1000 <= low <= middle <= high <= 5000


def test_settings_at_the_ends_of_their_ranges_are_plausible_and_beyond_them_not():
    """As the manual lists them: 2 to 250 ms, low-pass 0 to 6, pulses of 0.5 to 2.5 ms [0.5 µs]."""
    ends = Config(2, 0, (1000,) * 3, (1000,) * 3, (5000,) * 3)
    assert plausible(ends)
    assert plausible(replace(ends, telemetry_period_ms=250, dlpf=6, neutral=(5000,) * 3))
    assert not plausible(replace(ends, telemetry_period_ms=1))
    assert not plausible(replace(ends, telemetry_period_ms=251))
    assert not plausible(replace(ends, dlpf=7))
    for k in range(3):  # of any one servo
        low = tuple(999 if i == k else 1000 for i in range(3))
        high = tuple(5001 if i == k else 5000 for i in range(3))
        assert not plausible(replace(ends, minimum=low))
        assert not plausible(replace(ends, maximum=high))
        assert not plausible(replace(ends, neutral=low))


def test_the_generated_headers_are_up_to_date():
    for path, text in generated().items():
        assert path.read_text(encoding="utf-8") == text, "run `python -m hardware.firmware`"


def _arduino_name(pin: int) -> str:
    return f"A{pin - 14}" if pin >= 14 else f"D{pin}"


@pytest.mark.parametrize(
    ("pins", "what"),
    [
        (constants.SERVO_PINS, ("servo x", "servo y", "turntable servo")),
        (constants.POTENTIOMETER_PINS, ("x_a", "x_b", "y_a", "y_b")),
        (constants.JOYSTICK_PINS, ("joystick x", "joystick y")),
        (constants.SWITCH_PINS, ("switch +x", "switch −x", "switch +y", "switch −y")),
    ],
)
def test_the_wiring_page_shows_the_pins_of_the_firmware(pins, what):
    page = (ROOT / "docs" / "wiring.md").read_text(encoding="utf-8")
    for pin, part in zip(pins, what, strict=True):
        row = next(
            line for line in page.splitlines() if line.startswith(f"| {_arduino_name(pin)} |")
        )
        assert part in row
