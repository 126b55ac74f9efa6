"""Wind and temperature over height: columns of air in closed form, and what the vehicle feels."""

import math
from pathlib import Path

import mujoco
import numpy as np
import pytest
from scipy.special import gamma, kv

from tests.twin.physics.test_air import described, forces
from twin.config import Fly
from twin.errors import TwinError
from twin.experiments.flight.fly import fly
from twin.physics.aerodynamics import density, gust_modes, profile_at
from twin.physics.aerodynamics.atmosphere import DENSITY, EAST, NORTH, TEMPERATURE
from twin.physics.vehicle.sounding import read_sounding
from twin.plant.authority import steer_to
from twin.plant.flow import Flow
from twin.plant.model.model import ModelConfig, load

G, R = 9.80665, 287.05287
WIND = "height,speed,from\n0,4,270\n100,8,270\n1000,12,180\n"


def levels(tmp_path: Path, text: str, altitude: float = 0.0) -> np.ndarray:
    (tmp_path / "air.csv").write_text(text)
    return read_sounding(tmp_path / "air.csv", altitude)


def test_wind_is_that_of_its_levels_and_blows_from_where_it_is_said_to_come(tmp_path):
    profile = levels(tmp_path, WIND)
    east, north = (np.array([profile_at(profile, c, h) for h in (0, 50, 100, 1000, 5000)])
                   for c in (EAST, NORTH))  # fmt: skip
    assert east == pytest.approx([4, 6, 8, 0, 0], abs=1e-9)  # from the west: to the east
    assert north == pytest.approx([0, 0, 0, 12, 12], abs=1e-9)  # from the south: to the north


def test_a_standard_temperature_gives_the_standard_density(tmp_path):
    """ICAO at 400 m: 15 °C less 6.5 K/km; heights geometric within 1e-4 of geopotential ones."""
    rows = "".join(f"{h},0,0,{15 - 0.0065 * (h + 400)}\n" for h in (0, 800, 3000))
    profile = levels(tmp_path, rows, 400.0)
    for height in (0.0, 333.0, 2000.0):
        assert profile_at(profile, DENSITY, height) == pytest.approx(
            density(height + 400), rel=2e-4
        )


def test_isothermal_air_thins_exponentially(tmp_path):
    profile = levels(tmp_path, "0,0,0,30\n4000,0,0,30\n")
    kelvin = 303.15
    for height in (0.0, 1234.0, 4000.0):
        exact = 101325 / (R * kelvin) * math.exp(-G * height / (R * kelvin))
        assert profile_at(profile, DENSITY, height) == pytest.approx(exact, rel=1e-5)
        assert profile_at(profile, TEMPERATURE, height) == pytest.approx(kelvin)


def test_a_vehicle_at_rest_feels_the_wind_of_its_height(tmp_path):
    """Side force of a wind v equals that of a vehicle which moves at -v in still air."""
    (tmp_path / "air.csv").write_text("0,5,270\n1000,15,270\n")
    quiet = load(ModelConfig(vehicle=described(tmp_path), overrides={"ramp_length": 0.0})).mj
    file = described(tmp_path)
    file.write_text(file.read_text().replace("launch = {", 'launch = { profile = "air.csv",'))
    windy = load(ModelConfig(vehicle=file, overrides={"ramp_length": 0.0})).mj
    for height in (10.0, 500.0):
        data = mujoco.MjData(windy)
        station = mujoco.mj_forward(windy, data) or data.subtree_com[windy.body("vehicle").id, 2]
        speed = 5 + (height + station - data.qpos[2]) / 100
        felt = forces(windy, time=60.0, height=height)
        moving = forces(quiet, velocity=(-speed, 0, 0), time=60.0, height=height)
        assert felt[:5] == pytest.approx(moving[:5], rel=2e-4, abs=1e-6)


def test_guidance_and_recording_have_the_wind_of_the_profile(tmp_path):
    (tmp_path / "air.csv").write_text("0,5,270\n1000,15,270\n")
    file = described(tmp_path)
    file.write_text(file.read_text().replace("launch = {", 'launch = { profile = "air.csv",'))
    model = load(ModelConfig(vehicle=file)).mj
    known = steer_to(model, (0.0, 30.0, 500.0))
    assert np.interp(250, known.wind_height, known.wind_east) == pytest.approx(7.5)
    position, still = np.array([0.0, 0, 500]), np.zeros(3)
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    data.xipos[:] = position
    flow = Flow(model, data, position, still, np.array([1.0, 0, 0, 0]), still)
    flow.derive(0)
    assert flow.signals["vehicle/airspeed"][0] == pytest.approx(10.0, rel=1e-3)


def test_a_flight_above_its_profile_is_refused_with_both_heights(tmp_path):
    (tmp_path / "air.csv").write_text("0,0,0,20\n30,0,0,20\n")
    file = described(tmp_path)
    file.write_text(file.read_text().replace("launch = {", 'launch = { profile = "air.csv",'))
    with pytest.raises(TwinError, match="ends at 30 m above the ground and the flight reached"):
        fly(Fly(vehicle=file, programme="hold", duration_s=2.0, out=tmp_path / "f.rrd"))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("0,1,0\n", "has 1 rows of numbers; must have 2"),
        ("0,1,0\n0,2,0\n", "line 2: height 0 m must be above 0 m"),
        ("0,1,0\n9,-2,0\n", "line 2: column 2 = -2; must be 0 to 150"),
        ("0,1,0,15\n9,2,0\n", "line 2: must have 4 columns as before"),
        ("0,1,0\n9,x,0\n", "line 2: must be height above ground"),
        ("0,1,0,15\n9,1,0,300\n", "line 2: column 4 = 300; must be -120 to 60"),
    ],
)
def test_profiles_that_cannot_be_are_refused(tmp_path, text, message):
    with pytest.raises(TwinError) as refused:
        levels(tmp_path, text)
    assert message in str(refused.value)


def test_a_profile_whose_levels_do_not_ascend_is_refused(tmp_path):
    file = described(tmp_path)
    (tmp_path / "air.csv").write_text(WIND)
    file.write_text(file.read_text().replace("launch = {", 'launch = { profile = "air.csv",'))
    with pytest.raises(TwinError, match="heights must ascend"):
        load(ModelConfig(vehicle=file, overrides={"air_profile[0]": 1e6}))


def karman(x: float) -> float:
    """Longitudinal correlation of von Kármán's turbulence at x = r / (1.339 L): ESDU 74031."""
    return 2 ** (2 / 3) / gamma(1 / 3) * x ** (1 / 3) * kv(1 / 3, x)


def test_gusts_lose_their_correlation_over_von_karmans_length():
    """The modes lack the smallest eddies, which end within 0.5 L; from there on only the length
    counts. Without the factor 1.339 the ratios are 0.56 and 0.31."""
    length, distances = 100.0, np.array([0.5, 1.0, 1.5])
    sums = np.zeros(3)
    for seed in range(400):
        wave, way = np.split(gust_modes(seed, length, 16).reshape(-1, 7)[:, :6], 2, axis=1)
        phase = wave[..., None] * distances * length
        sums += (way[..., None] ** 2 / 2 * np.cos(phase)).sum(axis=(0, 1))
    exact = [karman(x / 1.339) for x in distances]
    assert sums / sums[0] == pytest.approx(np.divide(exact, exact[0]), abs=0.02)
