"""Commands to the gimbal of a plant: by name, through the linkage, or followed."""

import json
from math import radians

import mujoco
import numpy as np
import pytest

from twin.errors import DivergenceError, TwinError
from twin.physics import native
from twin.plant.model.model import REFERENCE_GIMBAL, ModelConfig, load
from twin.plant.plant import Plant

ANGLE = radians(4.0), radians(-2.5)


def reached(gimbal, command):
    with native.installed():
        plant = Plant(load(ModelConfig(scene="bench", gimbal=gimbal)))
        command(plant)
        for _ in range(100):
            plant.advance(10)
        return plant.gimbal()


def test_a_driven_linkage_goes_where_it_is_commanded():
    state = reached("linkage", lambda plant: plant.drive(ANGLE))
    # backlash (±0.1° at the gimbal), dead band (±0.11°) and friction of the servos
    assert abs(np.subtract(state.angle, ANGLE)).max() < radians(0.4)


def test_a_driven_transfer_function_ends_at_its_static_gain():
    state = reached("transfer-function", lambda plant: plant.drive(ANGLE))
    channels = json.loads(REFERENCE_GIMBAL.read_text())["channels"]
    gain = [[c["num"][-1] / c["den"][-1] for c in row] for row in channels]
    np.testing.assert_allclose(state.angle, gain @ np.array(ANGLE), atol=radians(0.02))


def test_a_gimbal_on_the_bench_that_leaves_its_stops_has_diverged(tmp_path):
    content = json.loads(REFERENCE_GIMBAL.read_text())
    content["channels"][0][0]["num"][-1] *= 1e3
    model = tmp_path / "model.json"
    model.write_text(json.dumps(content))

    def driven(plant):
        plant.drive(ANGLE)
        for _ in range(30):
            plant.advance(1)

    with native.installed():
        config = ModelConfig(scene="bench", gimbal="transfer-function", transfer_function=model)
        plant = Plant(load(config))
        with pytest.raises(DivergenceError, match=r"joint 'gimbal_x' is at 27.*, past its stops"):
            driven(plant)


def test_joints_that_follow_take_the_measured_angle_exactly():
    state = reached("follow", lambda plant: plant.follow(ANGLE))
    np.testing.assert_allclose(state.angle, ANGLE, atol=radians(0.005))
    np.testing.assert_allclose(state.rate, 0.0, atol=radians(0.01))


def test_joints_that_follow_a_swing_have_its_angle_and_its_rate():
    size, w, tick = radians(5.0), 2 * np.pi * 2.0, 4e-3
    with native.installed():
        plant = Plant(load(ModelConfig(scene="bench", gimbal="follow")))
        off = []
        for k in range(150):
            t = k * tick
            plant.follow((size * np.sin(w * t), 0.0), (size * w * np.cos(w * t), 0.0))
            plant.advance(4)
            t += tick
            off.append(plant.gimbal_angle[0] - size * np.sin(w * t))
            off.append(tick * (plant.gimbal_rate[0] - size * w * np.cos(w * t)))
    # the rate is constant over a tick: off by half a tick of acceleration
    assert np.abs(off[20:]).max() < 0.6 * tick**2 * size * w**2


def test_a_gimbal_that_follows_turns_the_vehicle_the_other_way():
    overrides = {"gravity[2]": 0.0, "motor_ignition": 100.0}
    size, w, tick = radians(6.0), 2 * np.pi * 3.0, 4e-3
    with native.installed():
        plant = Plant(load(ModelConfig(gimbal="follow", overrides=overrides)))
        plant.position[2] += 100.0  # off its ramp
        momentum, moving = [], []
        body = plant.model.body("vehicle").id
        for k in range(60):
            t = k * tick
            angle, rate = size * (1 - np.cos(w * t)), size * w * np.sin(w * t)
            plant.follow((0.0, angle), (0.0, rate))
            plant.advance(4)
            mujoco.mj_subtreeVel(plant.model, plant.data)
            momentum.append(plant.data.subtree_angmom[body][1])
            holder = plant.model.body("gimbal_holder").id
            moving.append(abs(plant.data.subtree_angmom[holder][1]))
    # nothing outside turns it, but for air on the slow swing
    assert max(moving) > 1e-4
    assert np.abs(momentum).max() < 0.01 * max(moving)


@pytest.mark.parametrize("gimbal", ["linkage", "transfer-function"])
def test_a_gimbal_that_moves_itself_refuses_to_follow(gimbal):
    with pytest.raises(TwinError, match=f"{gimbal!r} cannot follow"):
        reached(gimbal, lambda plant: plant.follow(ANGLE))


def test_hysteresis_of_a_slow_triangle_is_that_of_friction_and_damping_over_the_servos_gain():
    """Without play and dead band: 2 r/kp · (T_servo + r T_axis + (k_d + b) ω), r = 8 mm/20.5 mm.

    Figures of `mjcf/mechanism.xml`, typed off: 6 and 1 mN·m of friction, 1.8 N·m/rad, 0.0267 N·m·s.
    """
    amplitude, period, tick, r = radians(4.0), 4.0, 4e-3, 8.0 / 20.5
    overrides = {"gimbal_backlash": 0.0, "gimbal_servo_dead_band": 0.0}
    with native.installed():
        plant = Plant(load(ModelConfig(scene="bench", overrides=overrides)))
        t = np.arange(0.0, 1.25 * period, tick)
        command = amplitude * np.interp(t / period % 1, [0, 0.25, 0.75, 1], [0, 1, -1, 0])
        angle = np.empty(len(t))
        for k, u in enumerate(command.tolist()):
            plant.drive((u, 0.0))
            plant.advance(4)
            angle[k] = plant.gimbal_angle[0]
    down, up = (
        np.polyfit(command[when], angle[when], 1)[1]
        for when in ((t > 1.2) & (t < 2.8), (t > 3.2) & (t < 4.8))
    )
    speed = 4 * amplitude / period / r
    width = 2 * r / 1.8 * (6e-3 + r * 1e-3 + (0.02244 + 0.0043) * speed)
    # MuJoCo's friction gives way a little, and the ratio changes by 2 % over the travel
    assert down - up == pytest.approx(width, rel=0.04)
