"""Short form of `tests/benchmarks/coverage.py`: do the intervals hold the truth?"""

from dataclasses import replace

import numpy as np
import pytest

from analysis.identify import Estimate, expectations, fit_to, identify
from analysis.identify.advice import Content, advice
from analysis.identify.evidence.uncertainty import freedom_of
from analysis.identify.progress import about, reported_to, say
from analysis.recording import measurement
from tests.benchmarks import check_before, coverage
from tests.benchmarks.identification import Gimbal, moved, random_steps
from twin.evaluation.words import estimated


@pytest.mark.thorough
@pytest.mark.parametrize("kind", ["late", "coloured", "quantised", "single"])
def test_scores_of_figures_are_those_of_their_deviations(kind):
    """Root mean square of 20 scores is within 0.4 to 2: chance leaves it there in 99 of 100 cases.

    Intervals of white noise alone score 3 (late), 8 (coloured) and 4 (quantised).
    """
    _, rms, _ = coverage.study(kind, range(5))
    assert 0.4 < rms < 2.0


@pytest.mark.thorough
def test_a_coupling_with_a_zero_and_another_delay_is_found_and_the_absent_one_named():
    r, true = coverage.two_axes(3)
    model = identify([r], 2, 1)
    found = dict(coverage.scores(model, true))
    absent = next(name for name, values in true.items() if values == {"gain": 0.0})
    assert max(abs(z) for z in found.values()) < 4.0
    assert len(found) == 14  # four figures of three channels, one zero, and the absent gain
    assert [e.name for e in model.estimates if e.name.startswith(absent)] == [f"{absent} gain"]
    assert any(w.startswith(f"{absent}: ") and "left out" in w for w in model.warnings)


def test_flanks_dated_late_are_no_spikes_and_true_spikes_are():
    r, _ = coverage.one_axis("late", 0)
    assert identify([r]).axes[0].spikes == 0
    values = r.angles.values.copy()
    values[[200, 700, 1100]] += 0.2
    model = identify([replace(r, angle=replace(r.angles, values=values))])
    assert model.axes[0].spikes == 3


@pytest.mark.parametrize(
    "places", [(0, -1), (1, 500), (600, 602), (600, 602, 604), (0, 2, -3, -1), (600, 601, 602)]
)
def test_gross_spikes_beside_each_other_and_at_the_ends_are_set_aside(places):
    """Of 90° and of twice the motion, beside six far apart; the figures stay."""
    r, _ = coverage.one_axis("late", 0)
    clean = identify([r])
    at = [*places, 200, 350, 710, 800, 950, 1100]
    for size in (np.radians(90.0), 2.0 * np.ptp(r.angles.values)):
        values = r.angles.values.copy()
        values[at] += size
        model = identify([replace(r, angle=replace(r.angles, values=values))])
        assert model.axes[0].spikes == len(at)
        for e, true in zip(model.estimates, clean.estimates, strict=True):
            assert abs(e.value - true.value) < e.std


def test_a_record_that_begins_in_motion_is_predicted_with_its_motion():
    """As `g_train` and `g_check_moving` of the cases: 46 % where it is predicted from rest."""
    g = Gimbal(12.0, 0.02, 0.01, 1.0)
    runs = []
    for seed in range(2):
        rng = np.random.default_rng(seed)
        t = np.arange(0.0, 12.0, 0.01)
        at, u = random_steps(rng, 12.0, 0.7, 5.0)
        angle = moved([g], t, at, u)[0] + 1e-3 * rng.normal(size=len(t))
        late = t > 5.0
        began = at > 5.0
        runs.append(
            measurement(
                t[late], u[began], command_time=at[began], before=u[~began][-1],
                angle=angle[late], initial="free",
            )
        )  # fmt: skip
    model = identify(runs[:1])
    assert fit_to(model, runs)[:, 0].min() > 95.0
    assert fit_to(model, [replace(runs[1], initial="rest")])[0, 0] < 80.0


@pytest.mark.thorough
@pytest.mark.parametrize("kind", ["exact", "single"])
def test_what_a_record_cannot_determine_is_named_before_the_fit(kind):
    """The linear figures against the errors of the fit. A linear gimbal reaches no limit; of a
    single step the backlash is unknown.
    """
    r, true = coverage.one_axis(kind, 1)
    expected = {e.name: e for e in expectations([r])}
    model = identify([r])
    for e in model.estimates:
        scale = 1.0 if e.name.endswith("delay") else abs(e.value)
        error = abs(e.value - true["x/x"][e.name.removeprefix("x/x ")]) / scale
        assert error < 2.0 * expected[e.name].half
    assert np.isinf(expected["x rate limit"].half)
    assert np.isinf(expected["x backlash"].half) == (kind == "single")


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("seed", "poor", "named"),
    [(1009, "one size", {"backlash"}), (6025, "one size", {"rate limit", "dead band", "backlash"}),
     (1003, "one way", {"rate limit", "dead band", "backlash"}),
     (1005, "few", {"rate limit", "dead band", "backlash"}), (1002, "", set())],
)  # fmt: skip
def test_what_steps_do_not_show_of_a_bounded_servo_is_named(seed, poor, named):
    """Short form of `tests/benchmarks/check_before.py`: what the whole fits miss, without them.

    A dead band or backlash that may be zero is a bound, and the true one lies below.
    """
    run, servo, is_poor = check_before.record(seed)
    assert is_poor == poor
    found = expectations([run])
    bounds = {e.name.removeprefix("x "): e for e in found if "/" not in e.name}
    assert {name for name, e in bounds.items() if not e.enough} == named
    if not poor:  # a linear model of a record that reaches its limit is not the advice
        assert bounds["rate limit"].limit_reached
        linear = [e.advice for e in found if "/" in e.name and "gain" not in e.name]
        assert set(linear) == {"rate-limited, fit the servo (--servo)"}
    if poor != "one way":  # which shows no backlash
        for name, true in (("backlash", servo.play), ("dead band", servo.band)):
            if np.isfinite(bounds[name].below):
                assert true < bounds[name].below


@pytest.mark.thorough
def test_a_second_pole_that_is_not_there_is_named():
    """A first order without bounds: the second pole is left out, and no bound is a value."""
    rng = np.random.default_rng(3)
    at = 0.4 + 0.3 * np.arange(12) + rng.uniform(0.0, 0.02, 12)
    level = np.radians(5.0) * rng.permutation(np.geomspace(0.1, 1.0, 12)) * (-1.0) ** np.arange(12)
    time = np.arange(0.0, 4.4, 0.004)
    since = np.maximum(time[:, None] - 0.012 - at, 0.0)
    angle = -np.expm1(-25.0 * since) @ np.diff(level, prepend=0.0)
    angle += rng.normal(0.0, 3e-4, len(time))
    run = measurement(time, level, command_time=at, before=[0.0], angle=angle)
    assert any("fit with --poles 1" in w for w in identify([run]).warnings)
    assert not identify([run], poles=1).axes[0].simpler
    told = []
    with reported_to(told.append):
        with about("axis y, "):
            say("servo")
        assert told.pop() == "axis y, servo"
        expected = {e.name: e for e in expectations([run])}
    assert list(dict.fromkeys(told)) == ["axis x, linear model", "axis x, servo"]
    assert expected["x/x damping"].advice.startswith("fit with --poles 1")
    assert expected["x rate limit"].at_least
    assert not expected["x rate limit"].limit_reached
    for name in ("x dead band", "x backlash"):
        assert 0.0 < expected[name].below < np.radians(0.1)


def test_advice_is_what_the_record_lacks():
    has = Content(0.2, 1.0, 8.0, 0.005, True, 0.05, False, False, 0.0, 0)
    assert advice("backlash", 1e-3, 0.6, 0.3, has) == "record about 4 times as many steps"
    one_size = replace(has, sizes=1.0, smallest=0.1)
    wanted = "record steps of several sizes and smaller steps"
    assert advice("backlash", 1e-3, 0.6, 0.3, one_size) == wanted
    assert "both directions" in advice("dead band", 1e-3, 0.6, 0.3, replace(has, turns=False))
    assert "--poles 1" in advice("delay", 0.01, 2e-3, 1e-3, replace(has, fewer=1))
    limited = replace(has, fewer=1, limited=True)
    assert "--servo" in advice("delay", 0.01, 2e-3, 1e-3, limited)
    assert "--commands" in advice("delay", 0.01, 2e-3, 1e-3, replace(has, doubt=1e-3, undated=True))
    assert estimated(Estimate("x backlash", 0.0, 1e-3, "rad")) == "below 0.11°"
    assert "higher rate" in advice("damping", 0.7, 0.1, 0.06, replace(has, coarse=0.5))


@pytest.mark.thorough
def test_a_limit_that_a_linear_record_does_not_reach_is_a_bound_from_below():
    """The loop k = ω/(2ζ) asks for k times the largest jump; a limit below that shows.

    10 %: how far below it a limit may lie before its effect, on few readings, leaves the noise.
    """
    w, z, late = 40.0, 0.7, 0.012
    rng = np.random.default_rng(0)
    at = 0.4 + 0.4 * np.arange(8)
    level = np.radians(3.0) * rng.permutation(np.geomspace(0.1, 1.0, 8)) * (-1.0) ** np.arange(8)
    time = np.arange(0.0, 3.8, 0.006)
    damped = w * np.sqrt(1.0 - z * z)
    since = np.maximum(time[:, None] - late - at, 0.0)
    rest = np.cos(damped * since) + z * w / damped * np.sin(damped * since)
    angle = (1.0 - np.exp(-z * w * since) * rest) @ np.diff(level, prepend=0.0)
    angle += rng.normal(0.0, 3e-4, len(time))
    model = identify(
        [measurement(time, level, command_time=at, before=[0.0], angle=angle)], servo="speed"
    )
    limit = model.servo[0].rate_limit
    asked = w / (2.0 * z) * np.abs(np.diff(level, prepend=0.0)).max()
    assert limit.at_least
    assert 0.9 * asked < limit.value < asked
    assert limit.to_dict()["value"] is None
    assert limit.to_dict()["low"] == limit.value
    assert "x rate limit" not in model.to_transfer_function().std
    assert any("does not reach the rate limit" in w for w in model.warnings)
    assert estimated(limit) == f"at least {limit.value:.3g} rad/s (never reached in this record)"


@pytest.mark.slow
def test_what_misses_its_bar_was_named_before():
    """97 % of 40 records by the benchmark; here of eight."""
    total = sum(check_before.counted(check_before.judged(seed)[1]) for seed in range(3000, 3008))
    assert total[1, 1] >= 0.9 * total[:, 1].sum()
    assert total[1, 0] <= 0.2 * total[1].sum()


def test_the_freedom_of_a_variance_is_that_of_the_steps_which_carry_the_figure():
    """Of n equal errors n − 1, as in Student's t; of two that outweigh all others one."""
    equal, two = np.full((11, 1), 0.3), np.array([[1.0], [1.0], *[[1e-3]] * 9])
    assert freedom_of(equal, (equal**2).sum(axis=0), 11.0) == pytest.approx([10.0])
    assert freedom_of(two, (two**2).sum(axis=0), 11.0) == pytest.approx([1.0], abs=1e-3)
    # where late stamps explain nothing of the variance, its steps count alike
    assert freedom_of(two, np.array([1e6]), 11.0) == pytest.approx([11.0], rel=1e-4)
