"""The plant: one consistent instant, time without accumulation, no silent divergence."""

import re

import mujoco
import numpy as np
import pytest

from twin.errors import DivergenceError
from twin.physics import native
from twin.plant.model.compose import MJCF
from twin.plant.model.model import ModelConfig, load
from twin.plant.plant import Plant


@pytest.fixture(scope="module")
def flight():
    with native.installed():
        yield Plant(load(ModelConfig()))


def test_time_is_the_step_count_times_dt_exactly(flight):
    flight.reset()
    for _ in range(10):
        flight.advance(37)
    assert flight.time_ns == 370 * 1_000_000


def test_slow_commands_burn_the_propellant_as_commands_at_250_hz_do():
    def after(parts: list[int]) -> np.ndarray:
        with native.installed():
            plant = Plant(load(ModelConfig()))  # a reset leaves sums of masses with rounding
            for n in parts:
                plant.advance(n)
        return plant.data.qpos.copy()

    np.testing.assert_array_equal(after([2002]), after([4] * 500 + [2]))


def test_advancing_at_once_or_in_parts_ends_in_the_same_state():
    # before ignition: while the motor burns, the propellant's mass is renewed at every call
    with native.installed():
        plant = Plant(load(ModelConfig(overrides={"motor_ignition": 100.0})))

        def after(parts: list[int]) -> np.ndarray:
            plant.reset()
            for n in parts:
                plant.advance(n)
            return plant.data.qpos.copy()

        np.testing.assert_array_equal(after([12]), after([4, 4, 4]))


def test_reset_gives_back_the_propellant(flight):
    flight.reset()
    full = flight.model.body("gimbal_propellant").mass[0]
    for _ in range(50):
        flight.advance(10)
    assert flight.model.body("gimbal_propellant").mass[0] < full
    flight.reset()
    assert flight.model.body("gimbal_propellant").mass[0] == pytest.approx(full, rel=1e-12)


def test_poses_belong_to_the_instant_of_the_state(flight):
    flight.reset()
    flight.advance(1000)
    np.testing.assert_array_equal(flight.data.body("vehicle").xpos, flight.position)


def test_what_is_handed_out_is_a_copy(flight):
    flight.reset()
    before = flight.vehicle()
    flight.advance(100)
    after = flight.vehicle()
    assert not np.array_equal(before.position, after.position)
    after.position[:] = 0.0
    assert flight.position.any()


@pytest.mark.parametrize("speed", [np.nan, np.inf, 1e9])
def test_a_state_that_is_no_number_stops_the_run_and_names_the_joint(flight, speed):
    flight.reset()
    flight.data.qvel[flight.model.joint("gimbal_x").dofadr[0]] = speed
    with pytest.raises(DivergenceError, match=r"diverged at 0\.001"):
        flight.advance(1)
    flight.reset()


@pytest.mark.parametrize("gimbal", ["linkage", "transfer-function"])
def test_a_gimbal_far_past_its_stops_is_divergence_and_names_joint_angle_and_stops(gimbal):
    with native.installed():
        plant = Plant(load(ModelConfig(gimbal=gimbal)))
        plant.data.qpos[plant.model.joint("gimbal_y").qposadr[0]] = np.radians(44.0)
        with pytest.raises(DivergenceError, match=r"'gimbal_y' is at -?\d.*stops at -10° and 10°"):
            plant.advance(1)


def test_angles_that_somebody_measures_may_lie_past_the_stops():
    with native.installed():
        plant = Plant(load(ModelConfig(gimbal="follow")))
        plant.follow((np.radians(20.0), np.radians(20.0)))
        for _ in range(10):
            plant.advance(4)
        assert np.isfinite(plant.gimbal_angle).all()


def touching(folder):
    """The direct-drive mechanism with MuJoCo's default contacts, its parts inside one another."""
    text = (MJCF / "examples" / "direct_drive.xml").read_text()
    path = folder / "mechanism.xml"
    path.write_text(re.sub(r'contype="0" conaffinity="0"', "", text))
    return path


def test_parts_of_the_vehicle_that_touch_are_no_landing_and_the_ground_is_one(tmp_path):
    with native.installed():
        plant = Plant(load(ModelConfig(mechanism=touching(tmp_path))))
        plant.advance(4)
        assert plant.data.ncon > 0
        assert not plant.landed
        plant.position[2] = 0.01
        plant.advance(1)
        assert plant.landed
        assert plant.position[2] > 0.0


def test_warnings_of_mujoco_are_counted_by_name(flight):
    flight.reset()
    assert flight.warnings() == {}
    flight.data.qvel[0] = np.nan
    mujoco.mj_checkVel(flight.model, flight.data)
    assert flight.warnings() == {"badqvel": 1}
    flight.reset()
