"""`--set` reaches any named parameter and says what there is when a name is wrong."""

import mujoco
import numpy as np
import pytest

from twin.errors import TwinError
from twin.plant.model import overrides

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
        ("air_table[3]", "must be at most 2"),
        ("a b", "not a parameter name"),
        ("ring.mass", "must be greater than 0"),
    ],
)
def test_a_wrong_name_or_value_is_refused_with_the_right_ones(model, name, says):
    with pytest.raises(TwinError, match=says):
        overrides.apply(model, {name: -1.0})


JOINTED = """
<mujoco>
  <compiler autolimits="false"/>
  <worldbody>
    <body name="base"><freejoint name="base"/><geom type="box" size=".1 .2 .3"/>
      <body name="rod"><joint name="rod" type="ball"/><geom type="box" size=".1 .2 .3"/>
        <body name="tip"><joint name="tip"/><geom type="box" size=".1 .2 .3" density="0"/>
          <body><geom type="box" size=".1 .2 .3"/></body></body></body></body>
  </worldbody>
  <actuator><motor name="drive" joint="tip"/></actuator>
</mujoco>
"""


@pytest.fixture
def jointed() -> mujoco.MjModel:
    return mujoco.MjModel.from_xml_string(JOINTED)


@pytest.mark.parametrize("attribute", ["damping", "armature", "frictionloss"])
def test_what_is_set_of_a_joint_is_set_of_all_its_axes_or_of_one(jointed, attribute):
    overrides.apply(jointed, {f"rod.{attribute}": 0.3, f"base.{attribute}[1]": 0.2})
    found = getattr(jointed, f"dof_{attribute}")
    np.testing.assert_array_equal(found, [0, 0.2, 0, 0, 0, 0, 0.3, 0.3, 0.3, 0])
    assert overrides.value(jointed, f"rod.{attribute}") == 0.3


@pytest.mark.parametrize(
    ("name", "limited"),
    [
        ("drive.forcerange", "actuator_forcelimited"),
        ("drive.ctrlrange", "actuator_ctrllimited"),
        ("tip.range", "jnt_limited"),
    ],
)
def test_a_range_is_enabled_when_it_is_set_and_needs_both_ends(jointed, name, limited):
    with pytest.raises(TwinError, match=r"set both ends; .*\[0\] is missing"):
        overrides.apply(jointed, {f"{name}[1]": 0.1})
    overrides.apply(jointed, {f"{name}[0]": -0.1, f"{name}[1]": 0.1})
    assert getattr(jointed, limited)[-1] == 1
    data = mujoco.MjData(jointed)
    data.ctrl[0] = 5.0
    mujoco.mj_forward(jointed, data)
    if name.startswith("drive"):
        assert data.actuator_force[0] == pytest.approx(0.1)


@pytest.mark.parametrize(
    ("values", "says"),
    [
        ({"tip.damping": -0.1}, "0 or more"),
        ({"tip.armature": -0.1}, "0 or more"),
        ({"tip.frictionloss": -0.1}, "0 or more"),
        ({"tip.stiffness": -0.1}, "0 or more"),
        ({"base.inertia[0]": 0.0}, "must be greater than 0"),
        ({"base.inertia[0]": 1e3}, "sum of the other two"),
        ({"tip.mass": 1.0}, "no mass"),
        ({"tip.range[0]": 0.2, "tip.range[1]": -0.2}, r"\[0\] must be less"),
        ({"base.pos[0]": 1.0}, "free joint"),
        ({"base.range[0]": 0.0, "base.range[1]": 1.0}, "free joint"),
    ],
)
def test_impossible_values_of_bodies_and_joints_are_refused(jointed, values, says):
    with pytest.raises(TwinError, match=says) as caught:
        overrides.apply(jointed, values)
    assert next(iter(values)).partition("[")[0] in str(caught.value)
