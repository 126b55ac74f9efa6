"""Recursive estimates and drift, on motions whose properties are known."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import toeplitz
from scipy.signal import lfilter

from analysis.estimate import Property, drift, fitted, information, scatter, track
from analysis.schema import AnalysisError

PERIOD, MEMORY, NOISE = 0.01, 0.8, 1e-3
GAIN = Property("gain", "", 1.0, 1.0, 0.01)
ZERO = Property("zero", "°", 180.0 / np.pi, 0.0, 0.003)
DELAY = Property("delay", "ms", 1e3, 0.0, 1e-3)


def noise(n, seed):
    """First-order noise of one standard deviation."""
    rng = np.random.default_rng(seed)
    white = rng.standard_normal(n + 200) * np.sqrt(1.0 - MEMORY**2)
    return lfilter([1.0], [1.0, -MEMORY], white)[200:]


def swing(t):
    return 0.08 * np.sin(2 * np.pi * 0.7 * t) + 0.03 * np.sin(2 * np.pi * 2.3 * t)


def moved(t, level):
    gain, zero, delay = level
    return gain * swing(t - delay) + zero


def model(t):
    def both(level):
        gain, _, delay = level
        slope = (swing(t - delay - 1e-6) - swing(t - delay)) / 1e-6
        motion = swing(t - delay)
        return moved(t, level), np.column_stack([motion, np.ones_like(t), gain * slope])

    return both


def test_an_estimate_without_forgetting_is_that_of_generalised_least_squares(monkeypatch):
    monkeypatch.setattr("analysis.estimate.recursive.MEMORY", 1e9)
    t = PERIOD * np.arange(1201)
    J = model(t)(np.array([1.0, 0.0, 0.0]))[1]
    true, prior = np.array([0.02, 0.004, 0.001]), np.full(3, 1e3)
    info = information(t, J @ true + NOISE * noise(len(t), 1), J)
    seen = track(info, prior)
    value, sigma = seen.value[-1], seen.sigma[-1]
    V = NOISE**2 * toeplitz(MEMORY ** np.arange(len(t)))
    normal = J.T @ np.linalg.solve(V, J)
    np.testing.assert_allclose(sigma, np.sqrt(np.diag(np.linalg.inv(normal))), rtol=0.15)
    assert np.all(np.abs(value - true) < 4 * sigma)


def test_its_intervals_hold_the_truth_as_often_as_they_promise():
    t = PERIOD * np.arange(1201)
    J = model(t)(np.array([1.0, 0.0, 0.0]))[1]
    prior, own = np.array([0.01, 0.003, 1e-3]), np.random.default_rng(5)
    inside = []
    for seed in range(60):
        true = prior * own.standard_normal(3)
        seen = track(information(t, J @ true + NOISE * noise(len(t), seed), J), prior)
        inside.append(np.abs(seen.value[-1] - true) < 1.96 * seen.sigma[-1])
    assert 0.88 < np.mean(inside) < 0.99  # 95 % of 180, three standard deviations either way


@pytest.mark.parametrize(
    ("which", "change"), [(0, 0.08), (1, 0.02), (2, 0.012)], ids=["gain", "zero", "delay"]
)
def test_a_step_of_one_property_is_named_with_its_time_and_size(which, change):
    t = PERIOD * np.arange(4001)
    before, after = np.array([1.0, 0.0, 0.0]), np.array([1.0, 0.0, 0.0])
    after[which] += change
    true = np.where(t < 20.0, moved(t, before), moved(t, after))
    properties = (GAIN, ZERO, DELAY)
    found = drift("y", t, true + NOISE * noise(len(t), 3), model(t), properties).changes
    assert [c.what.name for c in found] == [properties[which].name]
    assert abs(found[0].since - 20.0) < 1.0
    assert 20.0 < found[0].noticed < 26.0
    assert abs(found[0].after - after[which]) < 0.1 * change
    assert found[0].text.startswith(f"y: {properties[which].name} ")


def test_an_unchanged_gimbal_has_no_events_and_its_band_holds_the_readings():
    t = PERIOD * np.arange(6001)
    angle = moved(t, (1.004, 0.001, 4e-4)) + NOISE * noise(len(t), 4)
    seen = drift("x", t, angle, model(t), (GAIN, ZERO, DELAY))
    assert seen.changes == ()
    assert np.mean(np.abs(angle - seen.motion) < seen.band) > 0.95
    np.testing.assert_allclose(seen.track.value[-1], (1.004, 0.001, 4e-4), atol=5e-4)


def test_an_axis_that_is_no_longer_commanded_keeps_its_estimate_and_has_no_events():
    t = PERIOD * np.arange(4001)
    command = np.where(t < 15.0, np.sin(2 * np.pi * 0.7 * t), 0.0)

    part = np.where(t < 16.0, 1.0, 0.3)  # what it shows of the other axis's motion

    def still(level):
        motion, slope = model(t)(level)
        return part * motion, part[:, None] * slope

    true = np.where(t < 16.0, 1.0, 0.5) * part * moved(t, (1.004, 0.0, 0.0))
    angle = true + NOISE * noise(len(t), 8)
    given = (t, angle, still, (GAIN, ZERO, DELAY))
    assert drift("x", *given).changes
    seen = drift("x", *given, t[1:][np.diff(command) != 0.0])
    assert seen.changes == ()
    assert len(seen.track.time) == 160
    np.testing.assert_allclose(seen.track.value[-1], (1.004, 0.0, 0.0), atol=1e-3)
    np.testing.assert_array_equal(seen.track.sigma[-1], seen.track.sigma[70])


def test_an_axis_that_moves_late_and_differs_at_once_differs_from_the_start():
    t = PERIOD * np.arange(3001)
    late = (t >= 12.0).astype(float)

    def begun(level):
        motion, slope = model(t)(level)
        return late * motion, late[:, None] * slope

    angle = late * moved(t, (1.08, 0.0, 0.0)) + NOISE * noise(len(t), 11)
    seen = drift("y", t, angle, begun, (GAIN, ZERO, DELAY), t[t >= 12.0])
    assert seen.changes == ()
    assert [text.split(" ± ")[0] for text in seen.differs] == ["y: gain 1.08"]
    biased = replace(GAIN, bias=0.045)
    wide = drift("y", t, angle, begun, (biased, ZERO, DELAY), t[t >= 12.0])
    assert wide.differs == wide.changes == ()
    own = np.sqrt(wide.track.sigma[-1, 0] ** 2 - seen.track.sigma[-1, 0] ** 2)
    assert own == pytest.approx(0.045)
    np.testing.assert_array_equal(wide.track.value, seen.track.value)


@pytest.mark.parametrize("changed", [True, False], ids=["a later change", "no change"])
def test_a_gimbal_unlike_its_model_is_compared_with_its_own_beginning(changed):
    t = PERIOD * np.arange(4001)
    own, later = np.array([1.1, 0.02, 4e-3]), np.array([1.1, 0.05, 4e-3])

    def bent(level):  # beside a motion that no property explains, 0.2° at most
        return moved(t, level) + 0.0035 * np.sin(2 * np.pi * 1.1 * t)

    true = np.where(t < 20.0, bent(own), bent(later if changed else own))
    seen = drift("y", t, true + NOISE * noise(len(t), 9), model(t), (GAIN, ZERO, DELAY))
    assert len(seen.differs) >= 2
    assert [c.what.name for c in seen.changes] == (["zero"] if changed else [])
    for change in seen.changes:
        assert change.before == pytest.approx(0.02, abs=0.003)
        assert change.after == pytest.approx(0.05, abs=0.003)


def test_a_property_that_nothing_shows_does_not_lower_the_scatter():
    """Disturbed estimates of three properties, and the same beside two that no reading shows."""
    t = PERIOD * np.arange(6001)
    J = model(t)(np.array([1.0, 0.0, 0.0]))[1]
    r = NOISE * noise(len(t), 2) + 0.1 * J[:, 0] * np.sign(np.sin(2 * np.pi * 0.13 * t))
    blind = np.column_stack([J, np.zeros((len(t), 2))])
    prior = np.array([0.1, 0.03, 1e-2, 0.2, 0.2])
    three, five = (scatter(information(t, r, j), prior[: j.shape[1]]) for j in (J, blind))
    assert three > 1.5
    assert five == pytest.approx(three, rel=1e-6)


def test_estimates_scatter_as_the_noise_makes_them_and_more_with_what_no_property_explains():
    t = PERIOD * np.arange(6001)
    J, prior = model(t)(np.array([1.0, 0.0, 0.0]))[1], np.array([0.1, 0.03, 0.01])
    only = NOISE * noise(len(t), 6)
    varying = 0.1 * J[:, 0] * np.sign(np.sin(2 * np.pi * 0.13 * t))  # no one gain explains it
    step = np.where(t < 30.0, 0.0, J @ np.array([0.1, 0.02, 5e-3]))
    some = [scatter(information(t, r, J), prior) for r in (only, only + step, only + varying)]
    assert max(some[:2]) < 1.5  # 30 windows of 3 properties
    assert some[2] > 3.0


def test_a_property_does_not_fall_below_what_is_possible():
    t = PERIOD * np.arange(3001)
    true = np.where(t < 12.0, moved(t, (1.0, 0.004, 0.0)), moved(t, (1.0, -0.03, 0.0)))
    bounded = (GAIN, replace(ZERO, value=0.004, lowest=0.0), DELAY)
    seen = drift("y", t, true + NOISE * noise(len(t), 9), model(t), bounded)
    assert seen.track.value[:, 1].min() >= 0.0
    assert all(c.after >= 0.0 for c in seen.changes)


def test_a_change_within_its_own_interval_is_no_event(monkeypatch):
    t = PERIOD * np.arange(3001)
    true = np.where(t < 12.0, moved(t, (1.0, 0.0, 0.0)), moved(t, (1.0, 0.02, 0.0)))
    given = ("y", t, true + NOISE * noise(len(t), 10), model(t), (GAIN, ZERO, DELAY))
    (change,) = drift(*given).changes

    def vague(info, rows, prior):
        value, sigma = fitted(info, rows, prior)
        return value, sigma + 0.02

    monkeypatch.setitem(drift.__globals__, "fitted", vague)
    assert abs(change.after) > 0.01
    assert drift(*given).changes == ()


def test_readings_that_are_missing_are_left_out_and_a_short_record_is_refused():
    t = PERIOD * np.arange(3001)
    angle = moved(t, (1.004, 0.0, 0.0)) + NOISE * noise(len(t), 6)
    angle[700:900] = np.nan
    seen = drift("x", t, angle, model(t), (GAIN, ZERO, DELAY))
    assert seen.changes == ()
    assert np.isfinite(seen.track.value).all()
    with pytest.raises(AnalysisError, match="needs 10 s"):
        information(t[:500], angle[:500], np.ones((500, 1)))
