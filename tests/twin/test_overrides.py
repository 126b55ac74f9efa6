"""`--set` reaches any named parameter and says what there is when a name is wrong."""

import json

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from twin import overrides
from twin.errors import TwinError

XML = """
<mujoco>
  <custom><numeric name="air_drag" data="0.5"/><numeric name="air_table" data="1 2 3"/></custom>
  <worldbody>
    <body name="ring"><joint name="gimbal_x" damping="0.1" range="-10 10" limited="true"/>
      <geom type="box" size=".1 .2 .3" density="100"/></body>
  </worldbody>
</mujoco>
"""


@pytest.fixture
def model() -> mujoco.MjModel:
    return mujoco.MjModel.from_xml_string(XML)


def numeric(model: mujoco.MjModel, name: str) -> np.ndarray:
    return model.numeric(name).data


def test_numerics_elements_and_options_are_all_reached(model):
    names = {
        "air_drag": 0.7,
        "air_table[2]": 9.0,
        "gimbal_x.damping": 0.3,
        "gimbal_x.range[1]": 0.2,
        "gravity[2]": -1.6,
    }
    overrides.apply(model, names)
    assert numeric(model, "air_drag")[0] == 0.7
    assert list(numeric(model, "air_table")) == [1, 2, 9]
    assert model.dof_damping[0] == 0.3
    assert model.jnt_range[0, 1] == 0.2
    assert model.opt.gravity[2] == -1.6


def test_inertia_follows_an_overridden_mass_as_for_a_body_of_other_density(model):
    overrides.apply(model, {"ring.mass": 2 * model.body("ring").mass[0]})
    denser = mujoco.MjModel.from_xml_string(XML.replace('density="100"', 'density="200"'))
    # the compiler adds nothing random: equal to rounding
    np.testing.assert_allclose(model.body_inertia, denser.body_inertia, rtol=1e-12)
    np.testing.assert_allclose(model.body_subtreemass, denser.body_subtreemass, rtol=1e-12)


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("air_drga", "air_drag"),
        ("rign.mass", "ring"),
        ("ring.colour", "mass"),
        ("air_table", r"air_table\[0\] to air_table\[2\]"),
        ("air_table[3]", "past the last, 2"),
        ("a b", "no parameter name"),
        ("ring.mass", "not positive"),
    ],
)
def test_a_wrong_name_or_value_is_told_with_what_would_be_right(model, name, says):
    with pytest.raises(TwinError, match=says):
        overrides.apply(model, {name: -1.0})


@pytest.mark.parametrize(
    "text", ["air_drag", "air_drag=x", "air_drag=nan", "air_drag=inf", "=", "a="]
)
def test_a_text_that_is_no_assignment_of_a_finite_number_is_refused(text):
    with pytest.raises(TwinError):
        overrides.parse([text])


@given(st.text(max_size=30), st.floats(allow_nan=False, allow_infinity=False))
def test_any_text_before_the_first_equals_sign_is_the_name(name, value):
    name = name.replace("=", "")
    assert overrides.parse([f"{name}={value!r}"]) == {name.strip(): value}


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
