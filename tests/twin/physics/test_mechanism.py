"""Mobility, kinematics and servos of the gimbal against counts, closed forms and data sheets."""

import itertools
from math import degrees, radians
from pathlib import Path

import mujoco
import numpy as np
import pytest
from mujoco.introspect import structs
from numba import types
from numpy.testing import assert_allclose

from analysis.compiled import cfunc
from twin.physics.mechanism import (
    Kinematics,
    MechanismError,
    apply_servo,
    insert_backlash,
    mobility,
)
from twin.physics.mechanism.kinematics import Workspace
from twin.physics.native.layout import address
from twin.physics.native.servo import dead_bands

MJCF = Path(__file__).resolve().parents[3] / "mjcf"
FILES = {
    "alone": "mechanism.xml",
    "attached": "bench.xml",
    "turned": "turntable.xml",
}


def load(name):
    model = mujoco.MjModel.from_xml_path(str(MJCF / name))
    return model, mujoco.MjData(model)


@pytest.fixture(scope="module")
def linkage():
    model, data = load("mechanism.xml")
    return model, data, Kinematics(model)


# ---- mobility


@pytest.mark.parametrize("name", FILES.values(), ids=FILES)
def test_the_linkage_has_mobility_two_besides_the_named_spins_of_its_rods(name):
    """By hand: 7 links, 4 hinges, 4 balls: 6 (7 - 1 - 8) + 4 + 4·3 = 4, two of them idle."""
    model, _ = load(name)
    count = mobility(model)
    assert (count.bodies, count.joints, count.freedoms, count.total) == (7, 8, 16, 4)
    assert count.count == 2
    assert [n.replace("gimbal_", "") for n in count.idle] == ["spin of rod_x", "spin of rod_y"]


def test_the_count_equals_the_freedom_that_the_constraint_jacobian_leaves(linkage):
    """Joint velocities less the rank of the loop equations, by singular values at a bent pose."""
    model, data, kinematics = linkage
    settle(model, data, kinematics, np.radians([5, -6]))
    loops = data.efc_type == mujoco.mjtConstraint.mjCNSTR_EQUALITY
    jacobian = data.efc_J.reshape(data.nefc, model.nv)[loops]
    rank = np.linalg.matrix_rank(jacobian, tol=1e-6)  # m; arms are 1e-2
    assert model.nv - rank == mobility(model).total


def test_play_in_the_gears_is_counted_as_idle_by_name():
    spec = mujoco.MjSpec.from_file(str(MJCF / "mechanism.xml"))
    insert_backlash(spec)
    count = mobility(spec.compile())
    assert count.count == 2
    assert {"play of play_x", "play of play_y"} < set(count.idle)


def test_a_direct_drive_has_mobility_two_and_nothing_idle():
    model, _ = load("examples/direct_drive.xml")
    assert (mobility(model).count, mobility(model).idle) == (2, ())


# ---- kinematics


def settle(model, data, kinematics, gimbal):
    mujoco.mj_resetData(model, data)
    data.ctrl[:] = kinematics.servo_from_gimbal(gimbal)
    mujoco.mj_step(model, data, 600)
    mujoco.mj_forward(model, data)


def angles(data, prefix=""):
    """Gimbal and servo angles of a model, (2,) each [rad]."""
    gimbal = [data.joint(f"{prefix}{a}").qpos[0] for a in "xy"]
    servo = [data.joint(f"{prefix}servo_{a}").qpos[0] for a in "xy"]
    return np.array(gimbal), np.array(servo)


def test_mujocos_gimbal_settles_within_0_02_degrees_of_the_kinematic_solution(linkage):
    """Over the whole commanded workspace, ±8° squared, gravity on."""
    model, data, kinematics = linkage
    for target in itertools.product(np.radians([-8, -4, 0, 4, 8]), repeat=2):
        settle(model, data, kinematics, np.array(target))
        gimbal, servo = angles(data)
        deviation = np.abs(gimbal - kinematics.gimbal_from_servo(servo)).max()
        assert degrees(deviation) < 0.02, np.degrees(target)
        # and the servo stands where it was told, within friction over gain
        assert_allclose(gimbal, target, atol=radians(0.4))


def test_there_and_back_is_the_identity(linkage):
    _, _, kinematics = linkage
    gimbal = np.random.default_rng(0).uniform(-1, 1, (500, 2)) * radians(10)
    back = kinematics.gimbal_from_servo(kinematics.servo_from_gimbal(gimbal))
    assert_allclose(back, gimbal, atol=1e-13)  # Newton stops at 1e-13


def test_the_rods_keep_their_length(linkage):
    """Distances recomputed from posed sites: forward kinematics of MuJoCo, no solver."""
    model, data, kinematics = linkage
    home = mujoco.MjData(model)
    mujoco.mj_kinematics(model, home)
    for x, y in np.radians([[7, 3], [-8, 8], [10, -10]]):
        servo = kinematics.servo_from_gimbal([x, y])
        mujoco.mj_resetData(model, data)
        data.joint("x").qpos, data.joint("y").qpos = x, y
        data.joint("servo_x").qpos, data.joint("servo_y").qpos = servo
        mujoco.mj_kinematics(model, data)
        for a in "xy":
            lengths = [
                np.linalg.norm(d.site(f"holder_{a}_ball").xpos - d.site(f"horn_{a}_ball").xpos)
                for d in (home, data)
            ]
            assert lengths[0] == pytest.approx(lengths[1], abs=1e-12)


def test_the_solution_knows_nothing_of_where_the_mechanism_is_mounted(linkage):
    _, _, kinematics = linkage
    model, _ = load("turntable.xml")
    gimbal = np.radians([[8, -8], [3, 5]])
    there = Kinematics(model).servo_from_gimbal(gimbal)
    assert_allclose(there, kinematics.servo_from_gimbal(gimbal), atol=1e-12)


def test_the_fast_path_gives_the_same_and_clips_where_a_rod_cannot_reach(linkage):
    _, _, kinematics = linkage
    pair = kinematics.servo_from_gimbal_fast(0.1, -0.05)
    assert pair == tuple(kinematics.servo_from_gimbal([0.1, -0.05]))
    assert np.isnan(kinematics.servo_from_gimbal([-1.0, 0.0])).any()
    assert np.isfinite(kinematics.servo_from_gimbal_fast(-1.0, 0.0)).all()


def test_the_workspace_reaches_both_stops_with_the_servos_short_of_their_range(linkage):
    model, _, kinematics = linkage
    space = kinematics.workspace(5)
    assert np.isfinite(space.servo).all()
    assert degrees(space.gimbal.max()) == pytest.approx(10, abs=1e-3)
    commanded = kinematics.servo_from_gimbal(np.radians(list(itertools.product([-8, 8], repeat=2))))
    assert np.abs(commanded).max() < model.actuator_ctrlrange[0, 1]
    # horn 8 mm on an arm of 20.5 mm: the ratio at home is near 8/20.5, the rods' lean adds 4 %
    assert_allclose(np.diag(space.ratio[2, 2]), 8 / 20.5, rtol=0.05)


def test_the_line_about_a_workspace_names_its_extremes():
    servo, ratio = np.radians([[[[-21.5, 3.0], [4.0, 17.3]]]])[0], np.zeros((1, 2, 2, 2))
    ratio[0, :, 0, 0], ratio[0, :, 1, 1] = (0.31, 0.52), (-0.47, -0.93)
    assert Workspace(np.zeros_like(servo), servo, ratio).text == (
        "servos at -21.5° to 17.3° for all of it, 0.31 to 0.93° of gimbal per degree of servo"
    )


def test_a_direct_drive_passes_angles_through():
    model, data = load("examples/direct_drive.xml")
    kinematics = Kinematics(model)
    assert kinematics.direct
    assert_allclose(kinematics.servo_from_gimbal([0.1, -0.2]), [0.1, -0.2])
    assert kinematics.servo_from_gimbal_fast(0.1, -0.2) == (0.1, -0.2)
    assert not kinematics.closure(data).any()


def test_a_model_without_a_gimbal_is_told_what_is_missing():
    model = mujoco.MjModel.from_xml_string("<mujoco/>")
    with pytest.raises(MechanismError, match="'gimbal_x' and 'gimbal_y' are missing"):
        mobility(model)


def test_a_rod_that_does_not_reach_its_ball_is_named():
    spec = mujoco.MjSpec.from_file(str(MJCF / "mechanism.xml"))
    spec.site("rod_y_end").pos[2] += 0.002
    with pytest.raises(MechanismError, match="rod y does not reach its ball"):
        Kinematics(spec.compile())


def test_angles_of_the_wrong_shape_are_refused(linkage):
    with pytest.raises(MechanismError, match="last axis"):
        linkage[2].servo_from_gimbal([0.1, 0.2, 0.3])


# ---- servos


@pytest.fixture
def shaft():
    """One servo of the mechanism by itself, horn in hand: no rod, no gravity."""
    spec = mujoco.MjSpec.from_file(str(MJCF / "mechanism.xml"))
    for equality in list(spec.equalities):
        spec.delete(equality)
    spec.delete(spec.body("rod_x"))
    spec.delete(spec.body("rod_y"))
    spec.option.gravity = [0, 0, 0]
    return spec


def test_a_servo_is_as_fast_and_as_strong_as_its_data_sheet(shaft):
    """SG90 at 4.8 V: 0.10 to 0.12 s for 60° without load, 0.18 N m stall."""
    model = shaft.compile()
    model.actuator_ctrlrange[:] = [-2, 2]
    model.numeric("servo_slew").data[:] = 0
    apply_servo(model)
    data = mujoco.MjData(model)
    data.ctrl[0] = 2
    passed = {}
    while data.time < 0.5:
        mujoco.mj_step(model, data)
        for mark in (15, 75):
            if degrees(data.joint("servo_x").qpos[0]) >= mark:
                passed.setdefault(mark, data.time)
    assert 0.10 <= passed[75] - passed[15] <= 0.12
    mujoco.mj_resetData(model, data)
    data.ctrl[0] = 2
    mujoco.mj_forward(model, data)
    # 0.38 / 10 Ω · 4.8 V
    assert data.actuator_force[0] == pytest.approx(0.18, abs=0.003)


def test_the_slew_limit_holds_the_shaft_to_its_speed(shaft):
    model = shaft.compile()
    model.numeric("servo_slew").data[:] = 2.0
    apply_servo(model)
    data = mujoco.MjData(model)
    data.ctrl[0] = 0.5
    mujoco.mj_step(model, data, 150)
    start = data.joint("servo_x").qpos[0]
    mujoco.mj_step(model, data, 50)
    # 2 rad/s in 50 ms; the remaining ripple of the loop is a few percent
    assert data.joint("servo_x").qpos[0] - start == pytest.approx(0.1, rel=0.08)


def test_zero_switches_the_slew_limit_off(shaft):
    model = shaft.compile()
    model.numeric("servo_slew").data[:] = 0
    apply_servo(model)
    data = mujoco.MjData(model)
    data.ctrl[0] = 0.5
    mujoco.mj_forward(model, data)
    assert data.actuator_force[0] == pytest.approx(0.1824, abs=1e-6)  # K V / R at once


def test_a_servo_value_that_cannot_be_is_refused_by_name(shaft):
    model = shaft.compile()
    model.numeric("servo_resistance").data[:] = 0
    with pytest.raises(MechanismError, match=r"servo_resistance = 0\.0: must be greater than zero"):
        apply_servo(model)


def test_two_values_set_the_servos_apart():
    text = (MJCF / "mechanism.xml").read_text()
    text = text.replace('name="servo_gain" data="1.8"', 'name="servo_gain" data="1.8 0.9"')
    spec = mujoco.MjSpec.from_string(text)
    spec.meshdir = str(MJCF.parent / "meshes")
    model = spec.compile()
    apply_servo(model)
    assert_allclose(model.actuator_gainprm[:, 4], [1.8, 0.9])


@pytest.fixture(scope="module")
def passive():
    @cfunc(types.void(types.voidptr, types.voidptr))
    def callback(model, data):
        dead_bands(address(model), address(data))

    return callback


@pytest.fixture
def native(passive):
    before = mujoco.get_mjcb_passive()
    mujoco.set_mjcb_passive(passive.ctypes)
    yield
    mujoco.set_mjcb_passive(before)


def test_the_dead_band_reads_the_time_step_where_it_lies():
    assert structs.STRUCTS["mjOption"].fields[0].name == "timestep"


@pytest.mark.thorough
@pytest.mark.usefixtures("native")
@pytest.mark.parametrize(("k", "servo"), [(0, "servo_x"), (1, "servo_y")])
def test_a_servo_with_a_dead_band_pulls_as_one_without_whose_error_is_that_much_smaller(
    shaft, k, servo
):
    model = shaft.compile()
    model.numeric("servo_slew").data[:] = 0
    model.numeric("servo_dead_band").data[:] = 0.02
    apply_servo(model)
    data = mujoco.MjData(model)
    dof = model.joint(servo).dofadr[0]

    def torque(angle, rate, command, half):
        model.actuator_user[k, 0] = half
        data.joint(servo).qpos, data.joint(servo).qvel = angle, rate
        data.ctrl[k] = command
        mujoco.mj_forward(model, data)
        return data.actuator_force[k] + data.qfrc_passive[dof]

    rng = np.random.default_rng(0)
    for _ in range(50):
        angle, rate, command = rng.uniform([-0.3, -6, -1], [0.3, 6, 1])
        error = np.clip(command, *model.actuator_ctrlrange[k]) - angle
        seen = error - np.clip(error, -0.02, 0.02)
        assert torque(angle, rate, command, 0.02) == pytest.approx(
            torque(angle, rate, angle + seen, 0.0), abs=1e-12
        )


@pytest.mark.usefixtures("native")
def test_a_command_inside_the_dead_band_moves_nothing(shaft):
    model = shaft.compile()
    model.numeric("servo_dead_band").data[:] = 0.02
    apply_servo(model)
    data = mujoco.MjData(model)
    data.ctrl[0] = 0.019
    mujoco.mj_step(model, data, 500)
    assert abs(data.joint("servo_x").qpos[0]) < 1e-9


def test_a_gimbal_pushed_by_hand_moves_by_the_backlash_times_the_ratio():
    """±0.05 N m on axis x presses the horn against one side of its play, then the other."""
    width = radians(2)
    spec = mujoco.MjSpec.from_file(str(MJCF / "mechanism.xml"))
    insert_backlash(spec, width)
    spec.option.gravity = [0, 0, 0]
    model = spec.compile()
    data = mujoco.MjData(model)
    kinematics = Kinematics(model)
    found = []
    for push in (-0.05, 0.05):
        data.qfrc_applied[model.joint("x").dofadr[0]] = push
        mujoco.mj_step(model, data, 1000)
        gimbal, servo = angles(data)
        side = [np.sign(push) * width / 2, data.joint("play_y").qpos[0]]
        # 0.02°: what a stop of finite stiffness gives way under 0.02 N m at the horn
        assert gimbal[0] == pytest.approx(
            kinematics.gimbal_from_servo(servo + side)[0], abs=radians(0.02)
        )
        found.append(gimbal[0])
    assert found[1] - found[0] > width * 8 / 20.5


def test_no_backlash_adds_no_joint_and_a_negative_one_is_refused():
    spec = mujoco.MjSpec.from_file(str(MJCF / "mechanism.xml"))
    count = len(spec.joints)
    insert_backlash(spec, 0.0)
    assert len(spec.joints) == count
    with pytest.raises(MechanismError, match="must be 0 or greater"):
        insert_backlash(spec, -0.1)
