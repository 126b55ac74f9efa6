"""The shipped mechanism and its scenes: they run, close and measure what they should."""

from math import cos, degrees, radians, sin
from pathlib import Path

import mujoco
import numpy as np
import pytest

from twin.physics.mechanism import Kinematics, apply_servo, insert_backlash

MJCF = Path(__file__).resolve().parents[2] / "mjcf"
SHIPPED = sorted(MJCF.glob("*.xml")) + sorted(MJCF.glob("examples/*.xml"))


def load(name):
    model = mujoco.MjModel.from_xml_path(str(MJCF / name))
    return model, mujoco.MjData(model)


@pytest.mark.parametrize("path", SHIPPED, ids=lambda p: p.stem)
def test_a_shipped_model_runs_two_seconds_on_noise_without_a_warning(path):
    model = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(model)
    rng = np.random.default_rng(0)
    low, high = model.actuator_ctrlrange.T
    for _ in range(100):
        data.ctrl[:] = rng.uniform(low, high)
        mujoco.mj_step(model, data, round(0.02 / model.opt.timestep))
    assert not data.warning.number.any()
    assert np.isfinite(data.qpos).all()


FREE = """
<mujoco>
  <compiler angle="radian"/>
  <option timestep="0.001" integrator="implicitfast" gravity="0 0 0"/>
  <asset><model name="mechanism" file="{}"/></asset>
  <worldbody>
    <body name="vehicle"><freejoint name="vehicle"/>
      <geom type="cylinder" size="0.027 0.4" pos="0 0 0.4" mass="0.72"/>
      <frame><attach model="mechanism" body="mount" prefix="gimbal_"/></frame>
    </body>
  </worldbody>
</mujoco>"""


@pytest.mark.parametrize("backlash", [0.0, 0.0087, 0.05])
def test_closure_stays_below_50_um_under_load(backlash):
    """45 N of thrust on a free vehicle of 1 kg (44 m/s²), full commands every 40 ms."""
    spec = mujoco.MjSpec.from_string(FREE.format(MJCF / "mechanism.xml"))
    insert_backlash(spec, backlash)
    model = spec.compile()
    data = mujoco.MjData(model)
    kinematics = Kinematics(model)
    rng = np.random.default_rng(1)
    nozzle, holder = model.site("gimbal_nozzle").id, model.body("gimbal_holder").id
    worst = 0.0
    for step in range(4000):
        if step % 40 == 0:
            data.ctrl[:] = kinematics.servo_from_gimbal(rng.uniform(-1, 1, 2) * radians(8))
        thrust = 45 * data.site_xmat[nozzle].reshape(3, 3)[:, 2]
        data.qfrc_applied[:] = 0
        mujoco.mj_applyFT(
            model, data, thrust, np.zeros(3), data.site_xpos[nozzle], holder, data.qfrc_applied
        )
        mujoco.mj_step(model, data)
        worst = max(worst, kinematics.closure(data).max())
    assert worst < 50e-6


def test_the_servo_numerics_repeat_what_the_file_gives_its_actuators():
    for name in ("mechanism.xml", "examples/direct_drive.xml"):
        model, _ = load(name)
        before = [
            np.copy(a) for a in (model.actuator_gainprm, model.actuator_dynprm, model.actuator_user)
        ]
        apply_servo(model)
        after = (model.actuator_gainprm, model.actuator_dynprm, model.actuator_user)
        for a, b in zip(before, after, strict=True):
            np.testing.assert_allclose(a, b, rtol=1e-12)


@pytest.mark.parametrize("side", ["x_positive", "x_negative", "y_positive", "y_negative"])
def test_a_limit_switch_closes_at_its_angle(side):
    """Swept through the joint; 0.01° is a tenth of what a potentiometer resolves."""
    model, data = load("bench.xml")
    sides = ["x_positive", "x_negative", "y_positive", "y_negative"]
    known = model.numeric("switch_angle").data[sides.index(side)]
    low, high = known - np.sign(known) * radians(1), known + np.sign(known) * radians(1)
    for _ in range(30):
        middle = (low + high) / 2
        data.joint(f"gimbal_{side[0]}").qpos = middle
        mujoco.mj_forward(model, data)
        closed = data.sensor(f"switch_{side}").data[0] <= 0
        low, high = (low, middle) if closed else (middle, high)
    assert degrees(middle) == pytest.approx(degrees(known), abs=0.01)


def test_the_bench_stands_nozzle_up_and_its_gyro_turns_with_the_holder():
    model, data = load("bench.xml")
    mujoco.mj_forward(model, data)
    assert data.site("gimbal_nozzle").xpos[2] > data.site("gimbal_pivot").xpos[2]
    assert data.sensor("accelerometer").data[2] == pytest.approx(-9.81, abs=0.05)
    x, y = 0.12, -0.08
    data.joint("gimbal_x").qpos, data.joint("gimbal_y").qpos = x, y
    data.joint("gimbal_x").qvel = 1.0
    mujoco.mj_forward(model, data)
    # x rotates before y: the outer rate seen in the holder's axes
    np.testing.assert_allclose(data.sensor("gyro").data, [cos(y), 0, sin(y)], atol=1e-12)


def test_the_turntable_turns_its_base_gyro_about_x():
    model, data = load("turntable.xml")
    data.actuator("turntable").ctrl = 0.5
    mujoco.mj_step(model, data, 60)
    rate = data.joint("turntable").qvel[0]
    assert rate > 1
    mujoco.mj_forward(model, data)
    np.testing.assert_allclose(data.sensor("base_gyro").data, [rate, 0, 0], atol=1e-9)
    mujoco.mj_step(model, data, 1500)
    # friction 0.03 N m over the gain 9.4 N m/rad, and the gravity torque of 0.3 kg 70 mm off axis
    assert data.joint("turntable").qpos[0] == pytest.approx(0.5, abs=0.02)
