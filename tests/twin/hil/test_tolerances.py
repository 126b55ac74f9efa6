"""Simulated rigs with a serial number move as unlike the model as hobby servos do."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest
from scipy.optimize import root

from hardware.emulator import reference_rig, sample_rig
from twin.hil import BenchPlant, parameters
from twin.hil.tolerances import vary
from twin.physics import native
from twin.plant.model.model import ModelConfig, load

UNITS = range(1, 11)
STEP = 0.2  # rad of shaft: about 5° of the gimbal


def moved(unit):
    """Angle of x every millisecond after a step of its shaft, from rest [rad]."""
    twin = load(ModelConfig(scene="bench"))
    if unit is not None:
        vary(twin.mj, sample_rig(unit))
    bench = BenchPlant(twin)
    for _ in range(400):
        bench.advance(1e-3, (0.0, 0.0, 0.0))
    angles = []
    for _ in range(400):
        bench.advance(1e-3, (STEP, 0.0, 0.0))
        angles.append(bench.angles()[0])
    return np.array(angles)


def rise(angles):
    """Time from 10 to 90 % of where the motion ends [s]."""
    share = (angles - angles[0]) / (angles[-1] - angles[0])
    return 1e-3 * (int(np.argmax(share > 0.9)) - int(np.argmax(share > 0.1)))


@pytest.fixture(scope="module")
def motions():
    with native.installed():
        return {unit: moved(unit) for unit in (None, *UNITS)}


def test_units_rise_as_differently_as_servos_do_and_the_plain_rig_is_the_model(motions):
    times = np.array([rise(motions[u]) for u in UNITS])
    assert times.std(ddof=1) / times.mean() > 0.07  # 10 % rms over 20 units and both axes
    assert np.all(np.abs(times / rise(motions[None]) - 1.0) < 0.4)
    ends = np.degrees([motions[u][-1] for u in UNITS])
    assert 0.03 < ends.std(ddof=1) < 1.0  # horns


def test_a_rig_without_tolerances_changes_nothing():
    twin, same = (load(ModelConfig(scene="bench")).mj for _ in range(2))
    vary(twin, parameters(twin))
    for field in ("actuator_gainprm", "actuator_dynprm", "dof_frictionloss", "jnt_range"):
        np.testing.assert_array_equal(getattr(twin, field), getattr(same, field))
    np.testing.assert_array_equal(twin.body_pos, same.body_pos)


def test_every_tolerance_of_a_servo_reaches_its_part_of_the_model():
    twin, same = (load(ModelConfig(scene="bench")).mj for _ in range(2))
    rig, plain = sample_rig(7), reference_rig()
    vary(twin, rig)
    for k, axis in enumerate("xy"):
        own, nominal = rig.plant.servos[k], plain.plant.servos[k]
        play, servo = f"gimbal_play_{axis}", f"gimbal_servo_{axis}"
        ratio = np.ptp(twin.joint(play).range) / np.ptp(same.joint(play).range)
        assert ratio == pytest.approx(own.backlash / nominal.backlash)
        friction = [m.joint(servo).frictionloss[0] for m in (twin, same)]
        assert friction[0] / friction[1] == pytest.approx(own.friction / nominal.friction)
        actuator = [int(m.actuator(servo).id) for m in (twin, same)]
        dead = [m.actuator_user[a][0] for m, a in zip((twin, same), actuator, strict=True)]
        assert dead[0] / dead[1] == pytest.approx(own.dead_band / nominal.dead_band)
        # voltage over constant is the free speed of a motor
        gains = [m.actuator_gainprm[a] for m, a in zip((twin, same), actuator, strict=True)]
        speeds = [g[7] / g[1] for g in gains]
        free = (own.voltage / own.torque_constant) / (nominal.voltage / nominal.torque_constant)
        assert speeds[0] / speeds[1] == pytest.approx(free)
        assert 0.8 <= free <= 1.25


def pose(model, shafts=(0.0, 0.0)):
    """Angles x, y at which both rods have their lengths, of rigid parts without play [rad]."""
    data = mujoco.MjData(model)

    def stretched(angles):  # mm
        for axis, shaft, angle in zip("xy", shafts, angles, strict=True):
            data.joint(f"gimbal_servo_{axis}").qpos = shaft
            data.joint(f"gimbal_{axis}").qpos = angle
        mujoco.mj_kinematics(model, data)
        rods = [data.body(f"gimbal_rod_{a}").xpos for a in "xy"]
        balls = [data.site(f"gimbal_holder_{a}_ball").xpos for a in "xy"]
        nominal = [np.linalg.norm(model.site(f"gimbal_rod_{a}_end").pos) for a in "xy"]
        return 1e3 * (np.linalg.norm(np.subtract(rods, balls), axis=1) - nominal)

    return root(stretched, (0.0, 0.0), tol=1e-9).x


def slopes(model):
    """Gimbal angles x, y per shaft angle of x and y (2, 2)."""
    return (np.array([pose(model, shafts) for shafts in 0.05 * np.eye(2)]) - pose(model)).T / 0.05


@pytest.mark.parametrize("unit", [1, 2, 4])
def test_a_units_linkage_has_its_zero_ratio_and_coupling(unit):
    """By closing the loops of the rods; slopes without the error of the zero, which bends them."""
    whole, straight = (load(ModelConfig(scene="bench")).mj for _ in range(2))
    before, plant, plain = slopes(straight), sample_rig(unit).plant, reference_rig().plant
    vary(whole, replace(reference_rig(), plant=plant))
    # products of two errors: a coupling of 4 % and the other zero of 1.5°, a rod's lean
    np.testing.assert_allclose(np.degrees(pose(whole)), np.degrees(plant.offset), atol=0.2)
    vary(straight, replace(reference_rig(), plant=replace(plant, offset=(0.0, 0.0))))
    changed = np.subtract(plant.linkage, plain.linkage)
    # again, and the bend of the linkage: 13 % of 0.444 at 7° is 0.005 at 0.6°, half of a step
    np.testing.assert_allclose(slopes(straight) - before, changed, atol=0.006)


def test_the_emulators_servo_is_that_of_the_mechanism_and_of_the_data_sheet():
    """One SG90: 1.8 kgf·cm at 4.8 V and 0.10 to 0.12 s/60°, in both plants of a simulated rig."""
    p, model = reference_rig().plant.servos[0], load(ModelConfig(scene="bench")).mj
    shaft = p.torque_constant * p.gear
    stall = p.voltage / p.resistance * shaft
    assert stall == pytest.approx(1.8 * 9.80665e-2, rel=0.05)
    loss = p.torque_constant**2 + p.viscous * p.resistance
    free = (p.voltage - p.friction) * p.torque_constant / loss / p.gear
    assert 0.10 < np.radians(60) / free < 0.12
    gain = model.actuator_gainprm[int(model.actuator("gimbal_servo_x").id)]
    joint = model.joint("gimbal_servo_x")
    of_model = {
        "resistance": gain[0], "torque constant": gain[1], "gain": gain[4] * gain[0] / gain[1],
        "voltage": gain[7], "rotor": joint.armature[0], "damping": joint.damping[0],
        "friction": joint.frictionloss[0],
    }  # fmt: skip
    of_plant = {
        "resistance": p.resistance, "torque constant": shaft, "gain": p.gain,
        "voltage": p.voltage, "rotor": p.inertia * p.gear**2, "damping": p.viscous * p.gear**2,
        "friction": p.friction / p.resistance * shaft,
    }  # fmt: skip
    assert of_plant == pytest.approx(of_model, rel=0.01)


def test_sag_of_the_supply_slows_the_servos_of_the_bench():
    def speed(share):
        bench = BenchPlant(load(ModelConfig(scene="bench", overrides={"gimbal_servo_slew": 0.0})))
        bench.set_supply(share)
        turned = []
        for _ in range(60):
            bench.advance(1e-3, (0.45, 0.0, 0.0))
            turned.append(bench.rates()[0])
        return max(turned)

    with native.installed():
        # friction of 3 % of the stall torque, and the load, take more of a weaker one
        assert 0.6 < speed(0.7) / speed(1.0) < 0.72
