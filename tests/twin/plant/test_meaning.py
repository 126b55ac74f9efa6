"""Files whose numbers do not mean what the names promise are refused, with what they do instead."""

import re
from pathlib import Path

import mujoco
import numpy as np
import pytest

from twin.cli.main import main
from twin.errors import DivergenceError, TwinError
from twin.physics.mechanism import check_response
from twin.plant.launch import check_launch
from twin.plant.model.compose import MJCF
from twin.plant.model.model import ModelConfig, load
from twin.plant.model.plausible import check_motor, check_vehicle
from twin.plant.plant import Plant

POSITION = '<position kp="7.2" kv="0.17" ctrlrange="-0.17 0.17"/>'
SPEED = '<velocity kv="7" ctrlrange="-0.17 0.17"/>'
TORQUE = '<motor ctrlrange="-0.17 0.17"/>'


def direct(folder: Path, kind: str = POSITION, extra: str = "") -> Path:
    """The shipped direct drive with other actuators; `extra` attributes for servo x."""
    text = (MJCF / "examples" / "direct_drive.xml").read_text()
    text = re.sub(r"<custom>.*?</custom>", "", text, flags=re.S)
    text = re.sub(r"<dcmotor resistance.*?/>", kind, text, flags=re.S)
    text = text.replace("<dcmotor name", f"<{kind.split()[0][1:]} name")
    file = folder / "direct.xml"
    file.write_text(text.replace('joint="x"/>', f'joint="x" {extra}/>'))
    return file


def linkage(folder: Path, old: str, new: str) -> Path:
    """The shipped linkage with one change."""
    text = (MJCF / "mechanism.xml").read_text()
    assert old in text
    text = text.replace(old, new).replace(
        'meshdir="../meshes"', f'meshdir="{MJCF.parent / "meshes"}"'
    )
    file = folder / "linkage.xml"
    file.write_text(text)
    return file


@pytest.mark.parametrize(
    ("kind", "extra", "message"),
    [
        (POSITION, 'gear="-1"', r"turns the gimbal to -4\.0° about x .* its gear is -1"),
        (POSITION, 'gear="2"', r"to \+2\.0° about x .* its gear is 2"),
        (TORQUE, "", r"to \+10\.0° about x .* it applies a torque"),
        (SPEED, "", r"to \+10\.0° about x .* it controls a speed"),
        (SPEED.replace("7", "0.02", 1), "", r"about x .* (it controls a speed|does not rest)"),
    ],
    ids=["mirrored", "geared", "torque", "speed", "slow speed"],
)
def test_a_servo_that_does_not_turn_its_axis_as_asked_is_refused(tmp_path, kind, extra, message):
    with pytest.raises(TwinError, match=message):
        load(ModelConfig(scene="bench", mechanism=direct(tmp_path, kind, extra)))


def test_a_position_servo_of_another_kind_is_accepted(tmp_path):
    assert load(ModelConfig(scene="bench", mechanism=direct(tmp_path))).gimbal == "linkage"


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('<equality solref="0.004 1" solimp="0.9999 0.9999 0.001"/>', "", "rods are up to .* mm"),
        (' scale="0.001 0.001 0.001"', "", r"mesh in millimetres\? Give the mesh scale"),
        ('<connect name="loop_x"', '<connect active="false" name="loop_x"', "x' is not active"),
        ('<connect name="loop_x" class="gimbal" site1="rod_x_end" site2="holder_x_ball"/>', "",
         "mobility of .* must have 2"),
    ],
    ids=["soft", "millimetres", "inactive", "open"],
)  # fmt: skip
def test_a_linkage_that_does_not_hold_together_is_refused(tmp_path, old, new, message):
    with pytest.raises(TwinError, match=message):
        load(ModelConfig(scene="bench", mechanism=linkage(tmp_path, old, new)))


@pytest.mark.parametrize("verb", ["rig", "calibrate"])
def test_rig_and_calibration_take_their_mechanism_from_a_file(tmp_path, capsys, verb):
    mirrored = direct(tmp_path, POSITION, 'gear="-1"')
    with pytest.raises(SystemExit) as end:
        main([verb, "--mechanism", str(mirrored)])
    assert end.value.code == 2
    assert "its gear is -1" in capsys.readouterr().err


@pytest.mark.parametrize("name", ["mechanism.xml", "examples/direct_drive.xml"])
def test_the_shipped_mechanisms_answer_their_commands(name):
    model = mujoco.MjModel.from_xml_path(str(MJCF / name))
    before = np.array(model.numeric_data)
    check_response(model)
    assert np.array_equal(before, model.numeric_data)


def test_rods_that_part_in_a_run_end_it_as_diverged():
    """Loops made soft after loading, one axis driven: the run ends at the stated gap."""
    plant = Plant(load(ModelConfig(scene="bench", overrides={"gimbal_closure_limit": 2e-4})))
    plant.model.eq_solref[:] = 0.05, 1.0
    plant.model.eq_solimp[:] = 0.5, 0.5, 0.001, 0.5, 2.0
    plant.drive((0.14, 0.0))

    def run() -> None:
        while plant.time_ns < 400_000_000:
            plant.derive(plant.time_ns)
            gaps.append(float(plant.closure.max()))
            plant.advance(4)

    gaps: list[float] = []
    with pytest.raises(DivergenceError, match=r"gimbal_closure_limit of 0\.2 mm"):
        run()
    assert 1e-5 < max(gaps) <= 2e-4


@pytest.mark.parametrize(
    ("overrides", "message"),
    [
        ({"vehicle.mass": 400.0}, "denser than steel; are its masses in grams"),
        ({"vehicle.inertia[0]": 9.0, "vehicle.inertia[1]": 9.0}, "transverse inertia is 9"),
    ],
    ids=["grams", "inertia"],
)
def test_masses_and_inertias_are_held_against_the_size(overrides, message):
    with pytest.raises(TwinError, match=message):
        load(ModelConfig(overrides=overrides))


def test_a_vehicle_in_millimetres_is_refused():
    model = load(ModelConfig()).mj
    model.geom_aabb[:] *= 1000.0
    with pytest.raises(TwinError, match="must be at most 100 m: are its lengths"):
        check_vehicle(model)


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("motor_propellant_mass", 116.4, "125 kg of propellant|loaded"),
        ("motor_diameter", 29e-6, "in other units"),
    ],
)
def test_a_motor_is_held_against_its_thrust_and_size(name, value, message):
    model = load(ModelConfig()).mj
    model.numeric(name).data[0] = value
    with pytest.raises(TwinError, match=message):
        check_motor(model)


@pytest.mark.parametrize(
    ("overrides", "message"),
    [
        ({"ramp_position[2]": -0.1}, r"pivot starts at z = -0\.08.* raise ramp_position\[2\]"),
        ({"vehicle.mass": 7.0}, r"largest thrust is 44\.5.* its weight along the ramp 54\.5"),
        ({"vehicle.mass": 3.0}, r"takes 3\.26.* kg .* m along it, and ramp_length is 2 m"),
    ],
    ids=["in the ground", "too heavy", "too weak"],
)
def test_a_vehicle_that_cannot_start_is_refused_before_it_flies(overrides, message):
    model = load(ModelConfig(overrides=overrides)).mj
    with pytest.raises(TwinError, match=message):
        check_launch(model)


def test_travel_along_the_ramp_is_that_of_constant_acceleration():
    """A constant surplus a for T, then the pull g sin: s = a T²/2 (1 + a / pull)."""
    from twin.plant.launch import _travel

    mass, pull, surplus, burn = 2.0, 8.0, 3.0, 0.5
    thrust = mass * (pull + surplus)
    wanted = surplus * burn**2 / 2 * (1 + surplus / pull)
    got = _travel(np.array([0.0, burn]), np.array([thrust, thrust]), mass, pull)
    assert got == pytest.approx(wanted, rel=0.01)  # steps of 1 ms of 500
