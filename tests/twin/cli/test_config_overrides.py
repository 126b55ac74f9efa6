"""Parsing of `--set NAME=VALUE` and of override files."""

import json
import math
import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

import twin
from twin.cli.main import main
from twin.config import Fly, overrides
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
        overrides.parse(["a=8 bananas"])


@pytest.mark.parametrize(
    ("text", "wanted"),
    [
        ("wind_speed=36km/h", 10.0),
        ("wind_azimuth=90 deg", math.pi / 2),
        ("gimbal_servo_slew=180°/s", math.pi),
        ("servo_slew=180 deg/s", math.pi),  # of a mechanism alone
        ("gimbal_servo_gain=1.8 N m/rad", 1.8),
        ("gimbal_servo_gain=0.1 N m/°", 18 / math.pi),
        ("air_strip_area[3]=5 cm²", 5e-4),
        ("vehicle.inertia[0]=3 kg cm2", 3e-4),
        ("gimbal_x.range[1]=-9 deg", -math.pi / 20),
        ("turntable_lead[1]=4e6 ms²", 4.0),
        ("control_ki=2 1/s³", 2.0),
        ("motor_ignition=300 ms", 0.3),
        ("wind_turbulence=10 %", 0.1),
        ("vehicle.mass=2 lb", 0.90718474),
        ("a_number_of_this_model=5 mm", 0.005),
    ],
)
def test_a_unit_is_converted_to_that_of_the_parameter(tmp_path, text, wanted):
    name, _, value = text.partition("=")
    assert overrides.parse([text]) == {name: pytest.approx(wanted, rel=1e-12)}
    file = tmp_path / "set.json"
    file.write_text(json.dumps({name: value}))
    assert overrides.parse({}, file) == overrides.parse({name: value}) == overrides.parse([text])


@pytest.mark.parametrize(
    ("text", "right"),
    [
        ("wind_speed=5kg", "in m/s, or in"),
        ("wind_speed=5 bananas", "in m/s, or in"),
        ("wind_speed=5 m/s²", "in m/s, or in"),
        ("wind_azimuth=3 m", "in rad, or in"),
        ("vehicle.mass=3 N", "in kg, or in"),
        ("gimbal_x.damping=1 N m/rad", "in N m s/rad, or in"),
        ("turntable_lead[0]=1 s²", "in s, or in"),
        ("servo_gain=2 N m", "in N m/rad, or in"),
        ("wind_seed=5 m", "a number without a unit"),
    ],
)
def test_a_unit_that_does_not_convert_is_refused_with_the_right_one(tmp_path, text, right):
    name, _, value = text.partition("=")
    says = re.escape(f"{text}: '{value}' must be {right}")
    with pytest.raises(TwinError, match=f"--set {says}"):
        overrides.parse([text])
    with pytest.raises(TwinError, match=f"--set {says}"):
        twin.fly(set={name: value})
    with pytest.raises(TwinError, match=f"--shadow-set {says}"):
        Fly(gimbal="emulator", shadow_set=(text,))
    (tmp_path / "study.toml").write_text(
        f'[fly]\nset = {{ "{name}" = "{value}" }}\n'
        '[vary.seed]\ndistribution = "grid"\nvalues = [1]\n'
    )
    with pytest.raises(TwinError, match=says):
        twin.campaign("run", str(tmp_path / "study.toml"), out=tmp_path / "out")
    file = tmp_path / "set.json"
    file.write_text(json.dumps({name: value}))
    with pytest.raises(TwinError, match=re.escape(f"{file}: {name}: '{value}' must be {right}")):
        overrides.parse({}, file)


def test_the_command_line_refuses_a_unit_in_one_line(capsys):
    with pytest.raises(SystemExit, match="2"):
        main(["fly", "--set", "wind_speed=5kg"])
    said = capsys.readouterr().err.splitlines()
    assert said == [
        "twin: --set wind_speed=5kg: '5kg' must be in m/s, or in a unit that converts to it"
    ]


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
