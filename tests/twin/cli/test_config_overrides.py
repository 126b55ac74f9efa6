"""Parsing of `--set NAME=VALUE` and of override files."""

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from twin.config import overrides
from twin.errors import TwinError


@pytest.mark.parametrize(
    "text", ["air_drag", "air_drag=x", "air_drag=nan", "air_drag=inf", "=", "a=", "a=1_0", "a=１"]
)
def test_a_text_that_is_no_assignment_of_a_finite_number_is_refused(text):
    with pytest.raises(TwinError):
        overrides.parse([text])


def test_values_may_have_a_unit():
    given = ["wind_azimuth=270°", "wind_speed=36 km/h", "vehicle.mass=40 g", "a=-5e-3mm"]
    wanted = {"wind_azimuth": 4.71238898, "wind_speed": 10.0, "vehicle.mass": 0.04, "a": -5e-6}
    assert overrides.parse(given) == pytest.approx(wanted)
    with pytest.raises(TwinError, match="'8 bananas' is not a number, nor one with a unit"):
        overrides.parse(["wind_speed=8 bananas"])


@given(st.text(max_size=30), st.floats(allow_nan=False, allow_infinity=False))
def test_any_text_before_the_first_equals_sign_is_the_name(name, value):
    name = name.replace("=", "")
    assert overrides.parse([f"{name}={value!r}"]) == {name.strip(): value}


def test_a_name_given_twice_is_refused(tmp_path):
    with pytest.raises(TwinError, match="--set a=2: a is given twice"):
        overrides.parse(["a=1", "a=2"])
    file = tmp_path / "set.json"
    file.write_text('{"a": 1, "b": 2, "a": 3}')
    with pytest.raises(TwinError, match="'a' is given twice"):
        overrides.parse([], file)


def test_the_command_line_goes_over_the_file(tmp_path):
    file = tmp_path / "set.json"
    file.write_text(json.dumps({"a": 1, "b": 2}))
    assert overrides.parse(["b=3"], file) == {"a": 1.0, "b": 3.0}


@pytest.mark.parametrize(
    "content", ["[1]", "{", '{"a": true}', '{"a": "x"}', '{"a": NaN}', '{"a": []}']
)
def test_a_file_that_is_no_object_of_finite_numbers_is_refused(tmp_path, content):
    file = tmp_path / "set.json"
    file.write_text(content)
    with pytest.raises(TwinError, match="set"):
        overrides.parse([], file)
