"""Servos of second order whose speed itself is clipped: against scipy, and small Euler steps."""

import itertools

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from analysis.identify import identify
from analysis.identify.servo.motion import speed_servo
from analysis.identify.servo.search import _better
from analysis.recording import measurement
from analysis.transfer_function.speed import clip_move, longest_step

FREQUENCY, DAMPING, DELAY, LIMIT = 40.1, 0.7, 0.025, 1.047


def clipped(time, u, frequency, damping, limit, y=0.0, v=0.0):
    """Position and speed after the command u was held: DOP853 from event to event.

    Events are the limit of the speed, reached, and the error at which it is left: ωn²·e = 2ζωn·v.
    """
    left = time
    while left > 1e-13:
        ahead = np.copysign(u - y, v * (u - y)) if v else 0.0
        beyond = ahead - 2.0 * damping * limit / frequency
        if abs(v) >= limit * (1.0 - 1e-14) and beyond > 1e-13:
            span = min(beyond / limit, left)
            y, left = y + v * span, left - span
            continue

        def slope(_, x):
            return [x[1], frequency**2 * (u - x[0]) - 2.0 * damping * frequency * x[1]]

        def reached(_, x):
            return abs(x[1]) - limit

        reached.direction, reached.terminal = 1.0, True
        found = solve_ivp(
            slope, (0.0, left), [y, v], "DOP853", rtol=1e-11, atol=1e-13, events=reached
        )
        (y, v), left = found.y[:, -1], left - found.t[-1]
        if found.status == 1:
            v = np.copysign(limit, v)
    return y, v


def test_the_motion_is_that_of_scipy_from_event_to_event():
    """2e-7 rad and 5e-6 rad/s: fourth-order steps of a fifth of a time constant at most."""
    rng = np.random.default_rng(0)
    for _ in range(40):
        frequency, damping = rng.uniform(20.0, 80.0), rng.uniform(0.3, 1.2)
        limit, w = rng.uniform(0.5, 3.0), 2.0 * damping * frequency
        truth = own = 0.0, 0.0
        for _ in range(8):
            u, time = rng.uniform(-0.3, 0.3) * rng.choice([0.1, 1.0]), rng.uniform(0.005, 0.2)
            truth = clipped(time, u, frequency, damping, limit, *truth)
            own = clip_move(*own, u, time, frequency**2 / w, w, limit, 0.0)
            assert own[0] == pytest.approx(truth[0], abs=2e-7)
            assert own[1] == pytest.approx(truth[1], abs=5e-6)
            assert abs(own[1]) <= limit


def test_a_record_shows_the_motion_at_its_own_times():
    """Commands arrive between samples; the same limit with both signs."""
    at, u = np.array([-1.0, 0.1, 0.33]), np.array([0.0, 0.2, -0.1])
    w = 2.0 * DAMPING * FREQUENCY
    time = np.arange(0.0, 0.7, 0.07)
    angle, rate = speed_servo(time, at, u, DELAY, FREQUENCY**2 / w, w, LIMIT, 0.0, True)
    truth = 0.0, 0.0
    changes = at + DELAY
    for row, (a, b) in enumerate(itertools.pairwise(time), 1):
        edges = [a, *changes[(changes > a) & (changes < b)], b]
        for begin, end in itertools.pairwise(edges):
            now = u[np.searchsorted(changes, begin, side="right") - 1]
            truth = clipped(end - begin, now, FREQUENCY, DAMPING, LIMIT, *truth)
        assert angle[row] == pytest.approx(truth[0], abs=2e-7)
        assert rate[row] == pytest.approx(truth[1], abs=5e-6)
    assert np.abs(rate).max() == pytest.approx(LIMIT)


def record(rng, duration, largest, noise, h=2e-5):
    """Steps of many sizes at 200 Hz, by Euler steps of h."""
    t, at = np.arange(0.0, duration, 0.005), np.arange(0.2, duration, 0.6)
    u = rng.permutation(np.geomspace(np.radians(1.0), largest, len(at)))
    u *= np.where(np.arange(len(at)) % 2, -1.0, 1.0)
    every = round(0.005 / h)
    late = np.searchsorted(at + DELAY, np.arange(len(t) * every) * h, side="right")
    y = v = 0.0
    angle = np.empty(len(t))
    for i, c in enumerate(np.append(0.0, u)[late]):
        if i % every == 0:
            angle[i // every] = y
        before = v
        v += h * FREQUENCY * (FREQUENCY * (c - y) - 2.0 * DAMPING * v)
        v = min(max(v, -LIMIT), LIMIT)
        y += 0.5 * h * (before + v)
    angle += noise * rng.normal(size=len(t))
    return measurement(t, u, command_time=at, before=[0.0], angle=angle)


@pytest.mark.thorough
def test_the_servo_is_told_from_others_and_its_figures_are_found():
    """A limit of 60°/s, as servos are simulated; Euler steps of 20 µs, noise of 0.03°.

    Fitted as `set-point` or `speed`, its delay lay 10 ms outside an interval of ± 1 to 4 ms.
    3.3 of the stated deviations: one in a thousand records is further off.
    """
    model = identify(
        [record(np.random.default_rng(3), 6.0, np.radians(14.0), 5e-4)], servo=True, max_delay=0.06
    )
    assert model.servo[0].structure == "clipped"
    true = {"x/x delay": DELAY, "x/x natural frequency": FREQUENCY, "x/x damping": DAMPING}
    for name, value in {**true, "x rate limit": LIMIT, "x/x gain": 1.0}.items():
        found = model.estimate(name)
        assert found.std < 0.02 * value
        assert abs(found.value - value) < 3.3 * found.std
    assert model.warnings == ()


@pytest.mark.thorough
def test_a_structure_that_predicts_as_well_with_other_figures_is_named():
    """Small steps in much noise: fitted as `speed`, the delay lies outside its interval."""
    r = record(np.random.default_rng(1), 4.0, np.radians(6.0), 6e-3)
    model = identify([r], servo=True, max_delay=0.06)
    assert model.servo[0].structure == "speed"
    low, high = model.estimate("x/x delay").interval
    assert not low < DELAY < high
    assert any(
        "do not tell the structures 'speed' and 'clipped' apart" in w for w in model.warnings
    )
    asked = identify([r], servo="clipped", max_delay=0.06)
    low, high = asked.estimate("x/x delay").interval
    assert low < DELAY < high
    assert not any("apart" in w for w in asked.warnings)


def test_a_structure_is_better_only_beyond_chance():
    """Steps whose differences scatter ten times as far as their mean, and a tenth as far."""
    even = np.tile([1.0, -1.0], 8)
    losses = {
        "speed": 10.0 + 0.1 + even,
        "clipped": np.full(16, 10.0),
        "command": np.full(16, 20.0),
    }
    assert not _better("clipped", "speed", losses)
    assert not _better("speed", "clipped", losses)
    assert _better("clipped", "speed", {**losses, "speed": 10.0 + 10.0 + even})
    assert _better("clipped", "command", losses)
    one_step = np.where(np.arange(16) == 3, 1e4, 10.0)
    assert _better("clipped", "speed", {**losses, "speed": one_step})


def test_a_loop_without_damping_is_stepped_by_its_natural_frequency():
    """A search that strays to θ = [-2.0, 15.1] once took two minutes for one simulation."""
    w, k = 0.13, 2.7e7
    assert longest_step(k, w) == pytest.approx(0.2 / 30.0 / np.sqrt(k * w))
    assert longest_step(700.0, 900.0) == 0.2 / 900.0
    assert longest_step(900.0, 2.0) == 0.2 / 900.0  # a damping of 0.024
    assert longest_step(900.0, 0.0) == 0.2 / 900.0
    # undamped: cos of the natural frequency, for ten periods
    period = 2.0 * np.pi / np.sqrt(k * w)
    y, _ = clip_move(0.0, 0.0, 1e-6, 10.0 * period, k, 1e-3 * w, 1.0, 0.0)
    turns = 10.0 * period * np.sqrt(1e-3 * k * w)
    assert y == pytest.approx(1e-6 * (1.0 - np.cos(turns)), abs=2e-8)
