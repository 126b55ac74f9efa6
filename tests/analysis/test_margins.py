"""Stability margins against closed forms, a dense search with the pure delay, and simulation."""

import math

import numpy as np
import pytest

from analysis.transfer_function import Channel, Loop, TransferFunctionModel, margins

DIRECT = Channel((1.0,), (1.0,))
NONE = Channel((0.0,), (1.0,))
GIMBAL = Channel((53.0**2 * 1.06,), (1.0, 62.5, 53.0**2), 0.0166)
# PID on a pure inertia with a low-pass on the rate: kp 25, ki 10, kd 8, 80 rad/s
PID = Loop("ignition", (665.0, 2010.0, 800.0), (1.0, 80.0, 0.0, 0.0, 0.0), 0.004)


def single(loop, gimbal):
    (found,) = margins([loop], TransferFunctionModel(((gimbal,),), ("x",), ("x",)))
    return found


@pytest.mark.parametrize(("gain", "delay"), [(2.0, 0.1), (9.0, 0.05), (20.0, 0.01)])
def test_an_integrator_with_a_delay_has_its_textbook_margins(gain, delay):
    """K/s·exp(−sT): crossover K, phase margin π/2 − KT, gain margin π/(2KT)."""
    found = single(Loop("a", (gain,), (1.0, 0.0), 0.0), Channel((1.0,), (1.0,), delay))
    assert found.crossover == pytest.approx(gain, rel=1e-5)
    assert found.phase == pytest.approx(math.pi / 2 - gain * delay, abs=1e-5)
    assert found.gain == pytest.approx(math.pi / (2 * gain * delay), rel=1e-4)
    assert found.delay == pytest.approx(found.phase / gain, rel=1e-5)
    assert found.lower_gain == 0.0
    assert found.stable == (gain * delay < math.pi / 2)


def searched(omega):
    """Open loop of PID and GIMBAL by its factors; the hold is (1 − exp(−sT))/(sT)."""
    s = 1j * omega
    controller = 25.0 + 10.0 / s + 8.0 * s * 80.0 / (s + 80.0)
    hold = (1.0 - np.exp(-0.004 * s)) / (0.004 * s)
    gimbal = 1.06 * 53.0**2 / (s**2 + 62.5 * s + 53.0**2) * np.exp(-0.0166 * s)
    return controller / s**2 * hold * gimbal


def test_the_attitude_loop_has_the_margins_of_a_dense_search():
    """Steps of 1e-4 rad/s: 1e-5 of the crossover, and 3e-4 of a gain that falls with ω³ at 1."""
    omega = np.arange(0.05, 200.0, 1e-4)
    response = searched(omega)
    size, phase = np.abs(response), np.unwrap(np.angle(response)) - 2 * math.pi
    k = int(np.flatnonzero(np.diff(size > 1.0))[0])
    half_turns = np.flatnonzero(np.diff(np.floor((phase + math.pi) / (2 * math.pi))))
    gains = 1.0 / size[half_turns]
    found = single(PID, GIMBAL)
    assert found.stable
    assert found.crossover == pytest.approx(omega[k], rel=2e-5)
    margin = (phase[k] + math.pi) % (2 * math.pi)
    assert found.phase == pytest.approx(margin, abs=2e-5)
    assert found.delay == pytest.approx(margin / omega[k], rel=5e-5)
    assert found.gain == pytest.approx(gains[gains > 1.0].min(), rel=1e-4)
    assert found.lower_gain == pytest.approx(gains[gains < 1.0].max(), rel=4e-4)


def grown(gain=1.0, extra=0.0, dt=2e-4, duration=6.0):
    """Error of the closed loop late over early, stepped with exact delays of whole steps."""
    late = round((0.0166 + 0.002 + extra) / dt)  # a hold of 4 ms delays by 2 ms
    line = np.zeros(late)
    angle = rate = position = speed = integral = smooth = 0.0
    error = np.empty(round(duration / dt))
    for n in range(len(error)):
        e = error[n] = 0.01 - angle
        integral += 10.0 * e * dt
        smooth += 80.0 * (rate - smooth) * dt
        wanted = gain * (25.0 * e + integral - 8.0 * smooth)
        delayed, line[n % late] = line[n % late], wanted
        speed += (53.0**2 * (1.06 * delayed - position) - 62.5 * speed) * dt
        position += speed * dt
        rate += position * dt
        angle += rate * dt
    half = len(error) // 2
    return np.abs(error[half:]).max() / np.abs(error[:half]).max()


def test_a_simulated_loop_diverges_just_beyond_its_margins_and_not_before():
    found = single(PID, GIMBAL)
    assert grown(0.93 * found.gain) < 1.0 < grown(1.07 * found.gain)
    assert grown(extra=0.93 * found.delay) < 1.0 < grown(extra=1.07 * found.delay)


def test_a_gimbal_that_is_too_slow_is_reported_unstable_without_delay_margin():
    slow = Channel((4.0,), (1.0, 2.0, 4.0), 0.05)
    found = single(PID, slow)
    assert not found.stable
    assert found.delay == 0.0
    assert found.text().startswith("UNSTABLE")
    assert found.phase < 0.0


def test_axes_are_taken_one_by_one_and_those_without_motion_left_out():
    model = TransferFunctionModel(((GIMBAL, NONE), (DIRECT, NONE)))
    assert [(m.axis, m.loop) for m in margins([PID], model)] == [("x", "ignition")]
