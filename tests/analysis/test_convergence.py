"""Observed orders and references against methods whose errors are known in closed form."""

import math

import numpy as np
import pytest

from analysis.convergence import (
    AnalysisError,
    Trajectory,
    distance,
    observed_order,
    richardson,
    study,
)

TIME = np.linspace(0.25, 1.0, 4)


def exact(time):
    return np.array([math.cos(2 * time), -2 * math.sin(2 * time)])


def slope(y):
    return np.array([y[1], -4.0 * y[0]])


def oscillator(name, dt):
    """x'' = -4 x by textbook methods; x and v stand as the first coordinates of a position."""
    y, rows = exact(0.0), []
    for k in range(round(1.0 / dt)):
        if name == "euler":
            y = y + dt * slope(y)
        elif name == "midpoint":
            y = y + dt * slope(y + 0.5 * dt * slope(y))
        elif name == "rk4":
            a = slope(y)
            b = slope(y + 0.5 * dt * a)
            c = slope(y + 0.5 * dt * b)
            y = y + dt / 6 * (a + 2 * b + 2 * c + slope(y + dt * c))
        else:
            return None
        if np.isclose(TIME, (k + 1) * dt).any():
            rows.append([*y, 0.0])
    return still(np.array(rows))


def still(position):
    return Trajectory(
        TIME[: len(position)].copy(), position, np.tile([1.0, 0, 0, 0], (len(position), 1))
    )


def truth():
    return still(np.array([[*exact(t), 0.0] for t in TIME]))


def test_the_observed_orders_are_those_of_the_textbook():
    reference = richardson(oscillator, "rk4", 1 / 128)
    found = study(oscillator, ("euler", "midpoint", "rk4"), (1 / 16, 1 / 32, 1 / 64), reference)
    # the next term of the error series is h ≈ 3 % of the leading one here
    for name, order in (("euler", 1), ("midpoint", 2), ("rk4", 4)):
        assert found.of(name).order["position"] == pytest.approx(order, abs=0.12)


def test_the_reference_is_as_good_as_it_says_and_better_than_its_finest_flight():
    reference = richardson(oscillator, "midpoint", 1 / 64)
    error = distance(reference.trajectory, truth()).position
    finest = distance(oscillator("midpoint", 1 / 256), truth()).position
    assert error < reference.uncertainty.position
    assert error < 0.05 * finest
    assert reference.order == pytest.approx(2.0, abs=0.05)


def test_errors_in_the_shade_of_the_reference_make_no_order():
    steps = np.array([4.0, 2.0, 1.0, 0.5])
    errors = np.array([16.0, 4.0, 1.0, 0.9])  # the last one is all floor
    assert observed_order(steps, errors, floor=0.095) == pytest.approx(2.0)
    assert math.isnan(observed_order(steps, errors, floor=1.0))


def test_a_flight_that_diverges_has_no_error_and_no_order():
    reference = richardson(oscillator, "rk4", 1 / 64)
    found = study(oscillator, ("broken",), (1 / 16, 1 / 32), reference).of("broken")
    assert math.isnan(found.errors[0].position)
    assert math.isnan(found.order["position"])
    with pytest.raises(AnalysisError, match="reference flight diverged"):
        richardson(oscillator, "broken", 0.25)


def test_the_angle_between_attitudes_is_the_angle_of_the_rotation():
    turns = np.array([0.0, 0.3, 2.0])
    q = np.stack([np.cos(turns / 2), 0 * turns, np.sin(turns / 2), 0 * turns], axis=1)
    place = np.zeros((3, 3))
    a = Trajectory(np.arange(3.0), place, np.tile([1.0, 0, 0, 0], (3, 1)))
    b = Trajectory(np.arange(3.0), place.copy(), q)
    assert distance(a, b).attitude == pytest.approx(2.0, rel=1e-12)


def test_expected_error_follows_the_observed_order():
    reference = richardson(oscillator, "rk4", 1 / 128)
    series = study(oscillator, ("midpoint",), (1 / 16, 1 / 32, 1 / 64), reference).of("midpoint")
    flown = distance(oscillator("midpoint", 1 / 128), reference.trajectory).position
    assert series.error_at(1 / 128) == pytest.approx(flown, rel=0.1)


def test_what_cannot_be_compared_is_refused():
    reference = richardson(oscillator, "rk4", 1 / 64)
    with pytest.raises(AnalysisError, match="two different steps"):
        study(oscillator, ("rk4",), (0.25, 0.25), reference)
    with pytest.raises(AnalysisError, match="different instants"):
        distance(truth(), Trajectory(TIME + 0.1, np.zeros((4, 3)), np.tile([1.0, 0, 0, 0], (4, 1))))
    with pytest.raises(AnalysisError, match="not finite"):
        still(np.full((4, 3), np.nan))
