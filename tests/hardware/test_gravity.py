"""Potentiometers against the accelerometer's gravity: what motion adds, and what a drift shows."""

from math import cos, radians, sin

import numpy as np
import pytest

from hardware.faults import Prediction, Reading
from hardware.faults.gravity import Gravity

G, DT = 9.80665, 2e-3
LEVER, SCALE = 0.0411, 1.03  # m: site imu of mjcf/mechanism.xml; MPU-6050 product specification


def slews(seed):
    """Angles of both axes, steps of ±8° every 0.3 s (8000, 2) [rad].

    A 9 g servo reaches 240 °/s within 20 ms: 210 rad/s².
    """
    steps = np.random.default_rng(seed).uniform(-radians(8), radians(8), (60, 2))
    wanted = np.repeat(steps, 150, axis=0)[:8000]
    angle, rate = np.zeros((8000, 2)), np.zeros(2)
    for k in range(1, len(angle)):
        pull = 2500.0 * (wanted[k] - angle[k - 1]) - 100.0 * rate
        rate = rate + DT * np.clip(pull, -210.0, 210.0)
        angle[k] = angle[k - 1] + DT * rate
    return angle


def felt(angle, slope, bend):
    """Specific force of an accelerometer beside the pivot of a rig that stands nozzle up [m/s²]."""
    x, y = angle
    u, v = bend
    p, q = slope
    return (
        SCALE * (G * cos(x) * sin(y) + LEVER * v),
        SCALE * (-G * sin(x) - LEVER * u),
        -G * cos(x) * cos(y) - LEVER * (p * p + q * q),
    )


@pytest.mark.parametrize(("seed", "slope_error"), [(0, 0.0), (1, 0.0), (2, 0.0), (1, 0.1)])
def test_motion_beside_gravity_stays_within_its_bound_and_a_drift_leaves_it(seed, slope_error):
    """Rigid-body kinematics: tilt and angular acceleration about x and y at a lever along z.

    A potentiometer that is not calibrated has 5 % of its travel as standard deviation.
    """
    known = (0.15 if slope_error else 0.0,) * 4
    angle = slews(seed)
    slope = np.gradient(angle, DT, axis=0)
    rate, bend = slope.tolist(), np.gradient(slope, DT, axis=0).tolist()
    gravity, excess, still = Gravity(), [], (0.5,) * 4
    for k, (x, y) in enumerate(angle.tolist()):
        drift = radians(1.0) * max(0.0, k * DT - 12.0)
        pots = tuple((1.0 + slope_error) * a for a in (x + drift, x + drift, y, y))
        force = felt((x, y), rate[k], bend[k])
        reading = Reading(DT, still, pots, still, (0.0,) * 3, (0.0, 0.0), force=force)
        expected = Prediction((x, y), rate[k], (0.0, 0.0), (0.0,) * 4, slope=known)
        gravity.update(reading, expected, healthy=True)
        if k * DT < 12.0:
            excess += [abs(gravity.departed(2 * i)) - gravity.uncertain(i) for i in (0, 1)]
    assert max(excess) < radians(0.08)  # sines and cosines of 8° are 1 % off a straight line
    product, square = gravity.fit
    if not slope_error:
        assert product / square * G == pytest.approx(LEVER, abs=4e-3)  # m; 1.5 mm of it the scale
    assert gravity.left(0, 1.0)  # 4 s of 1 °/s
    assert not any(gravity.left(k, sense) for k, sense in ((0, -1.0), (1, 1.0), (1, -1.0)))
