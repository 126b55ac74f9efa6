"""Steps that seats with a gimbal take unless told otherwise: against fine ones, and momentum."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from tests.twin.plant.test_smooth import apart
from twin.config import Fly
from twin.control import AttitudeController
from twin.experiments.assembly import make_plant
from twin.experiments.programme import setpoint
from twin.loop.seats import Pilot
from twin.plant.authority import control_config
from twin.plant.compiled import compiled

SEATS = ("linkage", "transfer-function")


def flown(config: Fly, end: float) -> np.ndarray:
    """Position and attitude every 0.1 s of a steered flight, (n, 7)."""
    rows = []
    with compiled():
        plant = make_plant(config)
        programme, _ = setpoint(config, plant.model)
        controller = AttitudeController(control_config(plant.model))
        pilot = Pilot(plant, controller, programme, 1.0 / config.control_hz)
        per = round(4e6 / plant.dt_ns)
        while plant.time_ns < end * 1e9:
            plant.drive(pilot.update(plant.time_ns * 1e-9, plant.gimbal()))
            plant.advance(per)
            if plant.time_ns % 100_000_000 == 0:
                rows.append([*plant.position, *plant.attitude])
    return np.array(rows)


def judge(gimbal: str, fine: float, end: float) -> float:
    """Hold the default against fine steps; gives the error of implicit ones of 1 ms [deg]."""
    config = Fly(gimbal=gimbal)
    truth = flown(replace(config, integrator="rk4", dt=fine), end)
    height, range_, angle = apart(flown(config, end), truth)
    assert height < 1e-4
    assert range_ < 1e-4
    assert angle < 0.01  # of the whole rotation from one attitude to the other, roll included
    *_, implicit = apart(flown(replace(config, integrator="implicitfast", dt=0.001), end), truth)
    return implicit


@pytest.mark.parametrize("gimbal", SEATS)
def test_the_default_step_of_a_gimbal_is_within_the_limits_in_the_first_second(gimbal: str) -> None:
    """It leaves the rail and turns; the whole flight is the slow test below."""
    judge(gimbal, 0.0005, 1.2)


@pytest.mark.slow
@pytest.mark.parametrize("gimbal", SEATS)
def test_the_default_step_of_a_gimbal_is_within_the_limits_of_a_converged_flight(
    gimbal: str,
) -> None:
    """To the ground; implicit steps of 1 ms, which cost as much with a model, miss them."""
    assert judge(gimbal, 0.00025, 33.0) > 0.01


@pytest.mark.parametrize("gimbal", SEATS)
def test_the_default_step_conserves_the_momentum_of_a_free_vehicle_to_1e_6(gimbal: str) -> None:
    """In vacuum without weight, its gimbal swung by up to 7° every 0.1 s: from rest, both are 0."""
    nothing = (("air_enabled", 0.0), ("ramp_length", 0.0), ("motor_ignition", 1e3))
    random = np.random.default_rng(0)
    with compiled():
        plant = make_plant(Fly(gimbal=gimbal, set=nothing))
        model, data = plant.model, plant.data
        model.opt.gravity[:] = 0.0
        vehicle, ring = (model.body(name).id for name in ("vehicle", "gimbal_ring"))
        swung = 0.0
        for k in range(150):
            if k % 25 == 0:
                angle = tuple(random.uniform(-0.12, 0.12, 2).tolist())
            plant.drive(angle)
            plant.advance(4_000_000 // plant.dt_ns)
            mujoco.mj_comPos(model, data)
            mujoco.mj_comVel(model, data)
            mujoco.mj_subtreeVel(model, data)
            assert np.abs(data.subtree_angmom[vehicle]).max() < 1e-6  # N m s
            linear = model.body_subtreemass[vehicle] * data.subtree_linvel[vehicle]
            assert np.abs(linear).max() < 1e-6  # N s
            swung = max(swung, float(np.linalg.norm(data.subtree_angmom[ring])))
    assert swung > 1e-3  # exchanged with the motor


@pytest.mark.parametrize(
    ("settings", "method", "step_ms"),
    [
        ({}, "rk4", 4.0),  # half of that while a servo shaft swings
        ({"set": (("gimbal_servo_resistance", 2.0),)}, "rk4", 4 / 3),  # damped at 1350 /s
        ({"set": (("gimbal_servo_resistance", 1.0),)}, "implicitfast", 1.0),  # at 2600 /s
        ({"control_hz": 1000.0}, "rk4", 1.0),
        ({"gimbal": "transfer-function"}, "rk4", 4.0),
        ({"gimbal": "transfer-function", "control_hz": 50.0}, "rk4", 4.0),
        ({"gimbal": "transfer-function", "integrator": "euler"}, "euler", 1.0),
        ({"gimbal": "transfer-function", "set": (("ramp_stiffness", 15000.0),)},
         "implicitfast", 1.0),
        ({"gimbal": "transfer-function", "integrator": "rk4",
          "set": (("ramp_stiffness", 15000.0),)}, "rk4", 1.0),
        ({"gimbal": "transfer-function", "control_hz": 100.0}, "rk4", 10 / 3),
    ],
)  # fmt: skip
def test_each_seat_with_a_gimbal_has_its_method_and_step(
    settings: dict[str, object], method: str, step_ms: float
) -> None:
    plant = make_plant(Fly(**settings))
    assert plant.dt_ns == round(step_ms * 1e6)
    assert plant.integrator == method
