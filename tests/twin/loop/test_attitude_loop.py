"""The linear attitude loop handed to the margins, against the controller's code and MuJoCo."""

import math
import re
from dataclasses import replace

import mujoco
import numpy as np
import pytest

from analysis.transfer_function import Channel, TransferFunctionModel
from twin.control import AttitudeController
from twin.physics.motor import Depletion
from twin.plant.authority import control_config
from twin.plant.loops import attitude_loops, wrong_gain
from twin.plant.loops import unstable as cause_of_divergence
from twin.plant.model.build import REFERENCE_GIMBAL
from twin.plant.model.model import ModelConfig, load

AT = 6.0  # s; in the steady part of the burn


@pytest.fixture(scope="module")
def loops():
    return attitude_loops()


@pytest.mark.thorough
@pytest.mark.parametrize("omega", [2.0, 9.0, 25.0])
def test_the_controller_answers_a_small_swing_as_its_transfer_function_says(loops, omega):
    """Angle of 1e-4 rad about x, at 0.1 ms; the first-order integral errs by ω·dt/2."""
    config = control_config(load(ModelConfig()).mj)
    controller, dt = AttitudeController(config), 1e-4
    period = round(2 * math.pi / omega / dt)
    t = np.arange(8 * period) * dt
    sine, cosine = np.sin(omega * t), np.cos(omega * t)
    command = np.empty(len(t))
    for n in range(len(t)):
        half = 0.5e-4 * sine[n]
        attitude = np.array([math.cos(half), math.sin(half), 0.0, 0.0])
        rate = np.array([1e-4 * omega * cosine[n], 0.0, 0.0])
        command[n] = controller.update(AT, dt, attitude, rate, np.array([0.0, 0.0, 1.0]))[0]
    last = slice(-2 * period, None)
    answer = 2.0 * np.mean(command[last] * (cosine[last] - 1j * sine[last])) * 1j / 1e-4
    authority = np.interp(AT, config.authority_time, config.authority)
    # a positive gimbal angle turns the vehicle about −x, by `authority` per radian
    s = 1j * omega
    loop = loops[0]
    expected = np.polyval(loop.num, s) / np.polyval(loop.den, s) * s**2 / authority
    assert answer == pytest.approx(expected, rel=3e-3)


def test_the_gain_grows_with_the_authority_of_the_emptied_vehicle(loops):
    """By MuJoCo's joint-space inertia: the free joint's block holds mass, mass·lever, inertia."""
    model = load(ModelConfig()).mj
    ratios = []
    for burnt_at in (0.0, 1e3):  # and the loops do not depend on what is burnt already
        Depletion(model).update(burnt_at)
        data = mujoco.MjData(model)
        mujoco.mj_forward(model, data)
        whole = np.zeros((model.nv, model.nv))
        mujoco.mj_fullM(model, data, whole)
        first = model.joint("vehicle").dofadr[0]
        free = whole[first : first + 6, first : first + 6]
        mass = free[0, 0]
        # linear velocities are in the world, rotations in the body: compare magnitudes
        lever = np.linalg.norm(free[:3, 3]) / mass
        ratios.append(lever / (free[3, 3] - mass * lever**2))
    for again, loop in zip(attitude_loops(model), loops, strict=True):
        assert again.num == pytest.approx(loop.num, rel=1e-12)
    grown = np.polyval(loops[1].num, 1.0) / np.polyval(loops[0].num, 1.0)
    assert grown == pytest.approx(ratios[1] / ratios[0], rel=2e-3)
    assert grown == pytest.approx(1.39, abs=0.01)


def test_a_gain_is_wrong_from_where_the_closed_loop_has_an_unstable_pole(loops):
    """Poles of the whole loop, with a delay of second order by Padé (0.06 rad at the crossover)."""
    vehicle = load(ModelConfig()).mj
    x = TransferFunctionModel.read(REFERENCE_GIMBAL).channel("x", "x")
    unit = x.num[-1] / x.den[-1]

    def wrong(gain):
        one = replace(x, num=tuple(gain / unit * n for n in x.num))
        return wrong_gain(TransferFunctionModel(((one,),), ("x",), ("x",)), vehicle) is not None

    def unstable(gain):
        found = False
        for loop in loops:
            late = x.delay + 0.5 * loop.hold
            pade = [[late**2 / 12, -late / 2, 1.0], [late**2 / 12, late / 2, 1.0]]
            num = np.polymul(np.polymul(loop.num, np.array(x.num) * gain / unit), pade[0])
            den = np.polymul(np.polymul(loop.den, x.den), pade[1])
            found |= bool((np.roots(np.polyadd(num, den)).real > 0.0).any())
        return found

    for gain in (-1.0, 0.04, 1.0, 2.1, 2.5):
        assert wrong(gain) == unstable(gain), gain
    high = replace(x, num=tuple(53.0 / unit * n for n in x.num))
    text = cause_of_divergence(TransferFunctionModel(((high,),), ("x",), ("x",)), vehicle)
    margin = 53.0 / float(re.search(r"its gain ([\d.]+) times beyond", text)[1])
    assert unstable(1.02 * margin)
    assert not unstable(0.98 * margin)
    slow = TransferFunctionModel(((Channel((1.0,), (0.5, 1.0), 0.2),),), ("x",), ("x",))
    assert wrong_gain(slow, vehicle) is None  # unstable, but not for its gain
    degrees = replace(slow.channel("x", "x"), num=(57.3,))
    assert wrong_gain(TransferFunctionModel(((degrees,),), ("x",), ("x",)), vehicle) is not None
