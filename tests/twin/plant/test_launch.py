"""Launch from a rigid rail, from a stand and by hand."""

import math

import mujoco
import numpy as np
import pytest

from twin.config import Fly
from twin.errors import TwinError
from twin.experiments.assembly import make_plant
from twin.physics import native
from twin.physics.motor import Depletion
from twin.physics.native import ramp
from twin.plant.authority import balance
from twin.plant.model.model import ModelConfig, load
from twin.plant.release import Release

G = 9.80665
UNLIT = {f"motor_thrust[{k}]": 0.0 for k in range(64)} | {"motor_impulse": 0.0}
PASSIVE = {"ramp_elevation": 1.3, "air_fin_slope": 6.0, "wind_speed": 3.0}  # margin 0.9 calibres


def advance(model, motor, data, seconds, dt):
    """Steps of RK4 with the propellant renewed every 4 ms; gives the last time."""
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_RK4
    for _ in range(round(seconds / 4e-3)):
        motor.update(data.time)
        mujoco.mj_step(model, data, round(4e-3 / dt))


def test_forces_of_a_rigid_rail_give_the_wanted_accelerations():
    """Back-substitution: a = free + Σ (1/m + r r'/I) N, for both lugs and for each."""
    rng = np.random.default_rng(0)
    for _ in range(20):
        free, wanted, arms = (tuple(rng.normal(size=2).tolist()) for _ in range(3))
        mass, inertia = rng.uniform(0.5, 5.0, 2).tolist()
        both = np.array(ramp.rigid_forces(free, wanted, arms, (1.0, 1.0), mass, inertia))
        gain = 1 / mass + np.outer(arms, arms) / inertia
        assert gain @ both + free == pytest.approx(np.array(wanted), rel=1e-9)
        one, none = ramp.rigid_forces(free, wanted, arms, (1.0, 0.0), mass, inertia)
        assert (gain[0, 0] * one + free[0], none) == pytest.approx((wanted[0], 0.0), rel=1e-9)
        none, half = ramp.rigid_forces(free, wanted, arms, (0.0, 0.5), mass, inertia)
        assert (none, gain[1, 1] * half / 0.5 + free[1]) == pytest.approx((0.0, wanted[1]))


@pytest.mark.parametrize("dt", [2e-4, 1e-3, 4e-3])
def test_a_vehicle_rests_on_its_rail_at_any_step(dt):
    model = load(ModelConfig(gimbal="follow", overrides=UNLIT, dt=dt)).mj
    data = mujoco.MjData(model)
    with native.installed():
        mujoco.mj_step(model, data, round(0.5 / dt))
    # what a motor hanging 2 g heavier on one side of its pivot moves
    assert np.abs(data.qpos[:3] - model.qpos0[:3]).max() < 2e-6


def test_past_the_upper_lug_a_vehicle_pitches_about_the_lower_one():
    """Rigid body on one lug: m g cos ε d / (I + m d²), d from the lug to the centre of mass."""
    model = load(ModelConfig(gimbal="follow", overrides={**UNLIT, "air_enabled": 0.0})).mj
    data = mujoco.MjData(model)
    length, lugs, elevation = (
        model.numeric(f"ramp_{n}").data for n in ("length", "lug", "elevation")
    )
    mass, lever, inertia, _ = balance(model)
    arm = lever - lugs[0]
    expected = mass * G * math.cos(elevation[0]) * arm / (inertia + mass * arm**2)
    up = np.array(ramp.rail(float(elevation[0]), 0.0))
    data.qpos[:3] += (length[0] - 0.15) * up  # the upper lug is off, the lower one on
    with native.installed():
        mujoco.mj_forward(model, data)
    assert data.qacc[4] == pytest.approx(expected, rel=2e-3)  # the gimbal is a second body
    at_lug = data.qacc[:3] + np.cross([0.0, data.qacc[4], 0.0], lugs[0] * up)
    assert np.linalg.norm(at_lug - (at_lug @ up) * up) < 0.02 * G


def test_the_softness_of_the_default_rail_changes_no_apogee_by_more_than_3e_3():
    """Passive flight near neutral: rigid rail at 1 ms, elastic one of 4e6 N/m at 50 µs."""
    tops = []
    for stiffness, dt in ((0.0, 1e-3), (4e6, 5e-5)):
        rail = {"ramp_stiffness": stiffness, "ramp_damping": 60 * math.sqrt(stiffness / 15e3)}
        held = load(ModelConfig(gimbal="follow", overrides=PASSIVE | rail, dt=dt)).mj
        free = load(ModelConfig(gimbal="follow", overrides=PASSIVE | rail, dt=1e-3)).mj
        one, other = mujoco.MjData(held), mujoco.MjData(free)
        with native.installed():
            advance(held, Depletion(held), one, 0.46, dt)
            assert np.linalg.norm(one.qpos[:3] - held.qpos0[:3]) > 2.0  # off the rail
            other.time, other.qpos[:], other.qvel[:] = one.time, one.qpos, one.qvel
            motor, top = Depletion(free), 0.0
            while other.qvel[2] > 0.0:
                advance(free, motor, other, 4e-3, 1e-3)
                top = max(top, float(other.qpos[2]))
        tops.append(top)
    assert tops[0] == pytest.approx(tops[1], rel=3e-3)


def test_lugs_stay_on_a_rigid_rail_through_a_steered_launch():
    plant = make_plant(Fly(gimbal="linkage"))
    up = np.array(ramp.rail(float(plant.model.numeric("ramp_elevation").data[0]), 0.0))
    aside = 0.0
    with native.installed():
        while np.linalg.norm(plant.position - plant.model.qpos0[:3]) < 1.6:  # upper lug still on
            plant.drive((0.03 * math.sin(40 * plant.time_ns * 1e-9), 0.03))
            plant.advance(4)
            off = plant.position - plant.model.qpos0[:3]
            aside = max(aside, float(np.linalg.norm(off - (off @ up) * up)))
    assert aside < 1e-4  # the swinging motor's reaction is all that the feedback has to remove


def test_a_stand_holds_a_vehicle_upright_until_it_lifts():
    plant = make_plant(Fly(launch="stand", set=("wind_speed=8",)))
    start = plant.position.copy()
    assert plant.model.numeric("ramp_elevation").data[0] == math.pi / 2
    with native.installed():
        while plant.position[2] - start[2] < 0.015:
            plant.advance(4)
            assert np.hypot(*(plant.position - start)[:2]) < 1e-4
        assert plant.attitude[0] == pytest.approx(1.0, abs=1e-6)
        while plant.position[2] - start[2] < 20.0:
            plant.advance(4)
    assert np.hypot(*(plant.position - start)[:2]) > 0.1  # free in the wind


def test_throws_have_the_stated_distributions():
    """500 throws: mean within 4 standard errors, standard deviations within 4 of theirs."""
    throws = [Release.thrown(seed, (6.0, 1.0), 0.1, 0.5) for seed in range(500)]
    samples = np.array([(t.speed - 6.0, *t.tilt, *t.rate) for t in throws])
    scaled = samples / [1.0, 0.1, 0.1, 0.5, 0.5, 0.5]
    assert np.abs(scaled.mean(axis=0)).max() < 4 / math.sqrt(500)
    assert np.abs(scaled.std(axis=0) - 1.0).max() < 4 / math.sqrt(1000)
    correlation = np.corrcoef(scaled.T) - np.eye(6)
    assert np.abs(correlation).max() < 4 / math.sqrt(500)
    assert Release.thrown(7, (6.0, 1.0), 0.1, 0.5) == throws[7]


def test_a_thrown_vehicle_leaves_the_hand_as_sampled():
    plant = make_plant(Fly(launch="hand", seed=5))
    throw = Release.thrown(5, (6.0, 1.0), math.radians(5.0), math.radians(30.0))
    turn = np.empty(9)
    mujoco.mju_quat2Mat(turn, plant.attitude)
    nose = turn.reshape(3, 3)[:, 2]
    assert plant.velocity == pytest.approx(throw.speed * nose)
    assert plant.rate == pytest.approx(throw.rate)
    launch = np.array(ramp.rail(float(plant.model.numeric("ramp_elevation").data[0]), 0.0))
    assert math.acos(nose @ launch) == pytest.approx(math.hypot(*throw.tilt), rel=1e-6)
    lug = plant.position + plant.model.numeric("ramp_lug").data[0] * launch
    assert lug[2] == pytest.approx(1.7, abs=5e-3)
    assert plant.model.numeric("ramp_length").data[0] == 0.0


def test_errors_of_a_throw_need_a_throw():
    with pytest.raises(TwinError, match=r"--hand-rate-deg-s .* has no effect with"):
        Fly(hand_rate_deg_s=1.0)


def test_ninety_degrees_with_five_digits_are_vertical():
    model = load(ModelConfig(overrides={"ramp_elevation": 1.5708})).mj
    assert model.qpos0[3] == pytest.approx(1.0, abs=1e-9)


def test_the_foot_of_a_rail_pushes_but_never_pulls() -> None:
    """Below the foot the feedback of a critically damped spring; above it only the weight."""
    assert ramp.stop(-0.001, 0.05, -9.0, 50.0) == pytest.approx(9.0 - 2 * 50 * 0.05 + 2.5)
    assert ramp.stop(-0.001, 3.0, -9.0, 50.0) == 0.0
    assert ramp.stop(ramp.REST / 4, -1.0, -9.0, 50.0) == pytest.approx(0.75 * 9.0)
    assert ramp.stop(ramp.REST / 4, -1.0, 9.0, 50.0) == 0.0
    assert ramp.stop(ramp.REST, -1.0, -9.0, 50.0) == 0.0
