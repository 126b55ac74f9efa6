"""Settings of every verb: ranges, conversion, one parse of --set, and their help."""

import math
import re
from dataclasses import MISSING, fields
from pathlib import Path
from typing import get_args

import pytest
from hypothesis import given
from hypothesis import strategies as st

from twin.cli.arguments import parse
from twin.config import Fly, Identify, Rig, Step, with_model
from twin.config.base import hints, without_markers
from twin.config.types import POSITIONAL
from twin.config.verbs import VERBS
from twin.errors import TwinError

NONSENSE = (math.nan, math.inf, -math.inf, 1e300, -1e300, 1e-300, -1e-300, 10**400, "", "x", True)
REQUIRED = {
    "sources": ("a.rrd",),
    "recordings": ("a.rrd",),
    "recording": "a.rrd",
    "study": "dispersion",
}


def numeric_settings():
    """Every setting of every verb that is a number or a tuple of numbers, with a valid value."""
    for verb in VERBS:
        for f in fields(verb.settings):
            text = str(without_markers(hints(verb.settings)[f.name]))
            if f.name not in ("set", "shadow_set") and re.search(r"\b(int|float)\b", text):
                yield pytest.param(verb.settings, f, id=f"{verb.name} --{f.name}")


def settings_with(kind, name, value):
    required = [f.name for f in fields(kind) if f.default is MISSING]
    needed = {n: REQUIRED.get(n) or get_args(without_markers(hints(kind)[n]))[0] for n in required}
    extra = {"gimbal": "emulator"} if name == "unit" and kind in (Fly, Step) else {}
    if "sources" in hints(kind):
        extra["sources"] = ("a.rrd",)
    return kind.of({**needed, **extra, name: value})


def as_setting(kind, f, number):
    """The number in the shape of the setting."""
    default = f.default
    text = str(without_markers(hints(kind)[f.name]))
    if text.startswith("tuple") or "tuple[" in text:
        count = 1 if "..." in text else text.count("float")
        return (number,) * (
            count if not isinstance(default, tuple) or not default else len(default)
        )
    return number


@pytest.mark.parametrize(("kind", "f"), list(numeric_settings()))
def test_no_setting_takes_nonsense(kind, f):
    """Whatever is accepted is a finite number of a size that somebody could mean."""
    for number in NONSENSE:
        refused_or_meaningful(kind, f, number)


def refused_or_meaningful(kind, f, number):
    try:
        made = settings_with(kind, f.name, as_setting(kind, f, number))
    except TwinError as error:
        message = str(error)
    else:
        assert_meaningful(made, f)
        return
    assert "\n" not in message
    assert f"--{f.name.replace('_', '-')}" in message


def assert_meaningful(made, f):
    value = getattr(made, f.name)
    accepted = value if isinstance(value, tuple) else (value,)
    # only a setting without a natural smallest size may be given a tiny one
    tiny_is_zero = {"at_s", "gyro_delay_ms", "off_axis_deg", "target", "longest_delay_ms"}
    tiny_is_zero |= {
        "switch_deg",
        "fail_below",
        "load_g",
        "gap_mm",
        "latitude_deg",
        "longitude_deg",
        "height_m",
    }
    for v in accepted:
        assert math.isfinite(v)
        assert abs(v) <= 1e-200
        assert f.name in tiny_is_zero


def test_overrides_from_texts_a_mapping_and_a_file_are_the_same_and_parsed_once(tmp_path):
    file = tmp_path / "set.json"
    file.write_text('{"a": 1, "b": 2}')
    of_file = Fly(set=("b=3",), set_from=file)
    assert of_file.overrides == {"a": 1.0, "b": 3.0}
    assert of_file.set_from is None  # merged; nothing reads the file again
    assert Fly(set={"a": 1, "b": 3}) == of_file
    assert with_model(of_file, "linkage").overrides == of_file.overrides


def test_a_model_takes_the_place_of_a_rig_without_its_settings():
    run = Fly(gimbal="emulator", unit=3, no_check=True, on_fault="end", clock="wall")
    model = with_model(run, "linkage", about=run.about)
    assert model == Fly(gimbal="linkage", clock="lockstep", about=run.about)


@pytest.mark.thorough
@given(st.dictionaries(st.from_regex(r"[a-z_]{1,9}", fullmatch=True), st.floats(-1e9, 1e9)))
def test_overrides_survive_the_way_through_a_recording(values):
    config = Fly(set=values)
    assert Fly(**config.as_properties()).overrides == config.overrides == values


def test_values_are_converted_as_annotated():
    config = Fly(motor="a.eng", off_axis_deg=[1, 2], programme="point", seed=3, duration_s=2)
    assert config.motor == Path("a.eng")
    assert config.off_axis_deg == (1.0, 2.0)
    assert isinstance(config.duration_s, float)
    assert Identify("a.csv").sources == (Path("a.csv"),)


@pytest.mark.parametrize(
    ("settings", "says"),
    [
        ({"programm": "hold"}, "did you mean programme"),
        ({"seed": 1.5}, "whole number"),
        ({"motor": 3}, "a path"),
        ({"set": "a=1"}, "list of NAME=VALUE"),
        ({"set": [("a",)]}, "NAME=VALUE"),
        ({"target": (1, 2)}, "3 values"),
        ({"fault": [3]}, "a text"),
    ],
)
def test_a_wrong_value_from_python_names_the_setting_and_what_is_right(settings, says):
    with pytest.raises(TwinError, match=re.escape(says)):
        Fly.of(settings)


@pytest.mark.parametrize("verb", VERBS, ids=[v.name for v in VERBS])
def test_every_setting_is_described_in_help(verb, capsys):
    with pytest.raises(SystemExit) as end:
        parse([verb.name, "--help"])
    assert end.value.code == 0
    text = capsys.readouterr().out
    for f in fields(verb.settings):
        positional = POSITIONAL in get_args(hints(verb.settings)[f.name])
        if f.default is not MISSING and not positional:
            assert f"--{f.name.rstrip('_').replace('_', '-')}" in text
    # a flag that is not described has its metavar at the end of the line
    assert not re.search(r"--[a-z-]+( [A-Z]+)?\s*│\n│ --", text)
    assert "(default: None)" not in text


def test_common_options_come_first(capsys):
    with pytest.raises(SystemExit):
        parse(["fly", "--help"])
    flags = re.findall(r"^\W*(--[a-z][a-z-]+)", capsys.readouterr().out, re.MULTILINE)
    assert flags[:3] == ["--gimbal", "--out", "--json"]


def test_the_two_ends_of_a_simulated_rig_exclude_each_other():
    with pytest.raises(TwinError, match="--link"):
        Rig(port=0, link="/tmp/x")
