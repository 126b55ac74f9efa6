"""What a plant and other sources offer, and that all of it reaches the recorder's row."""

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from twin.control import AttitudeController, Hold
from twin.control.attitude import from_vertical
from twin.loop.clock import Ledger
from twin.loop.seats import Pilot
from twin.physics import native
from twin.plant.model.model import ModelConfig, load
from twin.plant.plant import Plant
from twin.recorder.checks import checked
from twin.recorder.rows import Rows
from twin.recorder.sink import places

WIND, AZIMUTH = 6.0, 0.7  # m/s, rad


class Memory:
    """A recorder that keeps its last row."""

    def __init__(self, signals):
        self.slices = places(checked(signals))
        self.row = np.full(max(s.stop for s in self.slices.values()), np.nan)

    def commit(self, time_ns, wall_ns):
        self.committed = self.row.copy()

    def commit_pose(self, time_ns, data):
        pass

    def value(self, name):
        return self.committed[self.slices[name]]


@pytest.fixture
def flying():
    """A vehicle that tumbles at 30 m/s through a steady wind, its motor burning."""
    overrides = {"wind_speed": WIND, "wind_azimuth": AZIMUTH, "wind_exponent": 0.0}
    with native.installed():
        plant = Plant(load(ModelConfig(overrides=overrides | {"wind_turbulence": 0.0})))
        plant.position[:] = 1.0, 2.0, 50.0
        plant.attitude[:] = Rotation.from_euler("xyz", [0.3, -0.5, 1.1]).as_quat(scalar_first=True)
        plant.velocity[:] = 10.0, -5.0, 27.0
        plant.rate[:] = 0.4, -0.7, 2.0
        mujoco.mj_forward(plant.model, plant.data)
        yield plant


def recorded(plant, *sources, time_ns=2_000_000_000):
    rows = Rows(plant, *sources)
    recorder = Memory(rows.signals)
    rows.bind(recorder)
    rows.write(time_ns)
    return recorder


def test_a_signal_that_a_source_offers_is_recorded_without_further_code(flying):
    class Clinometer:
        def __init__(self):
            self.values = np.array([0.25])
            self.signals = {"turntable/simulated": self.values}

    ledger, source = Ledger(), Clinometer()
    ledger.enter(3000)
    row = recorded(flying, source, None, ledger)
    assert row.value("turntable/simulated") == [0.25]
    assert row.value("timing/lateness") == [3e-6]
    np.testing.assert_array_equal(row.value("vehicle/velocity"), [10.0, -5.0, 27.0])


def test_airspeed_and_angle_of_attack_are_those_of_the_centre_of_mass_in_the_wind(flying):
    row = recorded(flying)
    model, data = flying.model, flying.data
    turned = Rotation.from_quat(flying.attitude, scalar_first=True)
    nose = turned.apply([0.0, 0.0, 1.0])
    centre = data.subtree_com[model.body("vehicle").id] - flying.position
    wind = WIND * np.array([np.cos(AZIMUTH), np.sin(AZIMUTH), 0.0])
    lever = np.cross(turned.apply(flying.rate), (centre @ nose) * nose)
    through_air = flying.velocity + lever - wind
    speed = np.linalg.norm(through_air)
    attack = np.arccos(nose @ through_air / speed)
    assert row.value("vehicle/airspeed") == pytest.approx(speed, rel=1e-12)
    assert row.value("vehicle/angle_of_attack") == pytest.approx(attack, rel=1e-9)
    np.testing.assert_allclose(row.value("vehicle/wind"), wind, atol=1e-12)
    turn = Rotation.from_rotvec([*row.value("vehicle/tilt"), 0.0])
    np.testing.assert_allclose(turn.apply([0.0, 0.0, 1.0]), nose, atol=1e-12)


def test_the_tilt_of_a_nose_that_swings_over_the_horizon_has_no_jump():
    """A dive beside the vertical plane: two angles in planes would jump by 180 degrees at once."""
    pitch = np.linspace(-0.2, np.pi - 0.05, 2000)
    noses = np.stack([np.sin(pitch), 0.01 * np.cos(3.0 * pitch), np.cos(pitch)], axis=1)
    tilt = np.array([from_vertical(*nose) for nose in noses])
    step = np.abs(np.diff(tilt, axis=0)).max()
    assert step < 20.0 * (pitch[1] - pitch[0])
    in_planes = np.arctan2(-noses[:, 1], noses[:, 2])
    assert np.abs(np.diff(in_planes)).max() > 0.5  # the counter-test


def test_thrust_is_that_of_the_curve_and_no_setpoint_is_recorded_without_it(flying):
    pilot = Pilot(flying, AttitudeController(), Hold(launch=(0.0, 0.6, 0.8)), 0.004)
    pilot.update(0.0, None)
    time, thrust = (flying.model.numeric(f"motor_{n}").data for n in ("time", "thrust"))
    ignition = flying.model.numeric("motor_ignition").data[0]
    burning = recorded(flying, pilot, time_ns=round((ignition + 2.0) * 1e9))
    assert burning.value("vehicle/thrust") == pytest.approx(np.interp(2.0, time, thrust), rel=1e-9)
    np.testing.assert_allclose(burning.value("control/setpoint"), [np.arctan2(-0.6, 0.8), 0.0])
    np.testing.assert_array_equal(burning.value("control/error"), pilot.error)
    after = recorded(flying, pilot, time_ns=round((ignition + time.max() + 1.0) * 1e9))
    assert after.value("vehicle/thrust") == [0.0]
    assert np.isnan(after.value("control/setpoint")).all()
    assert np.isnan(after.value("control/error")).all()


def test_the_gap_of_the_rod_loops_is_the_distance_of_the_sites_they_join():
    with native.installed():
        apart = {"gimbal_closure_limit": 1.0}
        plant = Plant(load(ModelConfig(scene="bench", overrides=apart)))
        plant.data.qpos[:] += 0.02  # the joints of a loop no longer fit one another
        mujoco.mj_forward(plant.model, plant.data)
        row = recorded(plant)
        for k, axis in enumerate("xy"):
            ends = (f"gimbal_rod_{axis}_end", f"gimbal_holder_{axis}_ball")
            a, b = (plant.data.site(name).xpos for name in ends)
            gap = np.linalg.norm(a - b)
            assert gap > 1e-4
            assert row.value("linkage/closure")[k] == pytest.approx(gap, rel=1e-12)
            shaft = plant.data.joint(f"gimbal_servo_{axis}").qpos[0]
            assert row.value("linkage/servo")[k] == shaft


def test_a_plant_without_vehicle_or_rods_offers_its_gimbal_alone():
    with native.installed():
        plant = Plant(load(ModelConfig(scene="bench", gimbal="transfer-function")))
    assert set(plant.signals) == {"gimbal/simulated", "gimbal/rate/simulated"}
