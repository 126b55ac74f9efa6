"""Where the air acts and which way it turns the vehicle, with everything that acts in flight."""

import itertools
from pathlib import Path

import mujoco
import numpy as np
import pytest
from scipy.integrate import quad

from tests.benchmarks import margins
from tests.benchmarks.stability import fly
from tests.twin.physics.outlines import REFERENCE
from twin.physics import native
from twin.physics.aerodynamics import stability
from twin.physics.aerodynamics.stability import Stability
from twin.physics.motor import Depletion

ROOT = Path(__file__).resolve().parents[3]
DENSITY = 1.225  # kg/m³, ICAO at sea level
BURNOUT = 15.43  # s
PLANFORM = 0.84  # C_dc of mjcf/parts/airframe.xml
AREA, NOSE, FINS = np.pi * 0.027**2, (2.0, 0.7726), (3.8882, 0.005)


def reference() -> mujoco.MjModel:
    model = mujoco.MjModel.from_xml_path(str(ROOT / "mjcf" / "flight.xml"))
    native.bind(model)
    return model


def flying(model: mujoco.MjModel, angle: float, speed: float = 40.0) -> tuple[float, float, float]:
    """Force across the axis [N], moment about the centre of mass [N m] of the compiled callback.

    And the station of that centre. The vehicle stands upright and moves at an angle of attack in
    its plane xz, motor out, at 1 m above sea level.
    """
    model.numeric("motor_impulse").data[0] = model.numeric("ramp_length").data[0] = 0
    data = mujoco.MjData(model)
    data.qpos[:7] = 0, 0, 1, 1, 0, 0, 0
    data.qvel[0], data.qvel[2] = speed * np.sin(angle), speed * np.cos(angle)
    with native.installed():
        mujoco.mj_forward(model, data)
        force = data.qfrc_passive[:6].copy()
    model.numeric("air_enabled").data[0] = 0
    with native.installed():
        mujoco.mj_forward(model, data)
    force -= data.qfrc_passive[:6]
    model.numeric("air_enabled").data[0] = 1
    station = float(data.subtree_com[model.body("vehicle").id][2] - 1.0)
    return float(force[0]), float(force[4] - station * force[0]), station


def by_hand(angle: float, station: float, speed: float = 40.0) -> tuple[float, float]:
    """The same from Barrowman's two forces and the crossflow integral over the closed outline."""
    q = 0.5 * DENSITY * speed**2
    pairs = list(itertools.pairwise(REFERENCE.corners))
    area, first = (
        sum(
            quad(lambda z, n=n: (z - station) ** n * float(REFERENCE.width(z)), *p)[0]
            for p in pairs
        )
        for n in (0, 1)
    )
    cross = -q * PLANFORM * np.sin(angle) ** 2
    force, moment = cross * area, cross * first
    for slope, z in (NOSE, FINS):
        part = -q * AREA * slope * np.sin(angle) * np.cos(angle)
        force, moment = force + part, moment + (z - station) * part
    return force, moment


@pytest.mark.parametrize("time", [0.0, BURNOUT])
def test_centre_of_pressure_of_the_flying_forces_is_that_of_all_terms_by_hand(time: float) -> None:
    model = reference()
    Depletion(model).update(time)
    tool = Stability(model, time)
    for angle in np.radians([0.5, 2, 5, 10, 20, 40]):
        force, moment, station = flying(model, angle)
        wanted, turning = by_hand(angle, station)
        # density of 1 m up: 1e-4; the strips' own 5e-5
        assert force == pytest.approx(wanted, rel=3e-4)
        centre = station + turning / wanted
        assert station + moment / force == pytest.approx(centre, abs=5e-5)
        assert tool.centre_of_pressure(angle) == pytest.approx(centre, abs=5e-5)


def test_margins_are_the_way_between_the_centres_in_diameters() -> None:
    for margin, time in zip(stability.margins(reference()), (0.0, BURNOUT), strict=True):
        model = reference()
        Depletion(model).update(time)
        _, _, station = flying(model, stability.ROOT)
        wanted, turning = by_hand(stability.ROOT, station)
        # 0.05 mm, as the centre of pressure
        assert margin == pytest.approx(-turning / wanted / (2 * REFERENCE.radius), abs=1e-3)


def test_loaded_vehicle_is_turned_away_beyond_2_5_degrees_and_the_empty_one_rights_itself() -> None:
    """Signs of the flying forces' moment: crossflow acts ahead of the centre of mass.

    The planform's centroid is 49 mm ahead of it, Barrowman's centre of pressure 7 mm behind.
    """
    model = reference()
    assert flying(model, np.radians(2.0))[1] > 0
    assert flying(model, np.radians(3.0))[1] < 0
    assert np.degrees(Stability(model).neutral_angle()) == pytest.approx(2.5, abs=0.1)
    Depletion(model).update(BURNOUT)
    for degrees in (1, 5, 15, 30, 60):
        assert flying(model, np.radians(degrees))[1] > 0


@pytest.mark.thorough
def test_gimbal_outweighs_the_air_by_half_through_every_flight() -> None:
    """Least ratio over the burn: 1.9 in a held flight, at its end, and 4.2 toward a point.

    And what the gimbal could hold at its 8°: an angle of attack of 43° at the worst moment,
    against the 25° that steering asks for.
    """
    for off in (None, (30, 0)):
        seen = fly(off, every=100)  # 0.4 s
        assert min(i.gimbal / i.air for i in seen) > 1.5
        assert np.degrees(min(i.holds for i in seen)) > 40
        assert np.degrees(max(i.angle for i in seen)) < 30


def test_documented_table_is_the_one_the_code_gives() -> None:
    page = (ROOT / "docs" / "aerodynamics.md").read_text()
    assert margins.table(reference(), BURNOUT) in page
