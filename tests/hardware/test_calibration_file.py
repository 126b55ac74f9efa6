"""The calibration file: round trip, version 1, and refusal of hostile files in one line."""

import json
from dataclasses import replace
from math import radians

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hardware.calibration import (
    Calibration,
    CalibrationError,
    GyroMap,
    Linearisation,
    PotentiometerMap,
    nominal,
    parsed,
    read,
    write,
)
from hardware.calibration.file import LARGEST_FILE, SCHEMA, STRAIGHT, from_dict, to_dict

CURVED = replace(
    nominal(0xDEADBEEF),
    linearisation=Linearisation(
        ((-0.014, 0.0, -0.013), (0.003, -0.002, 0.0, 0.0)),
        ((-0.012, 0.0, -0.013), (0.0, -0.004, 0.001, 0.004)),
        sigma=radians(0.001),
    ),
    deviation=(radians(0.03), radians(0.05)),
)


def version_1(calibration=None):
    """The content of a file of version 1."""
    content = to_dict(calibration or nominal(7))
    content["schema"] = STRAIGHT
    for key in ("linearisation", "deviation_deg", "covariance_us_deg_per_us"):
        del content[key]
    content["zero_covariance_us2"] = [[4.0, 1.0], [1.0, 9.0]]
    content["matrix_covariance_deg2_per_us2"] = np.diag([1e-8, 2e-8, 3e-8, 4e-8]).tolist()
    return content


def numbers(low, high, *shape):
    """Nested tuples of floats."""
    if not shape:
        return st.floats(low, high)
    return st.tuples(*[numbers(low, high, *shape[1:])] * shape[0])


def covariances(sigmas):
    """Covariance of any correlation with deviations up to `sigmas`."""
    n = len(sigmas)

    def make(factor):
        square = np.array(factor) @ np.array(factor).T / n
        return tuple(tuple(row) for row in (square * np.outer(sigmas, sigmas)).tolist())

    return numbers(-1.0, 1.0, n, n).map(make)


def calibrations():
    pot = st.builds(
        PotentiometerMap,
        st.floats(0.1, 0.9),
        st.floats(0.5, 10.0) | st.floats(-10.0, -0.5),
        covariances((0.01, 0.1)),
    )
    scale = 760.0  # rad of gimbal per second of pulse
    return st.builds(
        Calibration,
        rig=st.integers(0, 2**32 - 1),
        zero=numbers(0.6e-3, 2.4e-3, 2),
        matrix=st.builds(
            lambda a, b, c, d: ((a, b), (c, d)),
            st.floats(0.5 * scale, 2 * scale),
            st.floats(-0.2 * scale, 0.2 * scale),
            st.floats(-0.2 * scale, 0.2 * scale),
            st.floats(0.5 * scale, 2 * scale),
        ),
        potentiometers=st.tuples(pot, pot, pot, pot),
        gyro=st.builds(
            GyroMap,
            numbers(-1.0, 1.0, 3),
            st.just(((1.02, 0.01), (-0.02, 0.97))),
            st.floats(0, 1),
            st.floats(0, 1),
        ),
        switch_angle=numbers(-0.5, 0.5, 4),
        covariance=covariances((1e-5, 1e-5, 1.0, 1.0, 1.0, 1.0)),
        hysteresis=numbers(0.0, 0.1, 2),
        hysteresis_sigma=numbers(0.0, 0.1, 2),
        repeatability=numbers(0.0, 0.1, 2),
        deviation=numbers(0.0, 0.1, 2),
        linearisation=st.builds(
            Linearisation,
            st.tuples(numbers(-0.005, 0.005, 3), numbers(-0.005, 0.005, 4)),
            st.tuples(numbers(-0.005, 0.005, 3), numbers(-0.005, 0.005, 4)),
            st.floats(0.15, 0.7),
            st.floats(0, 0.01),
        ),
    )


@settings(max_examples=25, deadline=None)
@given(calibrations(), numbers(-0.15, 0.15, 2))
def test_a_calibration_comes_back_from_its_text_to_the_last_digits(calibration, angle):
    back = parsed(json.dumps(to_dict(calibration)), "text")
    assert back.rig == calibration.rig
    # degrees and microseconds are one multiplication away
    np.testing.assert_allclose(back.pulses(angle), calibration.pulses(angle), rtol=1e-13)
    np.testing.assert_allclose(back.covariance, calibration.covariance, rtol=1e-13, atol=1e-300)
    np.testing.assert_allclose(back.sigma(angle), calibration.sigma(angle), rtol=1e-6, atol=1e-9)
    for a, b in zip(back.potentiometers, calibration.potentiometers, strict=True):
        assert a.angle(0.7) == pytest.approx(b.angle(0.7), rel=1e-12)
    assert back.gyro.rates((1, 2, 3)) == pytest.approx(calibration.gyro.rates((1, 2, 3)), rel=1e-12)
    for name in ("hysteresis", "repeatability", "deviation", "switch_angle"):
        assert getattr(back, name) == pytest.approx(getattr(calibration, name), rel=1e-12)


def test_writing_leaves_one_file_of_version_2(tmp_path):
    write(tmp_path / "c.json", CURVED)
    assert [p.name for p in tmp_path.iterdir()] == ["c.json"]
    assert json.loads((tmp_path / "c.json").read_text())["schema"] == SCHEMA
    assert read(tmp_path / "c.json", CURVED.rig).note == ""


def test_the_travel_of_the_tracks_is_kept_and_240_degrees_where_a_file_has_none():
    content = to_dict(replace(nominal(7), track=radians(90.4)))
    assert from_dict(content).track == radians(90.4)  # degrees(radians(90.4)) is not 90.4
    del content["potentiometer_deg"]
    assert from_dict(content).track == pytest.approx(radians(240.0))


def test_what_the_reader_would_refuse_is_not_written(tmp_path):
    x_a, *others = nominal(7).potentiometers
    at_end = replace(nominal(7), potentiometers=(replace(x_a, zero=0.96), *others))
    with pytest.raises(CalibrationError, match=r"zero holds 0\.96, must be 0\.05…0\.95"):
        write(tmp_path / "c.json", at_end)
    assert not list(tmp_path.iterdir())


def test_version_1_is_read_as_a_straight_line_and_says_so_in_one_line():
    back = parsed(json.dumps(version_1()), "old.json")
    assert back.linearisation.straight
    assert "holds only a straight line" in back.note
    assert "\n" not in back.note
    np.testing.assert_allclose(back.zero_covariance, np.array([[4, 1], [1, 9]]) * 1e-12)
    per_us = radians(1) * 1e6
    expected = np.diag([1e-8, 2e-8, 3e-8, 4e-8]) * per_us**2
    np.testing.assert_allclose(back.matrix_covariance, expected)
    offset = np.subtract(back.pulses((0.1, -0.05)), back.zero)
    np.testing.assert_allclose(np.array(back.matrix) @ offset, (0.1, -0.05), rtol=1e-12)


def test_version_1_is_checked_like_version_2():
    content = version_1() | {"zero_covariance_us2": [[1, 2], [2, 1]]}
    with pytest.raises(CalibrationError, match="zero_covariance_us2 is not a covariance"):
        from_dict(content)


def test_a_file_of_another_rig_is_refused(tmp_path):
    path = tmp_path / "c.json"
    write(path, nominal(0xDEADBEEF))
    with pytest.raises(CalibrationError, match="is of rig deadbeef, this one is 00000001"):
        read(path, 1)


def curved(**change):
    return {"linearisation": to_dict(CURVED)["linearisation"] | change}


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"schema": "tvc-twin/calibration/9"}, "schema"),
        ({"schema": [1]}, "schema"),
        ({"rig": "xyz"}, "eight hexadecimal"),
        ({"zero_us": [1500]}, "zero_us must be 2 numbers"),
        ({"zero_us": [1500, True]}, "must be numbers"),
        ({"zero_us": [1500, float("nan")]}, "finite"),
        ({"zero_us": [1500, 10**400]}, "finite"),
        ({"zero_us": [1500, 90]}, "500…2500"),
        ({"matrix_deg_per_us": [[0.04, 0.04], [0.04, 0.04]]}, "singular"),
        ({"matrix_deg_per_us": [[0, 0], [0, 0]]}, "singular"),
        ({"covariance_us_deg_per_us": [[0] * 5 + [1]] + [[0] * 6] * 5}, "not a covariance"),
        ({"covariance_us_deg_per_us": [[0] * 6] * 5}, "6 × 6 numbers"),
        ({"linearisation": None}, "linearisation must be an object"),
        (curved(x_deg=None), "x_deg must be a list of at most 7 rows"),
        (curved(x_deg=[[0.0] * (3 + k) for k in range(8)]), "at most 7 rows"),
        (curved(x_deg=[[0.0, 0.0]]), "x_deg must be 3 numbers"),
        (curved(x_deg=[[0.0, 0.0, 0.0]]), "1 and 2 rows"),
        (curved(x_deg=[[40.0, 0.0, 0.0], [0.0] * 4]), "x is not monotone"),
        (curved(x_deg=[[float("inf"), 0.0, 0.0], [0.0] * 4]), "finite"),
        (curved(extent_deg=0.5), "extent_deg holds 0.5, must be 1…45"),
        (curved(sigma_deg=-1.0), "sigma_deg holds -1, must be 0…1"),
        ({"deviation_deg": [0.1, -0.1]}, "deviation_deg holds"),
        ({"potentiometers": []}, "must be an object"),
        ({"gyro": None}, "must be an object"),
    ],
)
def test_a_hostile_file_is_refused_in_one_line(tmp_path, change, words):
    path = tmp_path / "c.json"
    path.write_text(json.dumps(to_dict(CURVED) | change))
    with pytest.raises(CalibrationError, match=words) as caught:
        read(path)
    assert "\n" not in str(caught.value)


def test_what_is_not_a_calibration_file_is_refused(tmp_path):
    with pytest.raises(CalibrationError, match="cannot read"):
        read(tmp_path / "absent.json")
    deep = tmp_path / "deep.json"
    deep.write_text("[" * 50_000)
    with pytest.raises(CalibrationError, match="not JSON"):
        read(deep)
    big = tmp_path / "big.json"
    big.write_text(" " * (LARGEST_FILE + 1))
    with pytest.raises(CalibrationError, match="larger than"):
        read(big)


_json = st.recursive(
    st.none() | st.booleans() | st.floats() | st.integers() | st.text(max_size=5),
    lambda x: st.lists(x, max_size=4) | st.dictionaries(st.text(max_size=5), x, max_size=4),
    max_leaves=10,
)


def places(value, path=()):
    """Every path into a JSON value."""
    yield path
    if isinstance(value, dict | list):
        items = value.items() if isinstance(value, dict) else enumerate(value)
        for key, child in items:
            yield from places(child, (*path, key))


CONTENTS = to_dict(CURVED), version_1()
PLACES = [(k, path) for k, content in enumerate(CONTENTS) for path in places(content) if path]


@settings(max_examples=50, deadline=None)
@given(st.sampled_from(PLACES), _json | st.floats(-1e3, 1e3))
def test_any_value_in_any_place_gives_a_usable_calibration_or_one_line(place, value):
    which, path = place
    content = json.loads(json.dumps(CONTENTS[which]))
    target = content
    for key in path[:-1]:
        target = target[key]
    target[path[-1]] = value
    check(lambda: from_dict(content))


@settings(max_examples=40, deadline=None)
@given(st.data())
def test_any_damage_to_the_text_gives_a_usable_calibration_or_one_line(data):
    text = bytearray(json.dumps(CONTENTS[0]).encode())
    for _ in range(data.draw(st.integers(1, 4))):
        at = data.draw(st.integers(0, len(text) - 1))
        piece = data.draw(st.binary(max_size=3) | st.sampled_from([b"-", b"e9", b"[", b"9" * 20]))
        text[at : at + data.draw(st.integers(0, 5))] = piece
    check(lambda: parsed(bytes(text), "damaged.json"))


def check(load):
    try:
        got = load()
    except CalibrationError as error:
        assert "\n" not in str(error)  # noqa: PT017
        return
    for angle in ((0.0, 0.0), (0.14, -0.14), (1.0, -1.0)):
        pulses = got.pulses(angle)
        assert np.isfinite([*pulses, *got.sigma(angle)]).all()
        np.testing.assert_allclose(got.angles(pulses), angle, atol=1e-6)
