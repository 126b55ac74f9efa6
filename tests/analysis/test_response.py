"""Step, frequency and static figures against closed forms and published numbers."""

import json
import math

import control
import numpy as np
import pytest

from analysis.response import (
    Figure,
    bandwidth,
    cosine_loss,
    cross_coupling,
    cut_steps,
    disagreements,
    frequency_figures,
    hysteresis,
    linearity,
    measure,
    model_figures,
    model_step_metrics,
    over_repeats,
    phase_frequency,
    repeatability,
    slew_figures,
    staircase_figures,
    step_figures,
    step_metrics,
    step_response,
)
from analysis.response.metrics import Step
from analysis.schema import AnalysisError
from analysis.transfer_function import Channel

MATLAB = Channel((8.0, 18.0, 32.0), (1.0, 6.0, 14.0, 24.0))
WN, ZETA = 30.0, 0.5
SECOND = Channel((WN**2,), (1.0, 2 * ZETA * WN, WN**2), 0.012)


def value(figures, name):
    return next(f.value for f in figures if f.name == name)


def test_matlab_documented_stepinfo_example():
    """stepinfo(tf([8 18 32],[1 6 14 24])) of MATLAB's manual, to its four decimals.

    Its peak 1.6871 (overshoot 26.5302 %) is the sample at its peak time 0.5987 s; the response goes
    on to 1.68725 (26.5435 %) at 0.6079 s, which is what a fine grid must find.
    """
    m = model_step_metrics(MATLAB)
    assert m.rise_time == pytest.approx(0.2087, abs=5e-5)
    assert m.settling_time == pytest.approx(3.4972, abs=1e-4)
    time, response = step_response(MATLAB)
    at_sample = np.interp(0.5987, time, response)
    assert at_sample == pytest.approx(1.6871, abs=5e-5)
    assert 100 * (at_sample * 0.75 - 1) == pytest.approx(26.5302, abs=5e-3)
    assert m.peak == pytest.approx(1.687246, abs=1e-6)
    assert m.overshoot == pytest.approx(26.5435, abs=1e-4)
    assert model_step_metrics(MATLAB, band=0.005).settling_time == pytest.approx(4.8896, abs=2e-4)


def test_second_order_overshoot_and_peak_time_equal_the_closed_form():
    m = model_step_metrics(SECOND)
    root = math.sqrt(1 - ZETA**2)
    assert m.overshoot == pytest.approx(100 * math.exp(-math.pi * ZETA / root), rel=1e-5)
    assert m.peak_time == pytest.approx(math.pi / (WN * root) + 0.012, rel=2e-4)


def test_bandwidth_and_quarter_turn_equal_the_closed_form():
    undelayed = Channel(SECOND.num, SECOND.den)
    z = ZETA
    closed = WN * math.sqrt(1 - 2 * z * z + math.sqrt(4 * z**4 - 4 * z * z + 2))
    assert bandwidth(undelayed, 10 * math.log10(2)) == pytest.approx(closed, rel=1e-9)
    assert phase_frequency(undelayed, -90.0) == pytest.approx(WN, rel=1e-9)


def test_phase_lag_and_equivalent_delay_at_one_hertz():
    w = 2 * math.pi
    lag = math.atan2(2 * ZETA * WN * w, WN**2 - w**2) + 0.012 * w
    figures = frequency_figures(SECOND)
    assert value(figures, "phase lag at 1 Hz") == pytest.approx(math.degrees(lag))
    assert value(figures, "equivalent delay") == pytest.approx(lag / w)


def test_a_pure_delay_counts_into_the_quarter_turn():
    slow = Channel((1.0,), (1e-6, 1.0), 0.1)
    assert phase_frequency(slow, -90.0) == pytest.approx(math.pi / 2 / 0.1, rel=1e-4)


def test_an_unstable_channel_has_no_step_metrics():
    with pytest.raises(AnalysisError, match="no step response settles"):
        model_figures(Channel((1.0,), (1.0, -1.0)))


def test_figures_are_json():
    json.dumps([f.to_dict() for f in model_figures(SECOND)], allow_nan=False)


def raw_steps(rng, *, noise=1e-4, static=0.0, repeats=8, lag=0.0):
    """A square wave through SECOND; moves down end `lag` short."""
    t = np.arange(0.0, 2.0 * repeats, 0.002)
    at = np.arange(0.5, 2.0 * repeats, 1.0)
    u = np.where(np.arange(len(at)) % 2, 0.0, 0.1)
    y = np.zeros(len(t))
    for begin, jump in zip(at, np.diff(u, prepend=0.0), strict=True):
        late = np.clip(t - begin - 0.012, 0.0, None)
        root = math.sqrt(1 - ZETA**2)
        wave = np.exp(-ZETA * WN * late) * (
            np.cos(root * WN * late) + ZETA / root * np.sin(root * WN * late)
        )
        y += (jump * (1.0 - static) + (lag if jump < 0 else 0.0)) * (1.0 - wave)
    return t, y + noise * rng.normal(size=len(t)), np.append(-1.0, at), np.append(0.0, u)


def test_raw_steps_reach_the_closed_form_with_an_interval_that_holds_it():
    figures = step_figures(cut_steps(*raw_steps(np.random.default_rng(0))))
    root = math.sqrt(1 - ZETA**2)
    over = 100 * math.exp(-math.pi * ZETA / root)
    overshoot = next(f for f in figures if f.name == "overshoot up")
    assert overshoot.n == 8
    # half a percent: the largest of several noisy samples lies above the true peak
    assert overshoot.value == pytest.approx(over, abs=0.5)
    rise = next(f for f in figures if f.name == "rise_time up")
    assert rise.interval[0] < model_step_metrics(SECOND).rise_time < rise.interval[1]
    assert rise.amplitude == pytest.approx(0.1)


def test_settling_and_dead_time_count_from_the_command():
    figures = step_figures(cut_steps(*raw_steps(np.random.default_rng(1), noise=1e-5)))
    model = model_step_metrics(SECOND)
    assert value(figures, "settling_time up") == pytest.approx(model.settling_time, abs=1e-3)
    assert value(figures, "dead_time up") == pytest.approx(model.dead_time, abs=1e-3)


def test_directions_are_told_apart():
    t, y, at, u = raw_steps(np.random.default_rng(2), static=0.05)
    figures = step_figures(cut_steps(t, y, at, u))
    assert value(figures, "static_error up") == pytest.approx(0.005, abs=2e-4)
    assert value(figures, "static_error down") == pytest.approx(-0.005, abs=2e-4)


def test_the_settling_band_is_never_below_the_noise():
    t = np.linspace(0.0, 1.0, 1000)
    y = 1.0 - np.exp(-t / 0.05) + 0.02 * np.random.default_rng(0).normal(size=1000)
    m = step_metrics(t, y, start=0.0, final=1.0, noise=0.02)
    assert m.settling_time < 0.6  # a 2 % band would only be left at the end


def first_order(t):
    return 1.0 - np.exp(-np.clip(t, 0.0, None) / 0.05)


def well_damped(t):
    """ωn 40 rad/s, ζ 0.6."""
    late = np.clip(t, 0.0, None)
    return 1.0 - np.exp(-24.0 * late) * (np.cos(32.0 * late) + 0.75 * np.sin(32.0 * late))


def repeated(answer, noise, seed, period=0.002, repeats=10):
    """Figures of a square wave of one through an answer to a unit step."""
    at = 1.0 * np.arange(1, 2 * repeats + 1)
    t = np.arange(0.0, at[-1] + 1.0, period)
    y = sum((1.0 if k % 2 == 0 else -1.0) * answer(t - b) for k, b in enumerate(at))
    y = y + noise * np.random.default_rng(seed).normal(size=len(t))
    return step_figures(cut_steps(t, y, np.append(-1.0, at), np.append(0.0, np.arange(20) % 2 < 1)))


@pytest.mark.parametrize("answer", [first_order, well_damped])
@pytest.mark.parametrize("noise", [0.003, 0.006, 0.02])
def test_settling_and_overshoot_of_noisy_steps_are_those_of_the_answer(answer, noise):
    """500 Hz, ten steps either way; 95 % intervals, so of eight two may miss by chance (0.6 %)."""
    fine = np.linspace(0.0, 2.0, 200_001)
    true = step_metrics(fine, answer(fine), start=0.0, final=1.0)
    held = dict.fromkeys(("settling_time", "overshoot", "peak", "rise_time", "dead_time"), 0)
    for seed in range(4):
        for f in repeated(answer, noise, seed):
            name = f.name.split()[0]
            if name in held:
                held[name] += f.interval[0] <= getattr(true, name) + 1e-6
                held[name] -= f.interval[1] < getattr(true, name) - 1e-6
    assert min(held.values()) >= 6, held


def test_an_overshoot_within_the_noise_is_none_and_has_no_time():
    """Less than the noise could hide is none, but the interval says how much it could be."""
    figures = repeated(first_order, 0.006, 0)
    over = next(f for f in figures if f.name == "overshoot up")
    assert over.value == 0.0
    assert 0.2 < over.interval[1] < 1.0
    assert math.isnan(value(figures, "peak_time up"))
    assert value(figures, "peak up") == pytest.approx(1.0, abs=2e-3)
    t, y = np.arange(0.0, 2.0, 0.002), first_order(np.arange(-1.0, 1.0, 0.002))
    y = y + 0.006 * np.random.default_rng(1).normal(size=len(t))
    single = step_figures(cut_steps(t, y, [-1.0, 1.0], [0.0, 1.0]))
    over = next(f for f in single if f.name == "overshoot up")
    assert over.interval == (0.0, pytest.approx(0.6, abs=0.3))


@pytest.mark.parametrize("noise", [0.03, 0.06])
def test_times_to_a_band_that_noise_widened_have_no_interval_to_be_held_against(noise):
    """An answer of 5 % and 2 % of another is not later for being noisier."""
    figures = {f.name: f for f in repeated(well_damped, noise, 1)}
    assert math.isnan(figures["dead_time up"].interval[0])
    assert figures["dead_time up"].n == 10
    exact = repeated(well_damped, 0.0, 1)
    told = [a.name for a, _ in disagreements(tuple(figures.values()), exact)]
    assert not {"settling_time up", "dead_time up"} & set(told)


def test_the_corner_of_a_limited_speed_is_not_smoothed_into_an_overshoot():
    figures = repeated(lambda t: np.clip(5.0 * t, 0.0, 1.0), 0.003, 0)
    over = next(f for f in figures if f.name == "overshoot up")
    assert over.value == pytest.approx(0.0, abs=0.1)
    assert value(figures, "settling_time up") == pytest.approx(0.196, abs=2e-3)


def test_a_step_that_drowns_in_noise_is_refused():
    y = 0.01 * np.random.default_rng(0).normal(size=100)
    with pytest.raises(AnalysisError, match="no more than its noise"):
        step_metrics(np.arange(100.0), y, start=0.0, final=0.01, noise=0.01)


def names(pairs):
    return [(m.name, m.amplitude) for m, _ in pairs]


def test_model_and_measurement_that_disagree_are_named():
    measured = (Figure("rise_time", 1.0, "s", 0.1, 5, (0.9, 1.1)),)
    model = (Figure("rise_time", 1.3, "s", n=0),)
    assert names(disagreements(measured, model)) == [("rise_time", 0.1)]
    assert disagreements(measured, (Figure("rise_time", 1.05, "s"),)) == ()


def test_figures_of_different_amplitudes_are_not_held_against_each_other():
    """A limited speed: twice the rise at four times the amplitude, and the same again."""
    measured = tuple(
        Figure("rise_time up", rise, "s", size, 5, (rise - 0.01, rise + 0.01))
        for rise, size in ((0.1, 0.02), (0.2, 0.08))
    )
    assert disagreements(measured, measured) == ()
    off = (measured[0], Figure("rise_time up", 0.25, "s", 0.0805, 5))
    assert names(disagreements(measured, off)) == [("rise_time up", 0.08)]


def test_a_linear_models_figures_are_of_every_amplitude_and_direction():
    """Twice as slow as measured: 8 steps either way, all else alike."""
    t, y, at, u = raw_steps(np.random.default_rng(4))
    figures = step_figures(cut_steps(t, y, at, u))
    assert not {n for n, _ in names(disagreements(figures, model_figures(SECOND)))} & {
        "overshoot up", "overshoot down", "peak up", "peak down", "rise_time down"
    }  # fmt: skip
    slow = Channel((0.9 * 15.0**2,), (1.0, 15.0, 15.0**2), 0.012)
    off = {name for name, _ in names(disagreements(figures, model_figures(slow)))}
    assert {"rise_time up", "rise_time down", "static_error down", "peak up"} <= off


def test_interval_over_repeats_is_students():
    """1, 2, 3: mean 2, half width t(0.975; 2)·1/√3 = 4.3027/√3."""
    f = over_repeats("x", [1.0, 2.0, 3.0, math.nan], "s")
    assert (f.value, f.n) == (2.0, 3)
    assert f.interval[1] - 2.0 == pytest.approx(4.30265 / math.sqrt(3), rel=1e-5)


def limited_steps(limit, amplitudes, ramp=True):
    found = []
    for a in amplitudes:
        t = np.arange(-0.2, 1.0, 0.002)
        slow = np.minimum(a * (1 - np.exp(-np.clip(t, 0, None) / 0.03)), a)
        y = np.minimum(slow, limit * np.clip(t, 0, None)) if ramp else slow
        found += cut_steps(t, y, [-1.0, 0.0], [0.0, a])
    return found


def test_slew_rate_and_knee_of_a_limited_servo():
    slew, knee = slew_figures(limited_steps(4.0, np.geomspace(0.02, 1.0, 12)))
    assert slew.value == pytest.approx(4.0, rel=0.05)
    # an exponential of 30 ms passes its middle 60 % at amplitude/69 ms
    assert knee.value == pytest.approx(4.0 * 0.0693, rel=0.25)


def test_an_unlimited_servo_has_no_knee():
    _, knee = slew_figures(limited_steps(4.0, np.geomspace(0.02, 1.0, 12), ramp=False))
    assert math.isnan(knee.value)


def staircase(band, rng):
    """Down a staircase of ever smaller steps; a dead band swallows what is below it."""
    sizes = np.repeat(np.geomspace(0.02, 0.0005, 10), 2) * np.tile([1, -1], 10)
    t = np.arange(0.0, 21.0, 0.01)
    at = np.arange(1.0, 21.0)
    u = np.cumsum(sizes)
    held, y = 0.0, np.zeros(len(t))
    for begin, target in zip(at, u, strict=True):
        if abs(target - held) > band:
            held = target
        y[t >= begin] = held
    y = y + 5e-5 * rng.normal(size=len(t))
    return cut_steps(t, y, np.append(0.0, at), np.append(0.0, u))


def test_threshold_lies_between_the_last_failure_and_the_first_success():
    band = 0.004
    threshold, resolution = staircase_figures(staircase(band, np.random.default_rng(0)))
    for f in (threshold, resolution):
        assert f.interval[0] <= band * 1.01 < f.interval[1] * 1.01
        assert f.value == f.interval[1]


def test_a_staircase_of_one_step_tells_nothing():
    with pytest.raises(AnalysisError, match="three amplitudes"):
        staircase_figures(staircase(0.0, np.random.default_rng(0))[:2])


def test_hysteresis_is_the_gap_between_directions():
    sweep = np.concatenate([np.linspace(-1, 1, 200), np.linspace(1, -1, 200)])
    way = np.repeat([1.0, -1.0], 200)
    found = hysteresis(sweep, 0.9 * sweep - 0.01 * way, way)
    assert found.value == pytest.approx(0.02, rel=0.05)
    with pytest.raises(AnalysisError, match="from below and from above"):
        hysteresis(sweep, sweep, np.ones(400))


def test_linearity_is_the_worst_distance_from_the_best_line():
    u = np.linspace(-1, 1, 41)
    gain, null, worst = linearity(u, 2.0 * u + 0.1 + 0.02 * (-1.0) ** np.arange(41))
    assert gain.value == pytest.approx(2.0, abs=1e-3)
    assert null.value == pytest.approx(0.1, abs=1e-3)
    assert worst.value == pytest.approx(100 * 0.02 / 4.0, rel=0.1)


def test_cross_coupling_is_of_the_commanded_axis():
    found = cross_coupling([[1.0, 0.05], [-0.02, 0.5]])
    assert value(found, "coupling x→y") == pytest.approx(-2.0)
    assert value(found, "coupling y→x") == pytest.approx(10.0)
    with pytest.raises(AnalysisError, match="square"):
        cross_coupling([[1.0, 2.0]])


def test_repeatability_is_iso_9283s():
    """l = 1, 0, 1 around mean 0: l̄ = 2/3, S_l = √(1/3); RP = 2/3 + 3·0.57735."""
    found = repeatability(0.5, [-1.0, 0.0, 1.0], [0.0, 1.0, 2.0])
    assert value(found, "repeatability RP from below") == pytest.approx(2 / 3 + 3 / math.sqrt(3))
    assert value(found, "accuracy AP from below") == pytest.approx(-0.5)
    assert value(found, "variation vAP") == pytest.approx(1.0)
    with pytest.raises(AnalysisError, match="3 or more"):
        repeatability(0.0, [1.0, 2.0])


@pytest.mark.parametrize("n", [3, 5, 8])
def test_intervals_of_few_places_hold_the_truth_in_95_of_100(n):
    """1000 each: 95 % ± 2 % is three standard deviations."""
    rng = np.random.default_rng(n)
    u = np.linspace(-0.1, 0.1, n)
    both, way = np.tile(u, 2), np.repeat([1.0, -1.0], n)
    held = {"gain": 0, "null offset": 0, "hysteresis": 0, "accuracy AP from below": 0}
    true = {"gain": 1.0, "null offset": 0.0, "hysteresis": 4e-3, "accuracy AP from below": 0.0}
    for _ in range(1000):
        noise = 1e-3 * rng.normal(size=4 * n)
        figures = (
            *linearity(u, u + noise[:n]),
            hysteresis(both, both - 2e-3 * way + noise[n : 3 * n], way),
            *repeatability(0.0, noise[3 * n :]),
        )
        for f in figures:
            if f.name in held:
                held[f.name] += f.interval[0] <= true[f.name] <= f.interval[1]
    assert {name: 930 <= count <= 970 for name, count in held.items()} == dict.fromkeys(held, True)


def test_cosine_loss_of_eight_degrees_is_one_percent():
    assert cosine_loss(math.radians(8.0)).value == pytest.approx(0.9732, abs=1e-4)


def test_step_response_equals_python_control_behind_its_delay():
    time, response = step_response(SECOND)
    _, other = control.step_response(control.tf(SECOND.num, SECOND.den), time[1:] - 0.012)
    assert response[1:] == pytest.approx(other, abs=1e-9)


def test_one_clean_step_equals_the_model():
    t, y, at, u = raw_steps(np.random.default_rng(0), noise=0.0)
    first = measure(cut_steps(t, y, at, u)[0])
    model = model_step_metrics(SECOND)
    assert first.rise_time == pytest.approx(model.rise_time, rel=1e-3)
    assert first.overshoot == pytest.approx(model.overshoot, abs=0.05)


def test_a_step_within_the_backlash_has_a_static_error_and_nothing_else():
    rng, t = np.random.default_rng(3), np.arange(0.0, 0.6, 0.002)
    steps = []
    for asked, reached in ((0.1, 0.095), (0.005, 0.0006)) * 4:
        angle = reached * (1.0 - np.exp(-t / 0.02)) + 1e-4 * rng.standard_normal(len(t))
        steps.append(Step(t, angle, 1e-4 * rng.standard_normal(100), 0.0, asked))
    figures = {(f.name, round(f.amplitude, 3)): f for f in step_figures(steps)}
    assert figures["rise_time up", 0.1].value == pytest.approx(0.02 * np.log(9.0), rel=0.05)
    assert figures["static_error up", 0.005].value == pytest.approx(0.0044, abs=1e-4)
    small = [f for (name, at), f in figures.items() if at == 0.005 and "static" not in name]
    assert small
    assert all(np.isnan(f.value) for f in small)


def test_intervals_of_what_cannot_be_negative_begin_at_zero():
    t = np.arange(0.0, 0.6, 0.002)
    steps = [
        Step(t, 0.1 * (1.0 - np.exp(-np.maximum(t - late, 0.0) / 0.01)), np.zeros(9), 0.0, 0.1)
        for late in (0.002, 0.002, 0.04)
    ]
    (dead,) = [f for f in step_figures(steps) if f.name == "dead_time up"]
    assert dead.interval[0] == 0.0
    assert dead.interval[1] > dead.value


@pytest.mark.parametrize(
    ("x", "says"),
    [
        ([], "0 points"),
        ([0.1], "1 point"),
        ([0.0, 0.09], "2 points"),
        ([0.1] * 4, "4 equal points"),
    ],
)
def test_too_few_points_for_a_line_are_told_without_a_number_in_another_unit(x, says):
    with pytest.raises(AnalysisError, match=f"^{says}; a line needs three that differ$"):
        linearity(x, x)
