"""The polynomial from gimbal angles to linearised angles: inverse, slopes, and what is refused."""

from math import radians

import numpy as np
import pytest
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st
from numpy.polynomial.polynomial import polyval2d

from hardware.calibration import CalibrationError, Linearisation
from hardware.calibration import linearisation as module

EXTENT = radians(10.0)


def rows(size, degrees=(2, 3, 4)):
    """Coefficient rows with every entry within ±size [rad]."""
    return st.tuples(*(st.tuples(*[st.floats(-size, size)] * (degree + 1)) for degree in degrees))


def accepted(x, y):
    try:
        return Linearisation(x, y, EXTENT)
    except CalibrationError:
        assume(False)


FILTERED = [HealthCheck.filter_too_much]  # most random maps are refused
ANGLES = st.tuples(*[st.floats(radians(-30.0), radians(30.0))] * 2)


@settings(max_examples=40, deadline=None, suppress_health_check=FILTERED)
@given(rows(0.02), rows(0.02), ANGLES)
def test_every_angle_of_an_accepted_map_comes_back_from_its_linearised_angle(x, y, angle):
    given_map = accepted(x, y)
    # Newton ends at a residual of 1e-12, and a slope is at least 0.2
    back = given_map.angle(given_map.linearised(angle))
    np.testing.assert_allclose(back, angle, atol=1e-11)


@pytest.mark.thorough
@settings(max_examples=15, deadline=None, suppress_health_check=FILTERED)
@given(rows(0.03), rows(0.03), ANGLES)
def test_the_fixed_point_iteration_alone_gives_the_same_angle(x, y, angle):
    given_map = accepted(x, y)
    target = given_map.linearised(angle)
    newton, module.NEWTON = module.NEWTON, 0
    try:
        back = given_map.angle(target)
    finally:
        module.NEWTON = newton
    np.testing.assert_allclose(back, angle, atol=1e-10)


@settings(max_examples=25, deadline=None, suppress_health_check=FILTERED)
@given(rows(0.02), rows(0.02), st.tuples(*[st.floats(-1.0, 1.0)] * 2))
def test_the_sum_is_that_of_numpys_polynomial(x, y, place):
    given_map = accepted(x, y)
    for axis, factors in enumerate((x, y)):
        table = np.zeros((5, 5))
        for degree, row in enumerate(factors, 2):
            for j, factor in enumerate(row):
                table[degree - j, j] = factor
        angle = place[0] * EXTENT, place[1] * EXTENT
        expected = angle[axis] + polyval2d(*place, table)
        assert given_map.linearised(angle)[axis] == pytest.approx(expected, abs=1e-14)


@settings(max_examples=25, deadline=None, suppress_health_check=FILTERED)
@given(rows(0.02), rows(0.02), st.tuples(*[st.floats(-20.0, 20.0)] * 2))
def test_the_slope_is_the_difference_quotient_inside_and_outside_of_the_square(x, y, place):
    assume(all(abs(abs(p) - 10.0) > 0.01 for p in place))  # the slope jumps at the edge
    given_map = accepted(x, y)
    angle, step = np.radians(place), 1e-6
    quotient = [
        np.subtract(given_map.linearised(angle + e), given_map.linearised(angle - e)) / (2 * step)
        for e in step * np.eye(2)
    ]
    np.testing.assert_allclose(given_map.slope(tuple(angle)), np.transpose(quotient), atol=1e-7)


@pytest.mark.thorough
@settings(max_examples=20, deadline=None, suppress_health_check=FILTERED)
@given(rows(0.3, (2, 3)), rows(0.3, (2, 3)))
def test_what_is_accepted_is_diagonally_dominant_between_the_grid_places_too(x, y):
    given_map = accepted(x, y)
    rng = np.random.default_rng(0)
    for angle in rng.uniform(-1.3 * EXTENT, 1.3 * EXTENT, (50, 2)).tolist():
        (a, b), (c, d) = given_map.slope((angle[0], angle[1]))
        for own, other in ((a, b), (d, c)):
            assert own - abs(other) >= module.FLATTEST - 1e-12
            assert own + abs(other) <= module.STEEPEST + 1e-12


def test_without_coefficients_it_is_the_identity_everywhere():
    straight = Linearisation()
    assert straight.straight
    for angle in ((0.1, -0.2), (3.0, 4.0)):
        assert straight.linearised(angle) == straight.angle(angle) == angle
        assert straight.slope(angle) == ((1.0, 0.0), (0.0, 1.0))


def test_outside_of_the_square_the_map_goes_on_with_the_slope_at_zero():
    bent = Linearisation(((0.01, 0.0, 0.0),), ((0.0, 0.0, -0.01),), EXTENT)
    edge, beyond = bent.linearised((EXTENT, 0.0)), bent.linearised((EXTENT + 0.1, 0.0))
    np.testing.assert_allclose(np.subtract(beyond, edge), (0.1, 0.0), atol=1e-15)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"x": ((0.2, 0.0, 0.0),), "y": ((0.0, 0.0, 0.0),)}, "x is not monotone"),
        ({"x": ((0.0, 0.0, 0.0),), "y": ((0.2, 0.0, 0.0),)}, "y is not monotone"),
        ({"x": ((0.0, 0.0, 0.0),)}, "1 and 0 rows"),
        ({"x": ((0.0,) * 3,) * 9, "y": ((0.0,) * 3,) * 9}, "at most"),
        ({"x": ((0.0, 0.0),), "y": ((0.0, 0.0),)}, "degree 2 has 2 numbers, must have 3"),
        ({"x": ((float("nan"), 0.0, 0.0),), "y": ((0.0,) * 3,)}, "finite"),
        ({"x": ((1e300, 0.0, 0.0),), "y": ((0.0,) * 3,)}, "at most 45°"),
        ({"extent": 0.0}, r"extent is 0°"),
        ({"extent": float("inf")}, "finite"),
        ({"sigma": -0.001}, "sigma"),
        ({"sigma": 0.1}, "sigma"),
    ],
)
def test_an_unusable_map_is_refused_in_one_line(change, message):
    with pytest.raises(CalibrationError, match=message) as caught:
        Linearisation(**change)
    assert "\n" not in str(caught.value)
