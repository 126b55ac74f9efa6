"""What a linear fit says of records whose gain, sensor or sampling it cannot take as they are."""

import re

import numpy as np
import pytest

from analysis.identify import expectations, identify, without_frozen
from analysis.recording import measurement
from tests.benchmarks.identification import Gimbal, moved, random_steps

PERIOD, LENGTH, NOISE = 0.01, 20.0, np.radians(0.02)


def commands(seed, largest=3.0, lasting=LENGTH):
    """Instants (k,) [s] and sizes (k, 1) [rad] of steps."""
    at, u = random_steps(np.random.default_rng(seed), lasting, 0.5, largest)
    return at, u


def record(seed, at, given, felt=None, frequency=25.0, damping=0.7, period=PERIOD):
    """Readings (n,) of a gimbal of gain 1 that answers `felt` where it does not feel `given`."""
    t = np.arange(0.0, LENGTH, period)
    g = Gimbal(frequency, damping, 0.02, 1.0)
    angle = moved([g], t, at, given if felt is None else felt)[0][:, None]
    angle = angle + NOISE * np.random.default_rng(seed + 100).normal(size=angle.shape)
    return measurement(t, given, command_time=at, before=[0.0], angle=angle)


def held(u, band):
    """Commands (k, 1) as a servo takes them that ignores less than `band` from the one it holds."""
    out, last = np.empty_like(u), 0.0
    for k, value in enumerate(u[:, 0]):
        last = value if abs(value - last) > band else last
        out[k] = last
    return out


def shifted(u, band):
    """Commands (k, 1) behind a dead zone around zero."""
    return np.sign(u) * np.clip(np.abs(u) - band, 0.0, None)


def bent(model):
    return [w for w in model.warnings if "gain depends on the amplitude" in w]


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("kind", [held, shifted])
def test_a_hard_dead_band_of_a_third_of_the_commands_is_named_with_what_fits_it(kind, seed):
    """1° under commands up to 3°; without it nothing is said, nor under a band of 1 %."""
    at, u = commands(seed)
    band = np.radians(1.0)
    (said,) = bent(identify([record(seed, at, u, kind(u, band))]))
    assert "--servo" in said
    for none in (0.0, 0.01 * band):
        assert not bent(identify([record(seed, at, u, kind(u, none))]))


@pytest.mark.thorough
@pytest.mark.parametrize("noisy", [False, True])
@pytest.mark.parametrize("lost", [(3.2, 7.9), (0.0, 4.0), (15.0, 20.0)])
def test_a_sensor_that_stands_still_is_named_and_its_readings_do_not_count(lost, noisy):
    """One that is cut off still shows noise, and counts from where the gimbal rested before."""
    at, u = commands(1)
    good = record(1, at, u)
    angle = good.angles.values.copy()
    rows = np.flatnonzero((good.time >= lost[0]) & (good.time <= lost[1]))
    angle[rows] = angle[rows[0]]
    if noisy:
        angle[rows] += NOISE * np.random.default_rng(0).normal(size=angle[rows].shape)
    bad = measurement(good.time, u, command_time=at, before=[0.0], angle=angle)
    model = identify([bad])
    (said,) = (w for w in model.warnings if "does not move" in w)
    low, high = (float(n) for n in re.findall(r"between (\S+) and (\S+) s", said)[0])
    rest = 0.5 if noisy else 0.0  # s between commands
    assert good.time[rows[0]] - rest - 5e-3 <= low <= good.time[rows[0]] + 5e-3
    assert good.time[rows[-1]] - 5e-3 <= high <= good.time[rows[-1]] + rest + 5e-3
    assert abs(model.estimate("x/x gain").value - 1.0) < 3.0 * model.estimate("x/x gain").std
    assert model.fit > 98.0
    assert not any("poor fit" in w for w in model.warnings)
    if lost == (3.2, 7.9) and not noisy:  # five seconds each
        assert all(e.enough for e in expectations([bad]) if e.name == "x/x gain")


def test_a_gimbal_that_rests_under_small_commands_is_no_frozen_sensor():
    """Noise-free and rounded readings stand still between steps and in a dead band."""
    at, u = commands(2)
    t = np.arange(0.0, LENGTH, PERIOD)
    angle = moved([Gimbal(25.0, 0.7, 0.02, 1.0)], t, at, held(u, np.radians(0.5)))[0][:, None]
    angle = np.round(angle / np.radians(0.1)) * np.radians(0.1)
    r = measurement(t, u, command_time=at, before=[0.0], angle=angle)
    kept, said = without_frozen([r])
    assert (kept, said) == ([r], [])


@pytest.mark.parametrize(("frequency", "coarse"), [(400.0, True), (150.0, True), (60.0, False)])
def test_motion_beyond_the_sampling_is_called_not_determined(frequency, coarse):
    """Readings every 10 ms: 4, 1.5 and 0.6 rad of the motion."""
    at, u = commands(3)
    model = identify([record(3, at, u, frequency=frequency)])
    said = [w for w in model.warnings if "beyond the sampling (10 ms between readings)" in w]
    assert bool(said) is coarse
    faster = identify([record(3, at, u, frequency=frequency, period=0.2 / frequency)])
    assert not any("beyond the sampling" in w for w in faster.warnings)


def identified(good, angle, at, u):
    """The model, and what is said of the sensor."""
    bad = measurement(good.time, u, command_time=at, before=[0.0], angle=angle)
    model = identify([bad])
    return model, [w for w in model.warnings if "angle 'x' " in w]


@pytest.mark.parametrize("every", [15, 60])
@pytest.mark.parametrize("mark", [-9999.0, 17.4533])
def test_marks_of_missing_readings_do_not_count(every, mark):
    at, u = commands(4)
    good = record(4, at, u)
    angle = good.angles.values.copy()
    angle[::every] = mark
    model, (said,) = identified(good, angle, at, u)
    assert f"a mark far beyond all others in {len(angle[::every])} samples" in said
    assert abs(model.estimate("x/x gain").value - 1.0) < 3.0 * model.estimate("x/x gain").std
    assert model.axes[0].spikes == 0


def test_an_angle_that_passes_half_a_turn_is_counted_through():
    at, u = commands(5)
    good = record(5, at, u)
    angle = (good.angles.values + 3.1 + np.pi) % (2.0 * np.pi) - np.pi
    model, (said,) = identified(good, angle, at, u)
    assert "jumps by a turn" in said
    assert abs(model.estimate("x/x gain").value - 1.0) < 3.0 * model.estimate("x/x gain").std


def test_a_sensor_slower_than_its_log_is_dated_by_its_first_reading():
    """New readings every 50 ms in a log of 10 ms; held, they made the delay 15 ms longer."""
    at, u = commands(6)
    good = record(6, at, u)
    angle = np.repeat(good.angles.values[::5], 5, axis=0)
    model, (said,) = identified(good, angle, at, u)
    assert "gives each reading 5 times" in said
    for name, true in (("delay", 0.02), ("natural frequency", 25.0), ("damping", 0.7)):
        e = model.estimate(f"x/x {name}")
        assert abs(e.value - true) < 3.0 * e.std


@pytest.mark.parametrize(
    ("kind", "said"), [("drift", r"drifts by 1\.\d % of its motion per s"), ("jump", "near 1[0-1]")]
)
def test_an_offset_that_drifts_or_jumps_is_no_dead_band(kind, said):
    """By 0.06° a second, or 3° after half the record, of some 5.7° of motion."""
    at, u = commands(7)
    good = record(7, at, u)
    t = good.time[:, None]
    offset = np.radians(0.06 * t if kind == "drift" else 3.0 * (t > 10.2))
    model, _ = identified(good, good.angles.values + offset, at, u)
    assert not bent(model)
    (found,) = (w for w in model.warnings if "offset of the angle" in w)
    assert re.search(said.replace(" %", "%"), found)


def test_rounding_of_a_quiet_sensor_is_no_dead_band():
    at, u = commands(8)
    good = record(8, at, u)
    step = np.radians(0.5)
    assert not bent(identified(good, np.round(good.angles.values / step) * step, at, u)[0])
