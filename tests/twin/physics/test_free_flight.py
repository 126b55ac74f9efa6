"""Free flight in six degrees of freedom against the same equations, integrated by SciPy.

Newton and Euler about the body's origin with the masses of the instant (Thomson, Introduction to
Space Dynamics, 1961), Coriolis force of the gas, Barrowman's normal forces at local flow, crossflow
strips, ICAO density and the power law of the wind, each written here from docs/aerodynamics.md.
"""

import math

import mujoco
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from tests.twin.physics.test_air import described
from twin.physics import native
from twin.physics.motor import Depletion
from twin.plant.authority import balance
from twin.plant.model.model import ModelConfig, load

G = np.array([0.0, 0.0, -9.80665])
TICK, STEP = 0.004, 0.001  # s
START = np.array([0.0, 0.0, 50.0])
TILT, SPEED = math.radians(8.0), 35.0
RATE = np.array([0.15, -0.1, 0.4])


def rotation(q: np.ndarray) -> np.ndarray:
    w, x, y, z = q / np.linalg.norm(q)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def density(height: float) -> float:
    h = 6356766 * height / (6356766 + height)
    return 1.225 * (1 - 0.0065 * h / 288.15) ** (9.80665 / (0.0065 * 287.05287) - 1)


class Truth:
    """Slope of (position, velocity, quaternion, rate) of the body's origin."""

    def __init__(self, model: mujoco.MjModel) -> None:
        value = {model.numeric(k).name: model.numeric(k).data.copy() for k in range(model.nnumeric)}
        self.value = value
        self.times = np.arange(0.0, float(value["motor_time"].max()) + 0.1, 0.02)
        depletion, self.mass = Depletion(model), []
        for t in self.times:
            depletion.update(float(t))
            self.mass.append(balance(model))
        self.mass = np.transpose(self.mass)
        depletion.update(0.0)
        data = mujoco.MjData(model)
        data.qpos[:7] = 0, 0, 0, 1, 0, 0, 0
        mujoco.mj_kinematics(model, data)
        self.nozzle = data.site("gimbal_nozzle").xpos[2]
        self.grain = data.xipos[model.body("gimbal_propellant").id, 2]
        assert value["motor_burn"][0] == 0  # of a core burner the centre stays

    def loads(self, t: float, height: float, air: np.ndarray, w: np.ndarray, zc: float):
        """Force and moment about the centre of mass, body frame, but gravity."""
        v, c = self.value, np.zeros(2)
        rho = density(height + v["air_altitude"][0])
        force, moment = np.zeros(3), np.zeros(3)
        q = 0.5 * rho * v["air_reference_area"][0]
        for z, slope, axial in (
            (v["air_strip_z"], None, 0.0),
            (v["air_nose_z"], v["air_nose_slope"], max(air[2], 0.0)),
            (v["air_fin_z"], v["air_fin_slope"], abs(air[2])),
        ):
            r = z - zc
            across = np.array([air[0] + w[1] * r, air[1] - w[0] * r])
            if slope is None:
                size = 0.5 * rho * v["air_crossflow_drag"][0] * v["air_strip_area"]
                c = -size * np.hypot(*across) * across
            else:
                c = -q * slope * axial * across
            force[:2] += c.sum(axis=1)
            moment[:2] += (-r * c[1]).sum(), (r * c[0]).sum()
        force[2] -= q * v["air_axial_drag"][0] * abs(air[2]) * air[2]
        moment[2] -= 0.5 * rho * v["air_roll_damping"][0] * abs(air[2]) * w[2]
        thrust = np.interp(t, v["motor_time"], v["motor_thrust"], right=0.0)
        flow = thrust * v["motor_propellant_mass"][0] / v["motor_impulse"][0]
        way = np.array([0, 0, self.nozzle - self.grain])
        gas = -2 * flow * np.cross(w, way)
        at = np.array([0, 0, (self.nozzle + self.grain) / 2 - zc])
        along = flow * v["motor_grain_length"][0] ** 2 / 12 * np.array([w[0], w[1], 0])
        return force + gas + (0, 0, thrust), moment + np.cross(at, gas) + along

    def __call__(self, t: float, y: np.ndarray) -> np.ndarray:
        place, velocity, q, w = y[:3], y[3:6], y[6:10], y[10:]
        R = rotation(q)
        m, zc, across, axial = (np.interp(t, self.times, c) for c in self.mass)
        c = np.array([0, 0, zc])
        height = place[2] + (R @ c)[2]
        speed = self.value["wind_speed"][0] * (height / 10) ** self.value["wind_exponent"][0]
        air = R.T @ (velocity - (speed, 0, 0)) + np.cross(w, c)
        force, moment = self.loads(t, height, air, w, zc)
        # about the centre of mass, which moves with the propellant as the twin's does
        inertia = np.array([across, across, axial])
        turn = (moment - np.cross(w, inertia * w)) / inertia
        centre = R @ (force / m) + G
        origin = centre - R @ (np.cross(turn, c) + np.cross(w, np.cross(w, c)))
        a, b = q[0], q[1:]
        spin = 0.5 * np.concatenate([[-b @ w], a * w + np.cross(b, w)])
        return np.concatenate([velocity, origin, spin, turn])


def apogees(folder, wind: float):
    """Time and place of the apogee by SciPy, and time and place of the twin's."""
    overrides = {"ramp_length": 0.0, "wind_speed": wind}
    model = load(ModelConfig(vehicle=described(folder), overrides=overrides)).mj
    q = np.array([math.cos(TILT / 2), 0, math.sin(TILT / 2), 0])
    y0 = np.concatenate([START, SPEED * rotation(q)[:, 2], q, RATE])
    top = lambda _, y: y[5]  # noqa: E731
    top.terminal, top.direction = True, -1
    truth = solve_ivp(Truth(model), (0, 60), y0, rtol=1e-6, atol=1e-8, max_step=0.1, events=top)

    data, depletion = mujoco.MjData(model), Depletion(model)
    data.qpos[:7], data.qvel[:6] = y0[[0, 1, 2, 6, 7, 8, 9]], y0[[3, 4, 5, 10, 11, 12]]
    model.opt.timestep = STEP
    with native.installed():
        while data.qvel[2] > 0:
            depletion.update(data.time)
            mujoco.mj_step(model, data, round(TICK / STEP))
    return truth.t[-1], truth.y[:3, -1], data.time, data.qpos[:3].copy()


@pytest.mark.thorough
@pytest.mark.parametrize("wind", [0.0, 7.0])
def test_the_apogee_is_that_of_an_independent_integration_within_2e_4(tmp_path, wind):
    time, place, ours, at = apogees(tmp_path, wind)
    assert place[2] == pytest.approx(at[2], rel=2e-4)
    assert time == pytest.approx(ours, rel=1e-3)
    assert place[:2] == pytest.approx(at[:2], abs=0.005 * at[2])
