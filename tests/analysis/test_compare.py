"""Two motions side by side against shifts, gains and noises that are known."""

import json
import math

import control
import numpy as np
import pytest

from analysis.comparison.compare import compare, errors
from analysis.comparison.motion import bridged
from analysis.recording import TimeSeries
from analysis.schema import AnalysisError

T = np.arange(0.0, 20.0, 0.005)


def wave(t, rng=None):
    """Smooth and broad-band up to 4 Hz."""
    rng = np.random.default_rng(5)
    parts = rng.uniform(0.1, 4.0, 40), rng.uniform(0.0, 2 * math.pi, 40)
    return sum(np.sin(2 * math.pi * f * t + p) for f, p in zip(*parts, strict=True)) / 10.0


def motion(values, t=T, components=("x",), name="a"):
    values = np.asarray(values)
    return TimeSeries(name, t, values.reshape(len(values), -1), "rad", components)


def test_a_shift_of_a_third_of_a_sample_is_reported_and_taken_out():
    """20 µs: linear interpolation between samples of 5 ms."""
    shift = 0.0217
    found = compare(motion(wave(T)), motion(wave(T - shift), name="b")).axes[0]
    assert found.delay == pytest.approx(shift, abs=2e-5)
    assert found.aligned.fit > 99.5
    assert found.as_is.fit < 90.0


def test_equal_motions_fit_whole():
    found = compare(motion(wave(T)), motion(wave(T)))
    assert found.fit == pytest.approx(100.0)
    assert found.axes[0].delay == pytest.approx(0.0, abs=1e-6)


def test_errors_are_their_definitions():
    e = errors([0.0, 1.0, 2.0, 3.0], [0.5, 1.5, 2.5, 2.5])
    assert (e.rmse, e.mae, e.worst) == (0.5, 0.5, 0.5)
    assert e.fit == pytest.approx(100 * (1 - 1.0 / math.sqrt(5.0)))
    assert e.vaf == pytest.approx(100 * (1 - np.var([0.5, 0.5, 0.5, -0.5]) / 1.25))
    assert e.fit_moving == pytest.approx(100 * (1 - math.sqrt(0.75 / 5.0)))
    assert errors([0.0, 1.0, 2.0, 3.0], [1.0, 2.0, 3.0, 4.0]).fit_moving == pytest.approx(100.0)


def test_a_constant_reference_has_no_fit():
    assert math.isnan(errors(np.ones(20), np.ones(20)).fit)


@pytest.mark.parametrize("order", ["xy", "yx"])
def test_an_axis_that_was_to_stand_still_counts_for_no_fit_and_has_no_delay(order):
    """Its noise fits another's to −41 %: |a − b|/|a| = √2."""
    rng = np.random.default_rng(0)

    def one():
        columns = {"x": wave(T), "y": 1e-3 * rng.normal(size=len(T))}
        return motion(np.stack([columns[c] for c in order], 1), T, tuple(order))

    found = compare(one(), one(), still="y")
    assert found.fit == pytest.approx(100.0)
    assert found.uncounted == {"y": "not commanded"}
    still = next(a for a in found.axes if a.axis == "y")
    assert still.as_is.fit == pytest.approx(-41.0, abs=3.0)
    assert math.isnan(still.delay)
    assert still.aligned == still.as_is
    json.dumps(found.to_dict(), allow_nan=False)


@pytest.mark.parametrize("order", [[0, 1], [1, 0]])
def test_a_reference_that_stood_still_has_no_fit_in_any_order(order):
    both = np.stack([wave(T), 0.0 * T], 1)[:, order]
    a, b = (motion(gain * both, T, ("x", "y")) for gain in (1.0, 0.5))
    found = compare(a, b)
    assert found.fit == pytest.approx(50.0, abs=1.0)
    assert list(found.uncounted.values()) == ["the reference stood still"]
    assert math.isnan(compare(a, b, still="xy").fit)


def test_nothing_is_compared_in_a_hole_of_the_other():
    """6 of 20 s are missing; what is left is the same motion, 12 ms late."""
    there = (T < 5.0) | (T > 11.0)
    other = motion(wave(T - 0.012)[there], T[there], name="b")
    found = compare(motion(wave(T)), other).axes[0]
    assert found.left_out == pytest.approx(0.3, abs=1e-3)
    assert found.samples == there.sum()
    assert found.delay == pytest.approx(0.012, abs=2e-5)
    assert found.aligned.fit > 99.5
    assert np.median(found.spectrum.coherence[found.spectrum.frequency < 3.0]) > 0.99
    straight = bridged(T, other.time, other.values[:, 0])
    assert np.isnan(straight).tolist() == (~there).tolist()


def test_single_lost_readings_and_bursts_are_no_holes():
    rng = np.random.default_rng(2)
    kept = rng.random(len(T)) > 0.2
    bursts = np.sort(np.concatenate([T[::4] + d for d in (0.0, 1e-4, 2e-4)]))
    for stamps in (T[kept], bursts):
        other = motion(wave(stamps), stamps, name="b")
        assert compare(motion(wave(T)), other).axes[0].left_out == 0.0


@pytest.mark.parametrize("count", [6, 10, 20])
def test_stamps_of_arrival_in_long_bursts_have_no_holes_between_them(count):
    """As a serial adapter hands them out: nothing for a while, then all at once."""
    whole = np.arange(0.0, 20.0, 0.002)
    arrived = np.repeat(whole[count - 1 :: count], count) + 1e-4 * np.tile(
        np.arange(count), len(whole[count - 1 :: count])
    )
    other = motion(wave(whole[: len(arrived)]), arrived, name="b")
    found = compare(motion(wave(whole), whole), other).axes[0]
    assert found.left_out == pytest.approx(0.0, abs=1e-3)
    kept = (arrived < 5.0) | (arrived > 9.0)  # and a hole is one all the same
    holed = motion(other.values[kept], arrived[kept], name="b")
    assert compare(motion(wave(whole), whole), holed).axes[0].left_out > 0.19


def test_gain_and_phase_are_those_of_the_system_between():
    """0.5 dB and 4° where coherence is high: Welch's window smears over 0.35 Hz."""
    rng = np.random.default_rng(0)
    u = np.repeat(rng.normal(size=4000), 5)
    t = np.arange(len(u)) * 0.005
    g = control.tf([400.0], [1.0, 20.0, 400.0])
    _, y = control.forced_response(control.ss(g).sample(0.005, "zoh"), U=u)
    spectrum = compare(motion(u, t), motion(np.asarray(y), t)).axes[0].spectrum
    for hertz in (0.5, 1.0, 2.0):
        k = int(np.argmin(np.abs(spectrum.frequency - hertz)))
        exact = g(2j * math.pi * spectrum.frequency[k])
        assert spectrum.gain[k] == pytest.approx(20 * math.log10(abs(exact)), abs=0.5)
        assert spectrum.phase[k] == pytest.approx(math.degrees(np.angle(exact)), abs=4.0)
        assert spectrum.coherence[k] > 0.95


def steps(hold=0.5, seconds=30.0):
    """Answers of a second-order gimbal to steps up and back, each held so long."""
    t = np.arange(0.0, seconds, 0.005)
    size, part = np.array([1, -2, 4, -6, 3, -1, 6, -4, 2, 0.0]), (t / hold + 1e-9).astype(int)
    command = np.where(part % 2 == 1, size[part // 2 % 10], 0.0)
    g = control.tf([1600.0], [1.0, 48.0, 1600.0])
    _, y = control.forced_response(control.ss(g).sample(0.005, "zoh"), U=command)
    return t, np.asarray(y).ravel()


@pytest.mark.parametrize("noise", [0.02, 0.1])
def test_intervals_of_gain_and_phase_hold_the_truth_where_there_is_power(noise):
    """Two readings of one motion: 0 dB and 0°."""
    rng, inside = np.random.default_rng(0), []
    t, y = steps()
    for _ in range(60):
        a, b = (motion(y + noise * rng.standard_normal(len(t)), t) for _ in range(2))
        s = compare(a, b).axes[0].spectrum
        for hertz in (0.5, 1.0, 3.0, 5.0):
            k = int(np.argmin(np.abs(s.frequency - hertz)))
            assert s.power[k] > 0.05
            inside += [abs(s.gain[k]) < s.gain_error[k], abs(s.phase[k]) < s.phase_error[k]]
    assert 0.93 < np.mean(inside) <= 0.99


def test_nulls_of_held_steps_have_no_power():
    """A command held for 0.5 s has the spectrum sin(πf/2)/(πf): zero at 2, 4, 6 Hz."""
    t, y = steps()
    noisy = y + 0.02 * np.random.default_rng(0).standard_normal(len(t))
    s = compare(motion(noisy, t), motion(y, t)).axes[0].spectrum
    at = {
        f: s.power[int(np.argmin(np.abs(s.frequency - f)))] for f in (0.5, 1.5, 2, 2.5, 4, 4.5, 6)
    }
    assert max(at[2], at[4], at[6]) < 0.02
    assert min(at[0.5], at[1.5], at[2.5], at[4.5]) > 0.5


def test_noise_alone_has_no_coherence():
    rng = np.random.default_rng(0)
    found = compare(motion(rng.normal(size=4000)), motion(rng.normal(size=4000)))
    assert np.median(found.axes[0].spectrum.coherence) < 0.5


def test_repeats_are_judged_one_by_one():
    y = wave(T)
    worse = y.copy()
    worse[T >= 10.0] += 0.1
    found = compare(motion(y), motion(worse), repeats={"x": [0.0, 5.0, 10.0, 15.0, 20.0]}).axes[0]
    assert [round(r.worst, 6) for r in found.repeats] == [0.0, 0.0, 0.1, 0.1]


def test_other_stamps_and_missing_readings_are_bridged():
    rng = np.random.default_rng(1)
    other = np.sort(rng.uniform(-1.0, 21.0, 9000))
    y = wave(T)
    y[100:120] = math.nan
    found = compare(motion(y), motion(wave(other), other)).axes[0]
    assert found.samples == len(T) - 20
    assert found.as_is.fit > 99.0


def test_axes_are_matched_by_name():
    a = motion(np.stack([wave(T), -wave(T)], 1), T, ("x", "y"))
    b = motion(np.stack([-wave(T), wave(T)], 1), T, ("y", "x"), "b")
    assert compare(a, b).fit == pytest.approx(100.0)


def test_no_axis_in_common_says_which_there_are():
    with pytest.raises(AnalysisError, match="a has x; b has roll"):
        compare(motion(wave(T)), motion(wave(T), components=("roll",), name="b"))


def test_no_time_in_common_says_what_is_covered():
    with pytest.raises(AnalysisError, match=r"0 samples in common; a covers 0 to .*b 100 to"):
        compare(motion(wave(T)), motion(wave(T), T + 100.0, name="b"))


@pytest.mark.parametrize(
    ("time", "values", "said"),
    [
        (T[:5], wave(T)[:5], "5 readings; 16 are needed"),
        (T, np.full(len(T), math.nan), "0 readings"),
    ],
)
def test_too_few_readings_of_an_axis_are_refused(time, values, said):
    with pytest.raises(AnalysisError, match=said):
        compare(motion(values, time), motion(wave(T)))


@pytest.mark.parametrize("limit", [60.0, 90.0, 95.0])
def test_a_wrong_axis_counts_whatever_is_asked_and_one_within_its_noise_does_not(limit):
    """0.6° rms with 0.05° of noise: a mirrored model of it is no matter of noise."""
    rng = np.random.default_rng(8)
    y, noise = math.radians(0.6) * wave(T) / wave(T).std(), math.radians(0.05)
    seen = y + rng.normal(0.0, noise, T.size)
    mirrored = compare(motion(seen), motion(-y), noise={"x": noise}, limit=limit)
    assert mirrored.fit < 0.0
    whole = compare(motion(seen), motion(y), noise={"x": noise}, limit=limit)
    assert ("x" in whole.uncounted) == (whole.axes[0].reachable < limit)
    assert whole.axes[0].reachable == pytest.approx(100 * (1 - 0.05 / 0.6), abs=0.3)


@pytest.mark.parametrize(("moved", "off", "hardly"), [(0.09, 0.0, 1), (0.11, 0.0, 0), (0.09, 2, 0)])
def test_an_axis_hardly_moves_below_twice_the_difference_that_matters(moved, off, hardly):
    """Half as large a motion of the other: rms of the first one is that of the larger."""
    y = math.radians(moved) * wave(T) / wave(T).std()
    found = compare(motion(y), motion(0.5 * y + math.radians(off)), tolerance=math.radians(0.05))
    assert found.axes[0].hardly_moved == bool(hardly)
    said = {"x": "hardly moved, 0.09° rms; differences below 0.05° do not matter"}
    assert found.uncounted == (said if hardly else {})


def test_the_numbers_are_json():
    json.dumps(compare(motion(wave(T)), motion(wave(T - 0.01))).to_dict(), allow_nan=False)
