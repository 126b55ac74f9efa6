"""Control loops against closed forms, other arithmetic and MuJoCo."""

import math

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from twin.control import (
    AttitudeController,
    ControlConfig,
    Doublet,
    FixedPoint,
    Hold,
    PitchOver,
    Step,
)
from twin.control.pid import low_pass, pid
from twin.errors import TwinError

ZERO = np.zeros(3)


def launch_direction(elevation: float, azimuth: float = 0.0) -> tuple[float, float, float]:
    """(East, north, up), unit, of the model's `ramp_elevation` and `ramp_azimuth` [rad].

    Elevation counts from the horizon, azimuth from east to north.
    """
    level = math.cos(elevation)
    return (level * math.cos(azimuth), level * math.sin(azimuth), math.sin(elevation))


def wxyz(rotation: Rotation) -> np.ndarray:
    return rotation.as_quat(scalar_first=True)


VEHICLE = """
<mujoco>
  <option gravity="0 0 0" timestep="0.001"/>
  <worldbody>
    <body name="vehicle"><freejoint name="vehicle"/>
      <inertial pos="0 0 0.3" mass="1" diaginertia="0.1 0.1 0.0005"/>
      <body name="holder">
        <joint name="gimbal_x" axis="1 0 0"/><joint name="gimbal_y" axis="0 1 0"/>
        <inertial pos="0 0 0" mass="0.001" diaginertia="1e-6 1e-6 1e-6"/>
        <site name="gimbal_nozzle" pos="0 0 -0.15"/>
      </body>
    </body>
  </worldbody>
</mujoco>"""


def turning_of_a_thrusting_model(gimbal: np.ndarray) -> np.ndarray:
    """Angular velocity (3,) in the body frame after a few steps of thrust along the nozzle."""
    model = mujoco.MjModel.from_xml_string(VEHICLE)
    data = mujoco.MjData(model)
    for _ in range(5):
        data.joint("gimbal_x").qpos, data.joint("gimbal_y").qpos = gimbal
        data.joint("gimbal_x").qvel, data.joint("gimbal_y").qvel = 0, 0
        mujoco.mj_kinematics(model, data)
        thrust = data.site("gimbal_nozzle").xmat.reshape(3, 3)[:, 2] * 13.0
        data.qfrc_applied[:] = 0
        holder = model.body("holder").id
        mujoco.mj_applyFT(
            model,
            data,
            thrust,
            np.zeros(3),
            data.site("gimbal_nozzle").xpos,
            holder,
            data.qfrc_applied,
        )
        data.qfrc_applied[6:] = 0  # the gimbal is held
        mujoco.mj_step(model, data)
    return data.qvel[3:6].copy()


@pytest.mark.parametrize(
    "wanted", [(0.1, 0.0, 1.0), (-0.1, 0.0, 1.0), (0.0, 0.1, 1.0), (0.1, -0.2, 1.0)]
)
def test_commanded_gimbal_turns_the_nose_towards_the_setpoint_in_mujoco(wanted):
    nose = np.array(wanted) / np.linalg.norm(wanted)
    control = AttitudeController()
    angle = control.update(0.0, 0.004, np.array([1.0, 0, 0, 0]), ZERO, nose)
    turning = turning_of_a_thrusting_model(np.array(angle))
    should = np.cross([0, 0, 1.0], nose)
    cosine = turning @ should / np.linalg.norm(turning) / np.linalg.norm(should)
    assert cosine > 0.999  # axes differ by the second order of an 8° tilt


def test_rate_alone_is_braked_in_mujoco():
    control = AttitudeController()
    up = np.array([0, 0, 1.0])
    rate = np.array([0.3, -0.2, 0.0])
    for _ in range(50):
        angle = control.update(0.0, 0.004, np.array([1.0, 0, 0, 0]), rate, up)
    assert turning_of_a_thrusting_model(np.array(angle))[:2] @ rate[:2] < 0


def test_error_is_the_rotation_vector_that_scipy_finds_however_the_vehicle_has_rolled():
    rng = np.random.default_rng(3)
    n = 200
    attitude = Rotation.random(n, random_state=4)
    nose = rng.normal(size=(n, 3))
    nose /= np.linalg.norm(nose, axis=1)[:, None]
    control = AttitudeController()
    control.reset(n)
    control.update(0.0, 0.004, wxyz(attitude), np.zeros((n, 3)), nose)
    for k in range(n):
        e = np.array([*control.error[k], 0.0])
        # turned by the error about body axes, the nose lies on the setpoint
        assert (attitude[k] * Rotation.from_rotvec(e)).apply([0, 0, 1.0]) == pytest.approx(
            nose[k], abs=1e-9
        )
        assert np.linalg.norm(e) <= math.pi + 1e-12


def test_one_vehicle_and_ten_thousand_agree():
    rng = np.random.default_rng(5)
    n = 10_000
    q = wxyz(Rotation.random(n, random_state=6))
    w = rng.normal(size=(n, 3))
    nose = np.tile(launch_direction(0.9), (n, 1))
    many, one = AttitudeController(), AttitudeController()
    many.reset(n)
    for t in (0.0, 0.004, 0.008):
        all_angles = many.update(t, 0.004, q, w, nose, np.empty((n, 2)))
        angle = one.update(t, 0.004, q[7], w[7], nose[7], np.empty(2))
        np.testing.assert_array_equal(angle, all_angles[7])
    assert all_angles.shape == (n, 2)


def test_angle_and_its_rate_stay_within_their_bounds():
    control = AttitudeController(ControlConfig(kp=200.0, rate_limit=4.0))
    rng = np.random.default_rng(7)
    last = np.zeros(2)
    for k in range(300):
        q = wxyz(Rotation.random(random_state=k))
        angle = control.update(0.0, 0.004, q, rng.normal(size=3), np.array([0, 0, 1.0])).copy()
        assert np.abs(angle).max() <= math.radians(8.0) + 1e-12
        assert np.abs(angle - last).max() <= 4.0 * 0.004 + 1e-12
        last = angle


def test_without_thrust_the_gimbal_is_centred_and_the_integral_waits():
    config = ControlConfig(authority_time=(0.0, 1.0, 1.1), authority=(60.0, 60.0, 0.0))
    control = AttitudeController(config)
    tilted = wxyz(Rotation.from_rotvec([0.05, 0, 0]))
    up = np.array([0, 0, 1.0])
    for k in range(100):
        control.update(2.0 + 0.01 * k, 0.01, tilted, ZERO, up)
    assert control.update(3.0, 0.01, tilted, ZERO, up) == pytest.approx([0, 0], abs=0)
    fresh = AttitudeController(config)
    now = control.update(0.5, 0.01, tilted, ZERO, up).copy()
    assert now == pytest.approx(fresh.update(0.5, 0.01, tilted, ZERO, up), abs=0)


def test_gimbal_angle_scales_with_the_inverse_of_authority():
    tilted = wxyz(Rotation.from_rotvec([0.01, 0, 0]))
    up = np.array([0, 0, 1.0])
    angles = [
        AttitudeController(ControlConfig(authority=(b,))).update(0.0, 0.004, tilted, ZERO, up)[0]
        for b in (60.0, 120.0)
    ]
    assert angles[0] == pytest.approx(2.0 * angles[1], rel=1e-12)
    assert angles[0] == pytest.approx(25.0 * 0.01 / 60.0, rel=1e-9)  # kp·e/b, and +x tilts to −x


@pytest.mark.parametrize("dt", [0.001, 0.004, 0.02])
def test_low_pass_step_equals_the_exponential_at_any_step(dt):
    value = 0.0
    for _ in range(25):
        value = low_pass(value, 1.0, 40.0, dt)
    assert value == pytest.approx(1 - math.exp(-40.0 * 25 * dt), abs=1e-13)


def test_pid_on_an_integrator_settles_as_its_characteristic_polynomial_says():
    # x' = u, PI with kp = 2, ki = 1: (s + 1)²; integral of the error is zero overshoot area 1/ki·u∞
    x, integral, dt = 0.0, 0.0, 1e-3
    t = np.arange(8000) * dt
    out = np.empty(len(t))
    for k in range(len(t)):
        out[k] = x
        u, integral = pid(1.0 - x, 0.0, integral, 2.0, 1.0, 0.0, -math.inf, math.inf, dt)
        x += dt * u
    truth = 1 - np.exp(-t) * (1 - t)  # inverse transform of (2s + 1)/(s(s + 1)²)
    assert np.abs(out - truth).max() < 2e-3  # first order in dt


def test_integral_does_not_wind_up_while_the_output_is_bounded():
    integral, gains = 0.0, (1.0, 1.0, 0.0, -0.5, 0.5, 0.01)
    for _ in range(1000):
        output, integral = pid(3.0, 0.0, integral, *gains)
        assert output == 0.5
    # the error changes sign: the output leaves its bound at once, not after 30 s of unwinding
    assert pid(-0.6, 0.0, integral, *gains)[0] < 0.0


def test_the_integral_waits_beyond_a_bound_and_moves_back_from_it():
    """Conditional integration: held while it would drive the output further past a limit."""
    gains = (1.0, 1.0, 0.0, -0.5, 0.5, 0.01)
    # past the upper and the lower bound, by the proportional part alone
    for error in (3.0, -3.0):
        assert pid(error, 0.0, 0.1, *gains) == (math.copysign(0.5, error), 0.1)
    # within the bounds, and past them with an error that leads back: ki·e·dt more
    assert pid(0.2, 0.0, 0.1, *gains)[1] == pytest.approx(0.1 + 0.2 * 0.01)
    output, integral = pid(-0.2, -1.0, 0.4, 1.0, 1.0, 1.0, -0.5, 0.5, 0.01)
    assert output == 0.5
    assert integral == pytest.approx(0.4 - 0.2 * 0.01)


def test_setpoint_jump_gives_no_derivative_kick():
    level, up, jumped = wxyz(Rotation.identity()), np.array([0, 0, 1.0]), np.array([0, 0.1, 1.0])
    loop = AttitudeController(ControlConfig(kp=0.0, ki=0.0, kd=5.0))
    loop.update(0.0, 0.004, level, ZERO, up)
    np.testing.assert_array_equal(loop.update(0.004, 0.004, level, ZERO, jumped), 0.0)


def test_programmes_turn_in_the_launch_plane_and_positive_tips_down_range():
    launch = launch_direction(math.radians(50.0), math.radians(20.0))
    for programme in (
        Step(launch, amplitude=0.1, begin=1.0),
        Doublet(launch, amplitude=0.1, begin=1.0),
    ):
        nose = programme.direction(1.5, ZERO, ZERO)
        assert nose == pytest.approx(
            launch_direction(math.radians(50.0) - 0.1, math.radians(20.0)), abs=1e-12
        )
        assert programme.direction(0.5, ZERO, ZERO) == pytest.approx(launch, abs=1e-15)
    assert Doublet(launch, begin=1.0, duration=1.0).angle(2.5) == -math.radians(5.0)
    assert Doublet(launch, begin=1.0, duration=1.0).angle(3.5) == 0.0
    assert Hold().direction(9.0, np.zeros((4, 3)), np.zeros((4, 3))).shape == (4, 3)


def test_pitch_over_reaches_its_amplitude_without_a_jump():
    over = PitchOver(launch_direction(1.2), amplitude=0.5, begin=1.0, duration=4.0)
    t = np.linspace(0, 7, 7001)
    angle = np.array([over.angle(float(s)) for s in t])
    assert angle[[0, -1]] == pytest.approx([0.0, 0.5], abs=1e-15)
    assert np.abs(np.diff(angle)).max() <= 0.5 * math.pi / 8.0 * 1e-3 * 1.001  # peak slope A·π/(2T)


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: Hold((0.0, 0.0, 0.0)), "must not be zero"),
        (lambda: Hold((0.0, 0.0, 1.0), axis=(0.0, 0.0, 2.0)), "along launch"),
        (lambda: ControlConfig(kp=-1.0), "kp is -1"),
        (lambda: ControlConfig(cutoff=math.nan), "cutoff is nan"),
        (lambda: ControlConfig(authority=(1.0, 2.0)), "2 values for 1 times"),
        (lambda: FixedPoint((500.0, 0.0, 0.0)), "90.0° off the launch direction"),
        (lambda: FixedPoint((0.0, 0.0, 0.0)), "away from the launch point"),
    ],
)
def test_impossible_settings_are_refused_in_one_line(make, says):
    with pytest.raises(TwinError, match=says) as caught:
        make()
    assert "\n" not in str(caught.value)
