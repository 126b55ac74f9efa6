"""A vertical flight against its equation of motion, integrated here."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from twin.physics import native
from twin.plant.model.model import ModelConfig, load
from twin.plant.plant import Plant

LAUNCHED, FLOWN, TICK = 2000.0, 8.0, 4e-3  # m above the sea, s
G, SEA, TEMPERATURE, LAPSE, GAS = 9.80665, 1.225, 288.15, 0.0065, 287.05287  # ICAO Doc 7488


def climbed(model, mass: float, station: float) -> np.ndarray:
    """Height above the start and speed after `FLOWN`, upright: m v' = F(t) − ½ρ(h) A C v² − m g.

    The propellant goes with the impulse; density by the barometric formula. `station` of the centre
    of mass, where the air is taken from [m].
    """
    n = {
        name: model.numeric(name).data.copy()
        for name in ("motor_time", "motor_thrust", "air_axial_drag", "air_reference_area")
    }
    fuel = float(model.numeric("motor_propellant_mass").data[0])
    time, thrust = n["motor_time"], n["motor_thrust"]
    spent = np.concatenate([[0.0], np.cumsum(np.diff(time) * (thrust[1:] + thrust[:-1]) / 2)])
    half = 0.5 * n["air_reference_area"][0] * n["air_axial_drag"][0]

    def slope(t, state):
        h, v = state
        k = min(int(np.searchsorted(time, t, "right")) - 1, len(time) - 2)
        force = float(np.interp(t, time, thrust))
        burnt = (spent[k] + (t - time[k]) * (thrust[k] + force) / 2) / spent[-1]
        ratio = 1 - LAPSE * (LAUNCHED + station + h) / TEMPERATURE
        density = SEA * ratio ** (G / (LAPSE * GAS) - 1)
        push = (force - half * density * v * abs(v)) / (mass - fuel * burnt) - G
        return [v, max(push, 0.0) if h <= 0 and v <= 0 else push]

    got = solve_ivp(slope, (0.0, FLOWN), [0.0, 0.0], max_step=0.02, rtol=1e-8, atol=1e-8)
    return got.y[:, -1]


def flown(drag: float) -> tuple[np.ndarray, np.ndarray]:
    """Height and speed by the equation of motion, and those of the twin."""
    overrides = {"ramp_elevation": math.pi / 2, "air_altitude": LAUNCHED, "air_enabled": drag}
    with native.installed():
        plant = Plant(load(ModelConfig(gimbal="follow", overrides=overrides)))
        model, data, start = plant.model, plant.data, plant.position[2]
        vehicle = model.body("vehicle").id
        mass = float(model.body_subtreemass[vehicle])
        station = float(data.subtree_com[vehicle][2])
        model.numeric("air_axial_drag").data[0] *= drag
        for _ in range(round(FLOWN / TICK)):
            data.qpos[:2], data.qpos[3:7] = 0.0, (1.0, 0.0, 0.0, 0.0)  # a bead on a wire
            data.qvel[:2] = data.qvel[3:6] = 0.0
            plant.advance(round(TICK / model.opt.timestep))
        truth = climbed(model, mass, station)
    return truth, np.array([plant.position[2] - start, plant.velocity[2]])


@pytest.mark.parametrize("drag", [1.0, 0.0])
def test_height_and_speed_of_a_vertical_flight_are_those_of_its_equation_of_motion(drag):
    """With the shipped drag, which takes 5 % of the height, and without any."""
    truth, ours = flown(drag)
    # off by 3e-5 and 6e-5: mass leaves in ticks of 4 ms, and the rail gives way by millimetres
    assert ours == pytest.approx(truth, rel=2e-4)
    assert truth[0] > 200.0
