"""Drag tables, damping, misalignment, gravity, Dryden gusts and parachutes against closed forms."""

import math
from pathlib import Path

import mujoco
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from twin.config import Fly
from twin.config.vehicle import Vehicle as Settings
from twin.experiments.assembly import make_plant
from twin.experiments.flight.fly import fly
from twin.experiments.vehicle.vehicle import vehicle
from twin.physics import native
from twin.physics.aerodynamics import density, gust, gust_modes, speed_of_sound
from twin.physics.motor import Depletion
from twin.physics.native.recovery import is_open
from twin.physics.vehicle import VehicleError
from twin.physics.vehicle.drag_table import read_drag
from twin.plant.authority import balance
from twin.plant.compiled import compiled
from twin.plant.model.compose import MJCF
from twin.plant.model.model import ModelConfig, load

G = 9.80665
BURNT = {"ramp_length": 0.0, "motor_ignition": -30.0}  # the motor is out at time zero
DRAG = "Mach,off,on\n0,0.5,0.45\n0.5,0.6,0.5\n1.2,1.1,0.9\n"


def described(folder: Path, more: str = "") -> Path:
    """The large rocket with further keys."""
    text = (MJCF / "examples" / "large_rocket.toml").read_text()
    text = text.replace("../motors/", f"{MJCF / 'motors'}/")
    file = folder / "rocket.toml"
    file.write_text(text.replace("drag = 0.5 ", f"{more}\ndrag = 0.5 "))
    return file


def forces(model, velocity=(0.0, 0.0, 0.0), rate=(0.0, 0.0, 0.0), time=0.0, height=0.0):
    """Passive generalised forces (6,) of the upright vehicle: force, torque in its own frame."""
    data = mujoco.MjData(model)
    data.time = time
    data.qpos[:7] = 0.0, 0.0, height, 1.0, 0.0, 0.0, 0.0
    data.qvel[:3], data.qvel[3:6] = velocity, rate
    with native.installed():
        mujoco.mj_forward(model, data)
    return data.qfrc_passive[:6].copy()


def free(**more):
    """The reference vehicle without a rail."""
    return load(ModelConfig(gimbal="follow", overrides={"ramp_length": 0.0, **more})).mj


@pytest.mark.parametrize(("time", "column"), [(60.0, 1), (1.0, 2)], ids=["coasting", "thrusting"])
@pytest.mark.parametrize("speed", [30.0, 250.0, 380.0, 600.0])
def test_axial_drag_follows_its_table_over_the_mach_number(tmp_path, time, column, speed):
    (tmp_path / "drag.csv").write_text(DRAG)
    file = described(tmp_path, 'drag_table = "drag.csv"')
    model = load(ModelConfig(vehicle=file, overrides={"ramp_length": 0.0})).mj
    table = np.array([row.split(",") for row in DRAG.splitlines()[1:]], float)
    area = float(model.numeric("air_reference_area").data[0])
    for height in (10.0, 5000.0):
        got = forces(model, (0.0, 0.0, speed), time=time, height=height)[2]
        still = forces(model, time=time, height=height)[2]
        station = balance(model)[1]
        wanted = np.interp(speed / speed_of_sound(height + station), table[:, 0], table[:, column])
        q = 0.5 * density(height + station) * speed**2
        assert (still - got) / (q * area) == pytest.approx(wanted, rel=1e-6)


def test_the_table_is_named_where_a_vehicle_is_shown(tmp_path):
    (tmp_path / "drag.csv").write_text(DRAG)
    shown = vehicle(Settings("show", described(tmp_path, 'drag_table = "drag.csv"')))
    assert "drag.csv takes its place: 0.5 to 1.1 with the motor off, Mach 0 to 1.2" in shown.text()


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("0,0.5\n0.5,0.6\n0.4,0.7\n", r"line 3: Mach 0\.4 must be above 0\.5"),
        ("0,0.5\n1,x\n", "line 2: must be Mach"),
        ("0,0.5\n1,0.6,0.7\n", "line 2: must have 2 columns"),
        ("0,0.5\n", "has 1 rows"),
        ("0,0.5\n1,-0.6\n", "line 2: column 2 = -0.6; must be 0 to 10"),
    ],
)
def test_a_drag_table_that_cannot_be_is_refused(tmp_path, text, message):
    (tmp_path / "drag.csv").write_text(text)
    with pytest.raises(VehicleError, match=message):
        read_drag(tmp_path / "drag.csv")


def test_pitch_damping_adds_a_moment_in_proportion_to_rate_and_speed():
    plain, damped = free(), free(air_pitch_damping=2e-5)
    rate, speed = 1.5, 40.0
    got = [forces(m, (0.0, 0.0, speed), (rate, 0.0, 0.0), time=60.0)[3] for m in (plain, damped)]
    station = balance(plain)[1]
    wanted = -0.5 * density(station) * 2e-5 * speed * rate
    assert got[1] - got[0] == pytest.approx(wanted, rel=2e-3)  # the burnt motor moves the station


def test_a_misaligned_thrust_turns_the_vehicle():
    """About +x the thrust tilts to -y at the nozzle: torque about the pivot is r × F."""
    plain, askew = free(), free(**{"motor_misalignment[0]": 0.01, "motor_misalignment[1]": -0.02})
    a, b = 0.01, -0.02
    difference = forces(askew, time=1.0) - forces(plain, time=1.0)
    thrust = np.interp(1.0, plain.numeric("motor_time").data, plain.numeric("motor_thrust").data)
    tilted = thrust * np.array([math.sin(b) * math.cos(a), -math.sin(a), math.cos(b) * math.cos(a)])
    assert difference[:3] == pytest.approx(tilted - [0.0, 0.0, thrust], abs=1e-3 * thrust)
    nozzle = np.array([0.0, 0.0, -0.1774])
    assert difference[3:6] == pytest.approx(np.cross(nozzle, tilted), abs=1e-3 * thrust * 0.18)


def test_a_swirling_jet_spins_the_vehicle_by_its_impulse_over_the_falling_inertia():
    """I dω/dt = swirl · F, I linear in the impulse spent: ω = swirl J ln(I₀/I₁) / (I₀ - I₁)."""
    swirl = 1e-4
    vacuum = {"air_enabled": 0, "ramp_length": 0, "motor_burn": 1, "motor_swirl": swirl}
    config = Fly(vehicle=MJCF / "examples" / "large_rocket.toml", set=tuple(vacuum.items()))
    with compiled():
        plant = make_plant(config)
        before = balance(plant.model)[3]
        plant.advance(round(6.0e9 / plant.dt_ns))
        after = balance(plant.model)[3]
    spin = swirl * float(plant.model.numeric("motor_impulse").data[0])
    spin *= math.log(before / after) / (before - after)
    assert before / after > 1.02
    assert plant.rate[2] == pytest.approx(spin, rel=1e-4)
    assert plant.rate[:2] == pytest.approx(0.0, abs=1e-9)


def test_gravity_falls_with_the_square_of_the_distance_from_the_centre_of_the_earth():
    radius, height = 6356766.0, 20_000.0
    model = free(gravity_radius=radius, air_enabled=0.0)
    mass, station, _, _ = balance(model)
    lift = forces(model, time=60.0, height=height)[2]
    assert G - lift / mass == pytest.approx(
        G * (radius / (radius + height + station)) ** 2, rel=1e-6
    )


def dryden_deviations():
    """Deviations of the gusts' spectra from Dryden's at 50 wave numbers, over their standard error.

    MIL-F-8785C 3.7.1: 2L/π / (1 + (LΩ)²) along, L/π (1 + 3(LΩ)²) / (1 + (LΩ)²)² across.

    Periodograms of 300 fields through a Hann window; the published spectrum goes through the same
    window.
    """
    length, n, step, fields = 50.0, 512, 4.0, 300
    x = step * np.arange(n)
    window = np.hanning(n)
    spectra = np.zeros((fields, 2, n // 2 + 1))
    for seed in range(fields):
        modes = gust_modes(seed, length, 48, dryden=True).reshape(-1, 7)
        phase = np.outer(modes[:, 0], x) + modes[:, 6:7]
        field = modes[:, 3:5].T @ np.cos(phase)  # u and v along the x axis
        spectra[seed] = np.abs(np.fft.rfft(window * field)) ** 2
    spectra *= step / (np.pi * (window**2).sum())  # one-sided, per radian per metre
    omega = 2 * np.pi * np.fft.rfftfreq(n, step)
    fine = np.linspace(-np.pi / step, np.pi / step, 20 * n + 1)
    kernel = np.abs(np.exp(-1j * np.outer(fine[::1], x)) @ window) ** 2
    kernel /= kernel.sum()
    ratio = []
    for k, published in enumerate(
        (
            lambda w: 2 * length / np.pi / (1 + (length * w) ** 2),
            lambda w: length / np.pi * (1 + 3 * (length * w) ** 2) / (1 + (length * w) ** 2) ** 2,
        )
    ):
        for j in range(2, 27):
            wanted = float(kernel @ published(omega[j] - fine))
            mean, spread = spectra[:, k, j].mean(), spectra[:, k, j].std() / math.sqrt(fields)
            ratio.append((mean - wanted) / spread)
    return np.array(ratio)


def test_spectra_of_the_gusts_are_drydens_within_their_95_percent_band():
    """The band of the mean holds all but 5 % of 2 × 25 wave numbers, here up to 6 of 50."""
    ratio = dryden_deviations()
    assert (np.abs(ratio) > 1.96).sum() <= 6
    assert abs(ratio.mean()) < 1.0  # no bias


def test_dryden_gusts_have_unit_variance():
    values = [gust(gust_modes(s, 30.0, 16, dryden=True), 16, 3.0, 4.0, 5.0) for s in range(600)]
    # standard error of a variance of 600: 6 %
    assert np.var(np.array(values), axis=0) == pytest.approx(np.ones(3), rel=0.2)


@pytest.mark.parametrize(
    ("after", "rise", "height", "delay", "below", "opened"),
    [
        (-0.1, -5.0, 50.0, 0.0, 1e6, False),  # the motor burns
        (1.9, 20.0, 50.0, 2.0, -1.0, False),
        (2.0, 20.0, 50.0, 2.0, -1.0, True),
        (9.0, -5.0, 50.0, -1.0, -1.0, False),
        (9.0, 5.0, 50.0, -1.0, 100.0, False),  # still rising
        (9.0, -5.0, 101.0, -1.0, 100.0, False),
        (9.0, -5.0, 99.0, -1.0, 100.0, True),
    ],
)
def test_a_parachute_opens_after_its_delay_or_below_its_height(
    after, rise, height, delay, below, opened
):
    assert is_open(after, rise, height, delay, below) == opened


def test_a_vehicle_comes_down_at_its_terminal_velocity_and_drifts_with_the_wind(tmp_path):
    """½ρ C A v² = m g of canopy and vehicle (0.5 % of the drag); sideways the wind's."""
    file = described(tmp_path, 'parachutes = [{ diameter = "1.5 m", drag = 0.8 }]')
    even = {"wind_speed": 6.0, "wind_azimuth": 0.6, "wind_exponent": 0.0}
    model = load(ModelConfig(vehicle=file, overrides=BURNT | even | {"ramp_position[2]": 400.0})).mj
    data = mujoco.MjData(model)
    data.qvel[2] = -1.0  # past the apogee
    Depletion(model).update(0.0)
    with native.installed():
        mujoco.mj_step(model, data, 40_000)
    mass, _, _, _ = balance(model)
    area = 0.8 * math.pi / 4 * 1.5**2 + 0.5 * math.pi / 4 * 0.098**2
    wanted = math.sqrt(2 * mass * G / (density(data.qpos[2]) * area))
    assert -data.qvel[2] == pytest.approx(wanted, rel=0.01)
    assert data.qvel[:2] == pytest.approx([6 * math.cos(0.6), 6 * math.sin(0.6)], abs=0.1)


def test_a_body_under_a_drogue_does_not_glide(tmp_path):
    """In still air it drifts less than a point under the drogue's drag alone (by SciPy).

    That is the model of RocketPy and OpenRocket, without any force on the body; its drag here only
    shortens the way. As a rigid wing the body glided 0.4 m to the side for every metre down.
    """
    drogue = 'diameter = "0.4 m", drag = 0.6, position = "0.8 m"'  # where the body lies across
    file = described(tmp_path, f"parachutes = [{{ {drogue} }}]")
    model = load(ModelConfig(vehicle=file, overrides=BURNT | {"ramp_position[2]": 400.0})).mj
    data = mujoco.MjData(model)
    data.qpos[3:7] = math.cos(0.4), 0.0, math.sin(0.4), 0.0
    data.qvel[0], data.qvel[2] = 5.0, -1.0
    start = data.qpos[:3].copy()
    Depletion(model).update(0.0)
    with native.installed():
        mujoco.mj_step(model, data, 15_000)
    mass, _, _, _ = balance(model)

    def fall(_, state):
        v = state[2:]
        drag = 0.5 * density(state[1]) * 0.6 * math.pi / 4 * 0.4**2 * np.linalg.norm(v) * v
        return [*v, *(-drag / mass - [0.0, G])]

    span = (0.0, float(data.time))
    point = solve_ivp(fall, span, [0.0, start[2], 5.0, -1.0], rtol=1e-8).y[:, -1]
    assert start[2] - data.qpos[2] > 150.0
    assert data.qpos[2] > point[1]  # the body brakes too
    assert 0.0 < data.qpos[0] - start[0] < point[0]
    assert abs(data.qvel[0]) < 0.2


def test_a_flight_with_a_parachute_lands_slowly(tmp_path):
    file = described(tmp_path, 'parachutes = [{ diameter = "1.5 m", height = "150 m" }]')
    result = fly(Fly(vehicle=file, set=(("wind_speed", 4.0),), out=tmp_path / "f.rrd"))
    assert result.ended == "reached the ground"
    assert 3.0 < result.figures.impact_speed_m_s < 9.0
    assert result.figures.apogee_m > 1000.0


@pytest.mark.parametrize(
    ("key", "message"),
    [
        ("parachutes = [{ drag = 1 }]", "parachutes\\[0\\]: diameter is missing"),
        ('parachutes = [{ diameter = "1 m", hight = 3 }]', "did you mean height"),
        ('parachutes = [{ diameter = "1 m", position = "9 m" }]', "must lie on the vehicle"),
        ('drag_table = "none.csv"', "cannot read drag table"),
    ],
)
def test_a_parachute_or_table_that_cannot_be_is_refused(tmp_path, key, message):
    with pytest.raises(VehicleError, match=message):
        load(ModelConfig(vehicle=described(tmp_path, key)))
