"""Excitation signals against what the literature says they are."""

import math
from types import SimpleNamespace
from typing import get_args

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from analysis.recording import TimeSeries
from twin.config import Signal
from twin.errors import TwinError
from twin.evaluation.compare import _repeats_begin
from twin.experiments.excitation import Excitation

TICK = 0.002
SIGNALS = get_args(Signal)


def sampled(plan, axis: int = 0) -> np.ndarray:
    """Command at every tick (n,), as a seat sees it."""
    ticks = np.arange(round(plan.duration / TICK)) * TICK
    rows = np.searchsorted(plan.times, ticks + 5e-10, side="right") - 1
    return plan.angles[rows, axis]


def period(signal: str, **settings) -> np.ndarray:
    """One period on axis x, without the rest around it."""
    e = Excitation(signal, axis="x", repeats=1, hold=0.5, **settings)
    return sampled(e.plan(TICK))[250:-250]


def test_steps_go_to_both_sides_and_back_axis_by_axis():
    plan = Excitation("steps", amplitude=0.1, repeats=2, hold=0.5).plan(TICK)
    x = [0, 0.1, 0, -0.1, 0, 0.1, 0, -0.1, 0]
    np.testing.assert_array_equal(plan.angles[:, 0], x + [0] * 8)
    np.testing.assert_array_equal(plan.angles[:, 1], [0] * 8 + x)
    held = np.diff(plan.times)
    assert held.min() >= 0.5 - 1e-12  # at least as long as asked
    assert np.delete(held, 8).max() < 0.5 + 0.02  # and a pulse frame longer at most
    assert 1.5 - 1e-12 <= held[8] < 1.52  # last zero, rest after x, rest before y


def test_after_three_repeats_comes_one_of_half_the_size():
    plan = Excitation("steps", amplitude=0.1, axis="x", repeats=4, hold=0.5).plan(TICK)
    reached = plan.angles[1::2, 0]
    np.testing.assert_allclose(reached, np.outer([0.1, 0.1, 0.1, 0.05, 0.1], [1, -1]).ravel())


@pytest.mark.parametrize("repeats", [1, 2, 3, 6])
def test_compare_cuts_steps_where_each_of_their_repeats_begins(repeats):
    plan = Excitation("steps", amplitude=0.1, axis="x", repeats=repeats, hold=0.5).plan(TICK)
    command = TimeSeries("gimbal/command", plan.times, plan.angles[:, :1], "rad", ("x",))
    asked = SimpleNamespace(setting={"repeats": repeats, "signal": "steps"}.get)
    edges = _repeats_begin(SimpleNamespace(command=command, recording=asked), "x")
    begun = plan.times[1::4]  # up, zero, down, zero
    assert len(edges) == len(begun) + 1 == repeats + repeats // 3 + 1
    np.testing.assert_allclose(edges[:-1], begun, atol=0.05)  # phases over the pulse frame


def test_no_hold_is_shorter_than_asked_where_ticks_do_not_divide_it():
    plan = Excitation("steps", amplitude=0.1, repeats=2, hold=0.013).plan(0.004)
    assert np.diff(plan.times).min() >= 0.016 - 1e-12


def waits(plan, latest: float) -> np.ndarray:
    """How long each change waits for the frames of a rig that begin at `latest` + 20 ms · k."""
    return (latest - plan.times[1:]) % 0.02


@pytest.mark.parametrize("hold", [0.5, 0.8, 0.337])
@pytest.mark.parametrize("latest", [0.0, 0.0007, 0.0133])
def test_steps_wait_half_a_pulse_frame_on_average_wherever_a_rig_begins_its_frames(hold, latest):
    """Ten phases 2 ms apart average to 10 ± 1 ms for any rig; 24 changes on them to 0.5 ms more.

    Multiples of 20 ms would all wait alike, anything from 0 to 20 ms.
    """
    for seed in range(5):
        plan = Excitation("steps", repeats=3, hold=hold, seed=seed).plan(TICK)
        assert waits(plan, latest).mean() == pytest.approx(0.01, abs=1.5e-3)
        for axis in (0, 1):
            own = np.flatnonzero(np.diff(plan.angles[:, axis]) != 0.0)
            assert waits(plan, latest)[own].mean() == pytest.approx(0.01, abs=2e-3)


def test_repeats_of_one_step_wait_differently_as_evenly_as_they_can():
    """Three and one of half the size: one in each quarter of the frame, for each of the moves."""
    plan = Excitation("steps", axis="x", repeats=3, hold=0.5, seed=3).plan(0.0005)
    phase = (plan.times[1:] % 0.02).reshape(4, 4)  # repeats, moves
    np.testing.assert_array_equal(
        np.sort(phase // 0.005, axis=0), np.arange(4)[:, None] + phase[:1] * 0
    )
    gaps = np.diff(np.sort(phase.ravel()))
    np.testing.assert_allclose(
        gaps, 0.02 / 16, atol=0.0005 + 1e-9
    )  # a tick: commands come at ticks


def test_a_staircase_and_a_prbs_meet_every_phase_of_the_pulse_frame():
    for e in (
        Excitation("staircase", hold=0.4, repeats=1),
        Excitation("prbs", band=(0.5, 0.443 / 0.04)),  # its natural clock is two frames
    ):
        phases = np.unique(np.rint(e.plan(TICK).times[1:] / TICK) % 10)
        np.testing.assert_array_equal(phases, np.arange(10))


def test_a_prbs_has_the_autocorrelation_of_a_maximum_length_sequence():
    """Golomb: N ones of A², and −A²/N at every other shift; exact but for rounding."""
    wave = period("prbs", amplitude=0.05, band=(0.5, 8.0))
    clock = 27  # 0.443/8 Hz are 27.7 ticks; 28 would share a divisor with the ten of a frame
    chips = wave[::clock]
    n = len(chips)
    assert np.array_equal(np.repeat(chips, clock), wave)
    assert math.log2(n + 1).is_integer()
    assert 1.0 / (n * clock * TICK) <= 0.5  # line spacing: no wider than asked
    correlation = [chips @ np.roll(chips, k) / n for k in range(n)]
    np.testing.assert_allclose(correlation[0], 0.05**2, rtol=1e-12)
    np.testing.assert_allclose(correlation[1:], -(0.05**2) / n, rtol=1e-9)


def test_a_multisine_has_equal_lines_where_asked_and_none_elsewhere():
    wave = period("multisine", amplitude=0.05, band=(0.5, 10.0))
    lines = np.abs(np.fft.rfft(wave))
    wanted = np.zeros(len(lines), bool)
    wanted[1:21] = True  # 0.5 to 10 Hz in steps of 0.5 Hz
    np.testing.assert_allclose(lines[wanted], lines[1], rtol=1e-9)
    assert lines[~wanted].max() < 1e-9 * lines[1]


@pytest.mark.parametrize("seed", range(5))
def test_a_multisine_uses_its_amplitude_well(seed):
    """Crest below Schroeder's 1.66 (IEEE Trans. Inf. Theory 16, 1970); random phases give 2.5."""
    wave = period("multisine", amplitude=0.05, band=(0.2, 10.0), seed=seed)
    assert np.abs(wave).max() == pytest.approx(0.05, rel=1e-12)
    assert np.abs(wave).max() / np.sqrt(np.mean(wave**2)) < 1.66


def test_a_chirp_takes_as_long_for_every_octave():
    """Frequency between zero crossings follows f₀(f₁/f₀)^(t/T); 1 %: crossings interpolated."""
    low, high, duration = 0.5, 8.0, 40.0
    wave = period("chirp", amplitude=0.05, band=(low, high), duration=duration)
    t = np.arange(len(wave)) * TICK
    k = np.flatnonzero(np.diff(np.signbit(wave)))
    crossing = t[k] - wave[k] * TICK / (wave[k + 1] - wave[k])
    seen = 0.5 / np.diff(crossing)
    middle = 0.5 * (crossing[1:] + crossing[:-1])
    np.testing.assert_allclose(seen, low * (high / low) ** (middle / duration), rtol=0.01)


def test_a_staircase_descends_evenly_to_the_smallest_step():
    wave = period("staircase", amplitude=0.08, smallest=0.001)
    begins = np.flatnonzero(np.diff(wave, prepend=0.0))
    levels = wave[begins]
    sizes = levels[::4]
    np.testing.assert_array_equal(levels[2::4], -sizes)
    assert not levels[1::4].any()
    assert not levels[3::4].any()
    assert sizes[0] == 0.08
    assert sizes[-1] == pytest.approx(0.001, rel=1e-9)
    np.testing.assert_allclose(sizes[1:] / sizes[:-1], sizes[1] / sizes[0], rtol=1e-9)
    assert sizes[0] / sizes[1] == pytest.approx(math.sqrt(2.0), rel=0.05)


def test_a_triangle_moves_at_one_speed():
    wave = period("triangle", amplitude=0.1, duration=8.0)
    speed = np.abs(np.diff(wave)) / TICK
    np.testing.assert_allclose(np.delete(speed, [999, 2999]), 4 * 0.1 / 8.0, rtol=1e-9)
    assert wave.max() == pytest.approx(0.1)
    assert wave.min() == pytest.approx(-0.1)


def test_a_dog_leg_bends_from_one_speed_to_a_third_of_it():
    speed = np.diff(period("dog-leg", amplitude=0.1, duration=24.0)) / TICK
    seen = np.unique(np.abs(speed).round(9))
    np.testing.assert_allclose(seen, [0.0, 0.05 / 3.0, 0.05], atol=2e-9)


@pytest.mark.parametrize("signal", SIGNALS)
def test_a_rate_limit_holds_for_every_signal(signal):
    limit = 0.4
    plan = Excitation(signal, amplitude=0.1, rate_limit=limit, duration=5.0).plan(TICK)
    speed = np.diff(np.concatenate([[0.0], sampled(plan)])) / TICK
    assert np.abs(speed).max() <= limit * (1 + 1e-9)


@settings(max_examples=25, deadline=None)
@given(
    signal=st.sampled_from(SIGNALS),
    amplitude=st.floats(1e-4, math.radians(10.0)),
    axis=st.sampled_from(["x", "y", "both"]),
    seed=st.integers(0, 2**63 - 1),
    limit=st.none() | st.floats(1e-3, 1e3),
)
def test_every_signal_stays_within_its_amplitude_and_starts_and_ends_at_rest(
    signal, amplitude, axis, seed, limit
):
    e = Excitation(signal, amplitude, axis, 1, 0.05, 2.0, (1.0, 10.0), amplitude / 10, limit, seed)
    plan = e.plan(TICK)
    assert np.abs(plan.angles).max() <= amplitude
    assert not plan.angles[0].any()
    assert plan.times[0] == 0.0
    assert (np.diff(plan.times) > 0).all()
    assert not (plan.angles[:, 0] * plan.angles[:, 1]).any()  # one axis at a time
    if limit is None:
        assert not plan.angles[-1].any()
    if axis != "both":
        assert not plan.angles[:, 1 if axis == "x" else 0].any()


@pytest.mark.parametrize("signal", ["prbs", "multisine", "steps"])
def test_a_seed_repeats_itself_and_another_differs(signal):
    one, same, other = (sampled(Excitation(signal, seed=s).plan(TICK)) for s in (1, 1, 2))
    np.testing.assert_array_equal(one, same)
    assert not np.array_equal(one, other)


@pytest.mark.parametrize(
    ("settings", "says"),
    [
        ({"signal": "sine"}, "must be one of steps, staircase"),
        ({"amplitude": -0.2}, "--amplitude-deg -11.4592: must be greater than zero"),
        ({"band": (5.0, 1.0)}, "--band-hz 5 1"),
        ({"signal": "chirp", "band": (1.0, 400.0)}, "at most 125"),
        ({"signal": "staircase", "smallest": 0.5}, "--smallest-deg"),
        ({"rate_limit": 0.0}, "--rate-limit-deg-s 0"),
        ({"repeats": 10_000, "hold": 100.0}, "at most 3600 s"),
        ({"seed": -1}, "--seed -1"),
    ],
    ids=str,
)
def test_what_cannot_be_is_told_with_its_flag(settings, says):
    with pytest.raises(TwinError) as told:
        Excitation(**settings).plan(TICK)
    assert says in str(told.value)
    assert "\n" not in str(told.value)
