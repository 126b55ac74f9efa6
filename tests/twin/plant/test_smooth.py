"""Whole control periods as steps of a vehicle without moving parts."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from twin.config import Fly
from twin.experiments.assembly import make_plant
from twin.plant.compiled import compiled
from twin.plant.model.compose import MJCF
from twin.plant.plant import Plant
from twin.plant.steps import smooth

ROCKET = MJCF / "examples" / "large_rocket.toml"
PASSIVE = Fly(vehicle=ROCKET, control_hz=50.0)
ELASTIC = (("ramp_stiffness", 15000.0),)
END = 20.0  # s; past the apogee


def flown(config: Fly, fine: float = 1.0, spin: float = 0.0, end: float = END) -> np.ndarray:
    """Position and attitude every 0.2 s, (n, 7).

    `fine` is the share of the usual way [m] that a step may take while the rail releases a lug; a
    vehicle with a `spin` [rad/s] also starts at 30 m/s and turns at 0.3 rad/s.
    """
    with compiled():
        plant = make_plant(config)
        plant._division = plant._division._replace(fine=fine * plant._division.fine)
        if spin:
            plant.rate[:] = 0.3, 0.0, spin
            plant.velocity[:] = 30.0 * plant.data.xmat[plant.model.body("vehicle").id][2::3]
        per = round(0.2 / (plant.dt_ns * 1e-9))
        rows = []
        for _ in range(round(end / 0.2)):
            plant.advance(per)
            rows.append([*plant.position, *plant.attitude])
    return np.array(rows)


def apart(one: np.ndarray, other: np.ndarray) -> tuple[float, float, float]:
    """Difference of apogee and of range over the true ones, and of attitude [deg], the largest."""
    height = abs(one[:, 2].max() / other[:, 2].max() - 1.0)
    ranges = np.hypot(one[-1, 0], one[-1, 1]) / np.hypot(other[-1, 0], other[-1, 1])
    cosine = np.clip(np.abs((one[:, 3:] * other[:, 3:]).sum(axis=1)), 0.0, 1.0)
    return height, abs(ranges - 1.0), float(np.degrees(2.0 * np.arccos(cosine)).max())


@pytest.fixture(scope="module")
def converged() -> np.ndarray:
    """Steps of 2 ms, and sixteen times as many where a lug leaves the rail."""
    return flown(replace(PASSIVE, integrator="rk4", dt=0.002), fine=1.0 / 16.0)


@pytest.mark.parametrize("rate", [250.0, 50.0])
def test_a_step_of_a_control_period_is_within_the_limits_of_a_converged_flight(
    converged: np.ndarray, rate: float
) -> None:
    height, range_, angle = apart(flown(replace(PASSIVE, control_hz=rate)), converged)
    assert height < 1e-4
    assert range_ < 1e-4
    assert angle < 0.01


def test_a_spinning_vehicle_keeps_the_limits(monkeypatch: pytest.MonkeyPatch) -> None:
    free = replace(PASSIVE, set=(("ramp_length", 0.0),))
    fast = {"spin": 120.0, "end": 5.0}
    converged = flown(replace(free, integrator="rk4", dt=0.001), **fast)
    height, range_, angle = apart(flown(free, **fast), converged)
    assert height < 1e-4
    assert range_ < 1e-4
    assert angle < 0.01
    monkeypatch.setattr(Plant, "divides", False)
    height, range_, angle = apart(flown(free, **fast), converged)
    assert angle > 1.0


def test_steps_that_are_not_divided_miss_these_limits(
    converged: np.ndarray, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Plant, "divides", False)
    height, range_, angle = apart(flown(PASSIVE), converged)
    assert max(height / 1e-4, range_ / 1e-4, angle / 0.01) > 2.0


@pytest.mark.parametrize(
    ("config", "method", "step_ms"),
    [
        (PASSIVE, mujoco.mjtIntegrator.mjINT_RK4, 20.0),
        (replace(PASSIVE, control_hz=250.0), mujoco.mjtIntegrator.mjINT_RK4, 4.0),
        (replace(PASSIVE, control_hz=1.0), mujoco.mjtIntegrator.mjINT_RK4, 20.0),
        (replace(PASSIVE, dt=0.001), mujoco.mjtIntegrator.mjINT_RK4, 1.0),
        (replace(PASSIVE, integrator="euler"), mujoco.mjtIntegrator.mjINT_EULER, 1.0),
        (replace(PASSIVE, set=ELASTIC), mujoco.mjtIntegrator.mjINT_IMPLICITFAST, 1.0),
    ],
)  # fmt: skip
def test_a_vehicle_without_moving_parts_has_its_method_and_step(
    config: Fly, method: mujoco.mjtIntegrator, step_ms: float
) -> None:
    with compiled():
        plant = make_plant(config)
        plant.advance(1)
    assert plant.dt_ns == round(step_ms * 1e6)
    assert plant.model.opt.integrator == method


def parts(plant: Plant, t: float, end: float) -> list[float]:
    """Lengths of the steps from `t` to `end`."""
    steps = []
    while t < end - 1e-9:
        steps.append(smooth.part(plant._division, t, end))
        t += steps[-1]
    return steps


def test_the_parts_of_a_step_add_up_and_meet_every_corner_of_the_thrust() -> None:
    plant = make_plant(PASSIVE)
    ends, t = [], 0.0
    while t < 5.0:
        steps = parts(plant, t, t + 0.02)
        assert sum(steps) == pytest.approx(0.02, abs=1e-12)
        ends += list(t + np.cumsum(steps))
        t += 0.02
    corners = plant.model.numeric("motor_time").data
    for corner in corners[(corners > 0.0) & (corners < 5.0)]:
        assert np.abs(np.array(ends) - corner).min() < 1e-9


def test_a_fast_and_light_or_spinning_vehicle_takes_parts_of_a_step() -> None:
    plant = make_plant(PASSIVE)
    plant._division.on_rail[:] = False
    assert len(parts(plant, 10.0, 10.02)) == 1
    plant.velocity[:] = 0.0, 0.0, 2000.0
    rate = plant._division.rates[0] * 2000.0
    assert len(parts(plant, 10.0, 10.02)) == np.ceil(rate * 0.02 / 0.5)
    plant.velocity[:] = 0.0
    plant.rate[:] = 0.0, 60.0, 80.0  # 2 rad in 20 ms
    assert len(parts(plant, 10.0, 10.02)) == 10


def test_steps_without_the_library_are_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    rows = []
    for _ in range(2):
        with compiled():
            plant = make_plant(PASSIVE)
            plant.advance(1000)
        rows.append([*plant.position, *plant.attitude, plant.data.time])
        monkeypatch.setattr(Plant, "_native_steps", lambda _: None)
    assert rows[0] == rows[1]
