"""The shipped vehicles: they open, weigh what they say, and fly without a warning."""

from pathlib import Path

import mujoco
import numpy as np
import pytest

from tests.mjcf.barrowman import Fins
from twin.physics import native
from twin.physics.aerodynamics.silhouette import strip_table
from twin.physics.motor import Depletion

MJCF = Path(__file__).resolve().parents[2] / "mjcf"
VEHICLES = ["vehicle.xml", "flight.xml", "examples/large_rocket.xml"]
# file -> fins: count, root, tip, span, sweep, radius; station of their leading edge
FINS = {
    "vehicle.xml": (Fins(4, 0.06, 0.03, 0.0335, 0.03, 0.027), 0.03),
    "examples/large_rocket.xml": (Fins(4, 0.2, 0.1, 0.08, 0.1, 0.049), -0.05),
}


def load(name: str) -> mujoco.MjModel:
    return mujoco.MjModel.from_xml_path(str(MJCF / name))


def balance(model: mujoco.MjModel) -> tuple[float, np.ndarray, np.ndarray]:
    """Mass, centre of mass in the vehicle's frame, inertia about it, from the mass matrix."""
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    body = data.body("vehicle")
    centre = body.xmat.reshape(3, 3).T @ (data.subtree_com[body.id] - body.xpos)
    full = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, full)
    mass = full[0, 0]
    shift = mass * (centre @ centre * np.eye(3) - np.outer(centre, centre))
    return mass, centre, full[3:6, 3:6] - shift


def centre_of_pressure(model: mujoco.MjModel) -> float:
    """Of nose and fins: where the air acts as the angle of attack goes to zero."""
    slopes, stations = (
        np.array([model.numeric(f"air_{part}_{what}").data[0] for part in ("nose", "fin")])
        for what in ("slope", "z")
    )
    return float(slopes @ stations / slopes.sum())


def test_reference_vehicle_has_the_masses_of_the_field_notes() -> None:
    """1.0 kg; centre of mass 0.45 → 0.49 m from the tail; inertia 0.099 → 0.084 and 5e-4 kg m²."""
    model = load("flight.xml")
    tail = model.site("gimbal_nozzle").pos[2]
    mass, centre, inertia = balance(model)
    assert mass == pytest.approx(1.0, abs=0.01)
    assert centre[2] - tail == pytest.approx(0.45, abs=0.003)
    assert np.hypot(*centre[:2]) < 1e-3  # servos are not symmetric
    assert inertia[0, 0] == pytest.approx(0.099, rel=0.02)
    assert inertia[1, 1] == pytest.approx(0.099, rel=0.02)
    assert inertia[2, 2] == pytest.approx(5e-4, rel=0.2)  # the notes round it
    Depletion(model).update(99.0)
    mass, centre, inertia = balance(model)
    assert mass == pytest.approx(0.884, abs=0.01)
    assert centre[2] - tail == pytest.approx(0.49, abs=0.01)  # the notes give two digits
    assert inertia[0, 0] == pytest.approx(0.084, rel=0.02)


def test_reference_vehicle_is_1_m_by_54_mm_around_the_gimbal_pivot() -> None:
    model = load("vehicle.xml")
    assert model.geom("tube").size[0] == 0.027
    nose, tail = 0.8226, model.site("gimbal_nozzle").pos[2]
    assert nose - tail == pytest.approx(1.0, abs=1e-3)
    np.testing.assert_allclose(model.body("gimbal_mount").pos, 0, atol=1e-12)


def test_reference_vehicle_is_stable_by_at_most_one_calibre_as_the_angle_goes_to_zero() -> None:
    """Barrowman's terms alone; what crossflow makes of it: tests/twin/physics/test_stability.py."""
    model = load("flight.xml")
    margins = []
    for t in (0.0, 99.0):
        Depletion(model).update(t)
        margins.append((balance(model)[1][2] - centre_of_pressure(model)) / 0.054)
    assert 0 < margins[0] < margins[1] <= 1.0


def test_large_rocket_is_stable_by_about_two_calibres() -> None:
    model = load("examples/large_rocket.xml")
    margin = (balance(model)[1][2] - centre_of_pressure(model)) / 0.098
    assert 1.5 < margin < 3.0


@pytest.mark.thorough
@pytest.mark.parametrize("name", sorted(FINS))
def test_air_numerics_follow_from_the_geometry(name: str) -> None:
    """To the digits the files state."""
    model, (fins, edge) = load(name), FINS[name]
    assert model.numeric("air_fin_slope").data[0] == pytest.approx(fins.slope(), rel=1e-4)
    assert model.numeric("air_fin_z").data[0] == pytest.approx(edge - fins.behind(), abs=1e-5)
    assert model.numeric("air_roll_damping").data[0] == pytest.approx(fins.roll_damping(), rel=1e-4)
    area = np.pi * fins.radius**2
    assert model.numeric("air_reference_area").data[0] == pytest.approx(area, rel=1e-4)
    z, widths = strip_table(model)
    np.testing.assert_allclose(model.numeric("air_strip_z").data, z, atol=6e-6)  # six digits
    np.testing.assert_allclose(model.numeric("air_strip_area").data, widths, rtol=1e-5)


@pytest.mark.parametrize("name", VEHICLES)
def test_initial_pose_stands_on_the_ramp_as_drawn(name: str) -> None:
    """The pose in the file is the one `bind` computes, so a viewer shows the same."""
    model = load(name)
    drawn = model.qpos0[:7].copy()
    native.bind(model)
    np.testing.assert_allclose(drawn, model.qpos0[:7], atol=1e-5)


@pytest.mark.parametrize("name", VEHICLES)
def test_vehicle_flies_open_loop_without_a_warning(name: str) -> None:
    """25 s, or until it meets the ground: what a crash does to the linkage is no flight."""
    model = load(name)
    native.bind(model)
    depletion, data = Depletion(model), mujoco.MjData(model)
    with native.installed():
        while data.time < 25 and not data.ncon:
            depletion.update(data.time)
            mujoco.mj_step(model, data, 10)
    assert not np.array(data.warning.number).any()
    assert np.isfinite(data.qvel).all()


def test_large_rocket_flies_straight_up_and_comes_down() -> None:
    """Nose within 10° of the velocity while it is fast; apogee near the ballistic estimate."""
    model = load("examples/large_rocket.xml")
    native.bind(model)
    depletion, data = Depletion(model), mujoco.MjData(model)
    top = 0.0
    with native.installed():
        while data.time < 12:
            depletion.update(data.time)
            mujoco.mj_step(model, data, 10)
            velocity = data.qvel[:3]
            speed = np.linalg.norm(velocity)
            if speed > 30:
                nose = data.body("vehicle").xmat.reshape(3, 3)[:, 2]
                assert nose @ velocity > np.cos(np.radians(10)) * speed
            top = max(top, data.qpos[2])
    assert 800 < top < 2000


def test_gimbal_torque_outweighs_the_air_at_small_angles() -> None:
    """8° of gimbal against the air at 6° of attack, where each speed is reached: control keeps."""
    model = load("flight.xml")
    native.bind(model)
    for t, speed in ((2.0, 30.0), (8.0, 60.0), (14.0, 85.0)):
        Depletion(model).update(t)
        data = mujoco.MjData(model)
        data.qpos[:7] = 0, 0, 300, 1, 0, 0, 0
        data.qvel[0] = speed * np.sin(np.radians(6))
        data.qvel[2] = speed * np.cos(np.radians(6))
        data.time = t
        with native.installed():
            mujoco.mj_forward(model, data)
        lever = data.subtree_com[model.body("vehicle").id, 2] - 300
        # about the centre of mass; at zero gimbal the thrust passes within 40 µm of it
        moment = abs(data.qfrc_passive[4] - lever * data.qfrc_passive[0])
        assert moment < 0.75 * 12.0 * np.sin(np.radians(8)) * lever


OPENED = [*MJCF.glob("*.xml"), *MJCF.glob("examples/*.xml")]


@pytest.mark.parametrize("path", sorted(p.relative_to(MJCF.parent) for p in OPENED), ids=str)
def test_every_model_opens_by_a_relative_path(path, monkeypatch):
    monkeypatch.chdir(MJCF.parent)
    assert mujoco.MjModel.from_xml_path(str(path)).nbody > 1
