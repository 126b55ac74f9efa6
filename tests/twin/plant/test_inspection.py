"""What is printed of a vehicle or mechanism file before it flies."""

import re
from math import pi
from pathlib import Path

import mujoco
import numpy as np
import pytest

from twin.errors import TwinError
from twin.physics.aerodynamics.silhouette import strip_check
from twin.physics.aerodynamics.stability import static_margin
from twin.physics.mechanism import Kinematics
from twin.plant.model.compose import MJCF
from twin.plant.model.inspection import inspect_mechanism, inspect_vehicle

ROCKET, DIRECT = MJCF / "examples" / "large_rocket.xml", MJCF / "examples" / "direct_drive.xml"


@pytest.fixture
def rocket():
    return mujoco.MjModel.from_xml_path(str(ROCKET))


def test_static_margin_of_nose_and_fins_is_barrowmans_mean(rocket):
    """At a vanishing angle the crossflow is gone: C_Nα-weighted mean of the two stations."""

    def value(name):
        return rocket.numeric(name).data[0]

    slopes = np.array([value("air_nose_slope"), value("air_fin_slope")])
    pressure = slopes @ [value("air_nose_z"), value("air_fin_z")] / slopes.sum()
    margin = static_margin(rocket)
    assert margin.centre_of_pressure == pytest.approx(pressure, abs=1e-4)
    data = mujoco.MjData(rocket)
    mujoco.mj_forward(rocket, data)
    body = data.body("vehicle")
    lead = body.xmat.reshape(3, 3)[:, 2] @ (data.subtree_com[body.id] - body.xpos)
    diameter = np.sqrt(4 * value("air_reference_area") / pi)
    assert margin.calibres[0] == pytest.approx((lead - pressure) / diameter, abs=2e-3)
    assert margin.calibres[1] > margin.calibres[0]  # the motor is behind: burning moves it forward


def test_a_vehicle_without_fins_is_unstable_and_says_so(rocket):
    rocket.numeric("air_fin_slope").data[0] = 0.0
    margin = static_margin(rocket)
    assert margin.limit == (0.0, 0.0)
    assert margin.text.count("unstable") == 2


def test_a_model_without_air_has_no_static_margin():
    model = mujoco.MjModel.from_xml_string(
        "<mujoco><worldbody><body name='vehicle'/></worldbody></mujoco>"
    )
    with pytest.raises(TwinError, match="no static margin"):
        static_margin(model)


@pytest.mark.thorough
def test_stations_that_do_not_fit_the_geometry_are_reported_with_the_ones_that_do(rocket):
    good = np.array(rocket.numeric("air_strip_area").data)
    assert strip_check(rocket).error == pytest.approx(0.0, abs=1e-5)
    rocket.numeric("air_strip_area").data[:] = 1.1 * good
    check = strip_check(rocket)
    assert check.error == pytest.approx(0.1, abs=1e-5)
    printed = re.search(r'name="air_strip_area" data="([^"]*)"', check.numerics)
    np.testing.assert_allclose(np.array(printed[1].split(), float), good, rtol=1e-5)


def test_findings_of_the_shipped_files():
    rows = dict(inspect_vehicle(ROCKET))
    assert rows["launch mass"] == "4.149 kg"
    assert re.match(r"\+2\.\d+ calibres loaded, stable up to", rows["static margin"])
    rows = dict(inspect_mechanism(MJCF / "mechanism.xml"))
    assert rows["mobility"].startswith("2 (")
    assert "spin of gimbal_rod_x" in rows["mobility"]
    assert dict(inspect_mechanism(DIRECT))["mobility"] == "2 (3 links, 2 joints and loops)"


def test_the_printed_reach_needs_the_servo_at_the_printed_ends_of_its_range():
    row = dict(inspect_mechanism(MJCF / "mechanism.xml"))["reach"]
    low, high, a, b = map(
        float, re.match(r"x (.*)° to (.*)° with its servo at (.*)° to (.*)°, y", row).groups()
    )
    model = mujoco.MjModel.from_xml_path(str(MJCF / "mechanism.xml"))
    back = np.degrees(Kinematics(model).servo_from_gimbal(np.radians([[low, 0.0], [high, 0.0]])))
    assert sorted(back[:, 0]) == pytest.approx([a, b], abs=1.0)  # printed to 0.1° of gimbal


def test_a_file_that_cannot_fly_is_refused(tmp_path):
    file = tmp_path / "a.xml"
    file.write_text("<mujoco/>")
    with pytest.raises(TwinError, match="lacks body 'vehicle'"):
        inspect_vehicle(Path(file))
