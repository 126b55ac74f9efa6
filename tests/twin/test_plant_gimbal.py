"""Commands to the gimbal of a plant: by name, through the linkage, or followed."""

import json
from math import radians

import numpy as np
import pytest

from twin.errors import TwinError
from twin.physics import native
from twin.plant.model import REFERENCE_GIMBAL, ModelConfig, load
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


def test_joints_that_follow_take_the_measured_angle_exactly():
    state = reached("follow", lambda plant: plant.follow(ANGLE))
    np.testing.assert_allclose(state.angle, ANGLE, atol=radians(0.005))
    np.testing.assert_allclose(state.rate, 0.0, atol=radians(0.01))


@pytest.mark.parametrize("gimbal", ["linkage", "transfer-function"])
def test_a_gimbal_that_moves_itself_refuses_to_follow(gimbal):
    with pytest.raises(TwinError, match=f"{gimbal!r} cannot follow"):
        reached(gimbal, lambda plant: plant.follow(ANGLE))
