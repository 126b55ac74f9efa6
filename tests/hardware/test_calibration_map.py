"""Commanded against true gimbal angle with a calibration alone; MuJoCo solves the linkage."""

from dataclasses import dataclass, replace
from math import radians
from typing import Any

import numpy as np
import pytest

from hardware.calibration import Calibration, CalibrationRig, Log, read, write
from hardware.calibration.solve import solve
from tests.hardware.linkage import GRID, Linkage, Unit
from twin.hil import mechanism_map

UNITS = 40
QUICK = CalibrationRig(repeats=1)


@dataclass
class Calibrated:
    """A unit, what its run recorded, and how far off its calibration is over ±8° (n, 2) [rad]."""

    unit: Unit
    log: Log
    calibration: Calibration
    error: Any

    @property
    def sigma(self):
        return np.array([self.calibration.sigma(a) for a in GRID])


def errors(unit, calibration):
    return np.array([unit.true_angle(calibration.pulses(a)) - a for a in GRID])


@pytest.fixture(scope="module")
def linkage():
    return Linkage()


@pytest.fixture(scope="module")
def linearisation(linkage):
    return mechanism_map(linkage.model).linearisation


def calibrated(linkage, linearisation):
    """Units of the linkage, each with the calibration that its own run gave."""
    rig, made = replace(QUICK, linearisation=linearisation), []
    for seed in range(UNITS):
        unit = Unit(linkage, seed)
        log = unit.log(rig)
        calibration = solve(log, rig, seed)
        made.append(Calibrated(unit, log, calibration, errors(unit, calibration)))
    return made


def scores(units):
    """Errors over the standard deviations of the covariance alone."""
    bare = [replace(u.calibration, deviation=(0.0, 0.0)) for u in units]
    return np.array(
        [u.error / [c.sigma(a) for a in GRID] for u, c in zip(units, bare, strict=True)]
    )


@pytest.fixture(scope="module")
def units(linkage, linearisation):
    return calibrated(linkage, linearisation)


def polynomial_error(linkage, linearisation):
    """Worst of 300 angles between the stops [°]."""
    scale = mechanism_map(linkage.model).matrix
    rng, worst = np.random.default_rng(1), 0.0
    for angle in rng.uniform(-radians(9.9), radians(9.9), (300, 2)):
        expected = np.linalg.solve(scale, linkage.shaft(angle))
        off = np.array(linearisation.linearised(tuple(angle))) - expected
        worst = max(worst, np.degrees(abs(off)).max())
    return float(worst)


def test_the_polynomial_is_within_a_hundredth_of_a_degree_of_the_linkage(linkage, linearisation):
    assert polynomial_error(linkage, linearisation) < 0.01


@pytest.mark.thorough
def test_commanded_angles_are_true_within_a_tenth_of_a_degree(units):
    worst = [np.degrees(abs(u.error)).max() for u in units]
    # switches are held to 0.03° (1σ), two of them on each axis
    assert max(worst) < 0.15
    assert np.median(worst) < 0.08


def test_the_stated_deviation_covers_the_error_as_often_as_it_should(units):
    z = np.array([u.error / u.sigma for u in units])
    # 95.4 % of a normal distribution; the deviation from the potentiometers holds their waviness
    # too, which does not move the gimbal
    assert 0.95 < (abs(z) < 2.0).mean() < 0.999


def test_the_covariance_alone_covers_the_error_of_a_rig_without_play(units):
    # 95.4 %; the six numbers of a unit move all of its angles, so that 40 units scatter by 3 %
    assert 0.88 < (abs(scores(units)) < 2.0).mean() < 0.99


def test_a_straight_line_is_far_off_and_the_potentiometers_show_it(units):
    lines = [solve(u.log, QUICK, 0) for u in units[:10]]
    worst = [
        np.degrees(abs(errors(u.unit, line))).max() for u, line in zip(units, lines, strict=False)
    ]
    assert min(worst) > 0.5
    whole = np.mean([max(u.calibration.deviation) for u in units[:10]])
    assert np.mean([max(line.deviation) for line in lines]) > 3 * whole


def test_pulses_lead_back_to_the_true_angle(units):
    for u in units[:5]:
        for angle in GRID:
            pulses = u.calibration.pulses(angle)
            off = np.degrees(np.array(u.calibration.angles(pulses)) - u.unit.true_angle(pulses))
            assert abs(off).max() < 0.15  # as above


def test_the_file_keeps_the_whole_map(units, tmp_path):
    u = units[1]
    write(tmp_path / "c.json", u.calibration)
    back = read(tmp_path / "c.json", u.calibration.rig)
    for angle in GRID:
        np.testing.assert_allclose(back.pulses(angle), u.calibration.pulses(angle), rtol=1e-13)
        np.testing.assert_allclose(back.sigma(angle), u.calibration.sigma(angle), rtol=1e-9)
