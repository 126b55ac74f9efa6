"""Figures of a flight in the terms of rocketry, against closed forms and the recording."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from analysis.recording import read
from twin.config import Fly
from twin.errors import TwinError
from twin.experiments.flight.fly import fly
from twin.experiments.flight.rocketry import _turn_radius, figures, notes
from twin.experiments.flight.track import TIME, VELOCITY, WIDTH, Track
from twin.experiments.flight.wind import wind_text
from twin.physics.aerodynamics import density, speed_of_sound
from twin.plant.model.model import ModelConfig, load

G = 9.80665


@pytest.fixture(scope="module")
def flight(tmp_path_factory):
    """A whole flight on the identified model, and its recording."""
    result = fly(Fly(gimbal="transfer-function", out=tmp_path_factory.mktemp("t") / "fly.rrd"))
    return result, read(result.recording)


def test_a_thrown_point_has_the_figures_of_the_parabola():
    """Straight up at 40 m/s in a vacuum from a stand: apogee v²/2g at v/g, impact as launched."""
    model = load(ModelConfig(overrides={"air_enabled": 0, "ramp_length": 0})).mj
    twin = SimpleNamespace(gimbal="fixed")
    views = {"vehicle/airspeed": np.zeros(1), "vehicle/angle_of_attack": np.full(1, np.nan)}
    plant = SimpleNamespace(
        model=model, twin=twin, signals=views, position=np.zeros(3), velocity=np.zeros(3), time_ns=0
    )
    track = Track(plant, np.zeros(2), np.zeros(2))
    start, dt = model.qpos0[:3].copy(), 0.004
    steps = round(2 * 40 / G / dt)
    for k in range(steps + 1):
        t = k * dt
        plant.position[:] = start + np.array([3 * t, 4 * t, 40 * t - G / 2 * t * t])
        plant.velocity[:] = 3, 4, 40 - G * t
        plant.time_ns = round(t * 1e9)
        if k < steps:
            track.watch(plant.time_ns)
    got = figures(track, 1.0, landed=True)
    assert got.apogee_m == pytest.approx(40**2 / 2 / G, abs=G / 2 * dt**2)  # sampled every dt
    assert got.apogee_s == pytest.approx(40 / G, abs=dt)
    assert got.max_ascent_speed_m_s == pytest.approx(math.hypot(5, 40))
    assert got.max_acceleration_m_s2 == pytest.approx(G, rel=1e-6)
    assert got.burnout_height_m == pytest.approx(40 - G / 2)
    assert got.burnout_speed_m_s == pytest.approx(math.hypot(5, 40 - G), abs=1e-3)
    assert got.downrange_m == pytest.approx(5 * steps * dt)
    assert got.impact_speed_m_s == pytest.approx(
        math.hypot(5, 40), abs=2 * G * dt
    )  # one tick before it
    assert (got.rail_exit_s, got.gimbal_saturation) == (None, None)


def test_a_parachute_that_opens_past_the_top_is_no_acceleration_of_the_ascent():
    model = load(ModelConfig(overrides={"air_enabled": 0, "ramp_length": 0})).mj
    plant = SimpleNamespace(
        model=model, twin=SimpleNamespace(gimbal="fixed"), time_ns=0,
        signals={"vehicle/airspeed": np.zeros(1), "vehicle/angle_of_attack": np.full(1, np.nan)},
        position=model.qpos0[:3].copy(), velocity=np.zeros(3),
    )  # fmt: skip
    track = Track(plant, np.zeros(2), np.zeros(2))
    rise = [(0.0, 0.10, 30.0), (0.1, 0.05, 30.0), (0.16, -0.01, 20.0), (0.1, -0.1, 10.0)]
    for k, (height, up, along) in enumerate(rise):
        plant.position[2] = model.qpos0[2] + height
        plant.velocity[:] = along, 0, up
        plant.time_ns = round(k * 4e6)
        track.watch(plant.time_ns)
    assert figures(track, 1.0, landed=True).max_acceleration_m_s2 == pytest.approx(0.05 / 0.004)
    assert notes(track, landed=True)[0].startswith("reached the ground 0.01 s after time zero")


@pytest.mark.parametrize(("speed", "told"), [(20.0, ()), (10.0, ("angle of attack 27° off",))])
def test_a_launch_that_is_slow_for_its_wind_is_told(speed, told):
    """Level wind of 5 m/s across a path straight up."""
    model = load(ModelConfig()).mj
    attack = math.atan2(5.0, speed)
    plant = SimpleNamespace(
        model=model, time_ns=0, position=model.qpos0[:3].copy(), velocity=np.zeros(3),
        signals={"vehicle/airspeed": np.zeros(1), "vehicle/angle_of_attack": np.full(1, attack)},
    )  # fmt: skip
    track = Track(plant, np.zeros(2), np.zeros(2))
    for k in range(300):
        plant.position[2] = model.qpos0[2] + speed * k * 0.004
        plant.velocity[2], plant.time_ns = speed, k * 4_000_000
        track.watch(plant.time_ns)
    odd = notes(track, landed=False)
    assert all(note.startswith(text) for note, text in zip(odd, told, strict=True))


def test_the_wind_is_said_in_words():
    given = {"wind_speed": 5, "wind_turbulence": 0.2}
    model = load(ModelConfig(overrides=given)).mj
    mean = "5 m/s from the west (270° from north over east)"
    assert wind_text(model) == f"{mean}, gusts 20 % rms of 5 m/s"
    assert wind_text(load(ModelConfig()).mj) == ""
    for name, value, says in (("azimuth", 270, "write 270°"), ("speed", -1, "not be negative")):
        with pytest.raises(TwinError, match=says):
            load(ModelConfig(overrides={f"wind_{name}": value}))


def test_the_turn_radius_of_a_circle_is_its_own():
    """Straight at first, then a quarter of a circle of 80 m at 30 m/s."""
    t = np.arange(0.0, 6.0, 0.004)
    turned = np.clip(t - 1.5, 0.0, None) * 30 / 80
    flown = np.zeros((len(t), WIDTH))
    flown[:, TIME] = t
    flown[:, VELOCITY] = 30 * np.stack([np.sin(turned), 0 * t, np.cos(turned)], axis=1)
    assert _turn_radius(flown) == pytest.approx(80, rel=1e-4)
    assert _turn_radius(flown[:50]) is None  # shorter than one look


def test_figures_are_those_of_the_recording(flight):
    result, recording = flight
    got, position, velocity = (
        result.figures, recording["vehicle/position"], recording["vehicle/velocity"],
    )  # fmt: skip
    time, height = position.time, position.values[:, 2] - position.values[0, 2]
    speed = np.linalg.norm(velocity.values, axis=1)
    top = int(height.argmax())
    assert (got.apogee_m, got.apogee_s) == pytest.approx((height[top], time[top]), rel=1e-6)
    assert got.max_ascent_speed_m_s == pytest.approx(speed[:top].max(), rel=1e-6)
    away = np.linalg.norm(position.values - position.values[0], axis=1)
    left = np.interp(2.0, away[:200], time[:200])
    assert got.rail_exit_s == pytest.approx(left, abs=1e-3)
    assert got.rail_exit_speed_m_s == pytest.approx(np.interp(left, time, speed), rel=1e-3)
    q = 0.5 * 1.225 * recording["vehicle/airspeed"].values[: top + 1].ravel() ** 2
    assert 0.9 * q.max() < got.max_dynamic_pressure_pa < q.max()  # the air is thinner up there
    assert got.impact_speed_m_s == pytest.approx(speed[-1], rel=1e-6)
    command = np.abs(recording["gimbal/command"].values[time <= 15.43])
    limit = math.radians(8.0) - 1e-5
    share = float((command >= limit).any(axis=1).mean())
    assert got.gimbal_saturation == pytest.approx(share, abs=2e-3)
    margin = 1 - np.sort(command.max(axis=1))[int(0.95 * len(command))] / limit
    assert got.control_margin == pytest.approx(margin, abs=2e-3)


def test_the_rows_name_what_a_rocketeer_asks_for(flight):
    text = flight[0].text()
    for word in ("off the rail", "burnout", "apogee", "Mach", "dynamic pressure", "angle of attack",
                 "gimbal at limit", "downrange", "impact", "static margin"):  # fmt: skip
        assert word in text


def test_processor_time_is_no_more_than_the_time_of_one_thread(flight):
    result, _ = flight
    assert 0.0 < result.physics_s < result.cpu_s


def test_mach_number_one_is_that_of_the_standard_atmosphere():
    """ICAO Doc 7488/3: 340.294 m/s at sea level, 299.532 at 10 km, 295.069 above 11 km."""
    assert speed_of_sound(0.0) == pytest.approx(340.294, abs=1e-3)
    assert speed_of_sound(10_000.0) == pytest.approx(299.532, abs=1e-3)
    assert speed_of_sound(15_000.0) == pytest.approx(295.069, abs=1e-3)
    assert density(0.0) == pytest.approx(1.225)


@pytest.mark.parametrize("gimbal", ["transfer-function", "follow"])
def test_a_vehicle_weighs_the_same_whatever_moves_its_gimbal(gimbal):
    masses = []
    for seat in ("linkage", gimbal):
        model = load(ModelConfig(gimbal=seat)).mj
        masses.append(float(model.body_subtreemass[model.body("vehicle").id]))
    assert masses[1] == pytest.approx(masses[0], rel=1e-12)
