"""Records: what is refused, and in which words."""

import math
from dataclasses import replace

import numpy as np
import pytest

from analysis.identify import IdentificationError, identify
from analysis.identify.checks import clipped
from analysis.recording import Recording, RecordingError, TimeSeries, measurement, measurement_of

T = np.arange(0.0, 4.0, 0.01)
STEPS = np.repeat([0.0, 0.1, -0.1, 0.05], 100)


def first_order(t=T, u=STEPS, tau=0.05, scale=1.0):
    y, out = 0.0, []
    for command in u:
        y += (command - y) * (1.0 - math.exp(-0.01 / tau))
        out.append(y)
    return scale * np.array(out)


def noisy(values, sigma=1e-3, seed=0):
    return values + sigma * np.random.default_rng(seed).normal(size=len(values))


def test_stamps_that_run_backwards_are_named():
    time = T.copy()
    time[50] = time[40]
    with pytest.raises(RecordingError, match=r"time runs from 0\.49 s to 0\.4 s at sample 50"):
        measurement(time, STEPS, angle=first_order())


def test_command_stamps_may_not_stand_still():
    with pytest.raises(RecordingError, match="command time runs from"):
        measurement(T, [0.0, 1.0, 0.0], command_time=[0.0, 1.0, 1.0], angle=first_order())


def test_neither_sensor_is_refused():
    with pytest.raises(RecordingError, match="neither angle nor rate"):
        measurement(T, STEPS)


def test_infinite_readings_are_refused():
    y = first_order()
    y[3] = math.inf
    with pytest.raises(RecordingError, match="infinite"):
        measurement(T, STEPS, angle=y)


def test_commands_of_another_length_are_refused():
    with pytest.raises(RecordingError, match="399 commands but 400 stamps"):
        measurement(T, STEPS[:-1], angle=first_order())


def test_a_constant_command_teaches_nothing():
    r = measurement(T, np.zeros(400), angle=noisy(np.zeros(400)))
    with pytest.raises(IdentificationError, match="'x' never changes"):
        identify([r])


def test_commands_of_another_time_are_no_commands():
    times = np.array([0.0, 1.0, 2.0, 3.0])
    for shift in (-1000.0, 1000.0):
        r = measurement(
            T, [0.0, 0.1, -0.1, 0.05], command_time=times + shift, before=[0.0],
            angle=first_order(),
        )  # fmt: skip
        with pytest.raises(IdentificationError, match="one clock"):
            identify([r])


def test_a_single_step_is_too_few_without_readings_at_rest_before_it():
    u = np.where(T < 1.0, 0.0, 0.1)
    y = noisy(0.1 * (1.0 - np.exp(-np.clip(T - 1.0 - 0.013, 0.0, None) / 0.05)))
    model = identify([measurement(T, u, angle=y, stamps="exact")], 1)
    for what, true in (("gain", 1.0), ("time constant", 0.05)):
        e = model.estimate(f"x/x {what}")
        assert abs(e.value - true) < 4.0 * e.std < 0.5 * true
    late = T > 0.97
    with pytest.raises(IdentificationError, match="changes 1 time; 2 steps or more"):
        identify([measurement(T[late], u[late], angle=y[late])])


def test_a_record_that_begins_with_its_only_step_is_fitted_with_the_command_before_it():
    """As advised: `--before 0`. The offset of 0.02 rad is known from readings within the delay."""
    y = noisy(0.02 + 0.1 * (1.0 - np.exp(-np.clip(T - 0.013, 0.0, None) / 0.08)))
    u = np.full(len(T), 0.1)
    with pytest.raises(IdentificationError, match="--before 0"):
        identify([measurement(T, u, angle=y)], 1)
    model = identify([measurement(T, u, angle=y, before=[0.0], stamps="exact")], 1)
    for what, true in (("gain", 1.0), ("time constant", 0.08)):
        e = model.estimate(f"x/x {what}")
        assert abs(e.value - true) < 4.0 * e.std < 0.5 * true


def test_missing_readings_are_counted():
    y = noisy(first_order())
    y[100:350] = math.nan
    with pytest.raises(IdentificationError, match="150 readings in 400 samples; 62 % are missing"):
        identify([measurement(T, STEPS, angle=y)])


def test_commands_that_always_move_together_cannot_be_told_apart():
    both = np.stack([STEPS, 2.0 * STEPS], axis=1)
    angle = np.stack([noisy(first_order()), noisy(first_order(), seed=1)], axis=1)
    with pytest.raises(IdentificationError, match="always move together"):
        identify([measurement(T, both, angle=angle)])


def test_records_of_other_axes_do_not_mix():
    one = measurement(T, STEPS, angle=noisy(first_order()))
    two = measurement(T, STEPS, angle=noisy(first_order()), inputs=("servo",), name="second")
    with pytest.raises(IdentificationError, match="second: commands"):
        identify([one, two])


@pytest.mark.parametrize(("scale", "said"), [(180 / math.pi, "57"), (math.pi / 180, "0.017")])
def test_a_gain_that_is_a_unit_is_said_to_be_one(scale, said):
    r = measurement(T, STEPS, angle=noisy(first_order(scale=scale), 1e-3 * scale))
    with pytest.raises(IdentificationError, match=rf"is {said}.*degrees.*radians"):
        identify([r], 1)


@pytest.mark.parametrize(
    ("scale", "said"), [(180 / math.pi, "near 57"), (-1.0, "negative"), (3, "far from 1")]
)
def test_a_gain_that_is_unlike_a_gimbal_is_doubted_where_the_units_were_given(scale, said):
    y = noisy(first_order(scale=scale), 1e-3 * abs(scale))
    r = replace(measurement(T, STEPS, angle=y), units="given")
    warnings = identify([r], 1).warnings
    assert any(said in w for w in warnings)
    assert not any("give each" in w for w in warnings)  # both were given
    volts = measurement(T, STEPS, angle=y, input_unit="1")
    assert not any("gain from" in w for w in identify([volts], 1).warnings)


def test_gyro_in_degrees_beside_angle_in_radians_is_noticed():
    y = first_order()
    rate = np.gradient(y, T) * 180 / math.pi
    r = measurement(T, STEPS, angle=noisy(y), rate=noisy(rate, 0.1))
    with pytest.raises(IdentificationError, match=r"turns 0\.017.* rate in degrees"):
        identify([r], 1)


def test_a_clipped_sensor_is_refused_with_its_level():
    y = np.clip(noisy(first_order(u=10 * STEPS, tau=0.3), 1e-4), -0.3, 0.3)
    with pytest.raises(IdentificationError, match=r"clipped at -?0\.3"):
        identify([measurement(T, 10 * STEPS, angle=y)])


def test_a_settled_quantised_plateau_is_not_clipping():
    settled = np.round(first_order() / 0.004) * 0.004
    assert not clipped(settled).any()


@pytest.mark.parametrize(
    ("poles", "zeros", "delay"), [(0, 0, "free"), (7, 0, "free"), (2, 2, "free"), (2, 0, -1.0)]
)
def test_impossible_orders_are_refused(poles, zeros, delay):
    r = measurement(T, STEPS, angle=noisy(first_order()))
    with pytest.raises(IdentificationError, match=r"possible|zeros|delay"):
        identify([r], poles, zeros, delay)


def test_a_poor_fit_is_a_result_with_a_warning():
    wander = np.cumsum(np.random.default_rng(0).normal(size=400)) * 0.01
    model = identify([measurement(T, STEPS, angle=wander + 0.1 * first_order())], 1)
    assert any("poor fit" in w for w in model.warnings)


def test_gyro_delay_is_taken_out_of_the_rate_only():
    r = measurement(T, STEPS, angle=first_order(), rate=first_order(), gyro_delay=0.0049)
    assert len(r.time) == 800
    assert np.isfinite(r.angle.values[:, 0]).sum() == 400
    assert r.rate.time == pytest.approx(T - 0.0049)


def test_commands_that_begin_after_the_samples_need_the_one_before():
    """A list of changes that begins with the first step is no list that begins at rest."""
    changes = {"angle": first_order(), "command_time": [1.0, 2.0, 3.0]}
    with pytest.raises(RecordingError, match=r"begin at 1 s, the samples at 0 s.*--before"):
        measurement(T, [0.1, -0.1, 0.05], **changes)
    r = measurement(T, [0.1, -0.1, 0.05], **changes, before=[0.0])
    assert (r.command.held(T)[:, 0] == STEPS).all()
    with pytest.raises(RecordingError, match="2 commands before the first, not 1"):
        measurement(T, [0.1, -0.1, 0.05], **changes, before=[0.0, 0.0])


def test_commands_that_were_only_sampled_leave_the_delay_open_and_a_warning_says_so():
    """Given anywhere within a period of 10 ms before the sample that first shows them, by a
    first-order gimbal (closed form) with a delay of 15 ms. Who logs in the loop that gives them
    says so and gets the narrow interval about the same value.
    """
    rng = np.random.default_rng(3)
    given = np.arange(0.3, 9.5, 0.4) + rng.uniform(0.0, 0.01, 23)
    level = np.where(np.arange(23) % 2, 0.0, 0.1)
    t = np.arange(0.0, 10.0, 0.01)
    past = np.clip(t[:, None] - given - 0.015, 0.0, None)
    y = (1.0 - np.exp(-past / 0.05)) @ np.diff(level, prepend=0.0)
    seen = np.concatenate([[0.0], level])[np.searchsorted(given, t, side="right")]
    found = {
        stamps: identify([measurement(t, seen, angle=noisy(y), stamps=stamps)], 1)
        for stamps in ("exact", "shown", "sampled")
    }
    delays = {s: m.estimate("x/x delay") for s, m in found.items()}
    assert delays["exact"].interval[1] < 0.015
    assert delays["shown"].value == pytest.approx(delays["exact"].value, abs=1e-6)
    assert delays["shown"].interval[0] < 0.015 < delays["shown"].interval[1]
    assert delays["sampled"].value == pytest.approx(0.015, abs=2e-3)
    assert delays["sampled"].std == pytest.approx(0.01 / math.sqrt(12.0), rel=0.05)
    said = {s: [w for w in m.warnings if "--commands" in w] for s, m in found.items()}
    assert said["exact"] == []
    assert "10 ms too short," in said["shown"][0]
    assert "5 ms too short or too long," in said["sampled"][0]
    with pytest.raises(RecordingError, match="without time stamps"):
        measurement(t, seen, angle=y, command_time=t, stamps="sampled")


def test_records_cannot_be_written_to():
    r = measurement(T, STEPS, angle=first_order())
    with pytest.raises(ValueError, match="read-only"):
        r.time[0] = 1.0


def test_two_step_sizes_may_hide_a_saturation_and_a_warning_says_so():
    u = np.repeat([0.0, 0.1, 0.0, 0.1, 0.0, 0.1], 70)[:400]
    model = identify([measurement(T, u, angle=noisy(first_order(u=u), 3e-4))], 1)
    assert any("cannot distinguish saturation" in w for w in model.warnings)


def test_a_recording_of_the_twin_becomes_a_record():
    two = np.stack([STEPS, 0.5 * STEPS], axis=1)
    gyro = np.full((400, 3), 0.1)
    series = {
        "gimbal/command": TimeSeries("gimbal/command", T, two, "rad", ("x", "y")),
        "sensors/gyro": TimeSeries("sensors/gyro", T, gyro, "rad/s", ("x", "y", "z")),
    }
    r = measurement_of(Recording({}, series), rate="sensors/gyro")
    assert r.command.values.shape == (400, 2)
    assert r.rate.values.shape == (400, 2)
    assert r.slack == 0.0


def test_degrees_read_as_radians_on_both_sides_are_doubted_by_the_size_of_the_commands():
    """A gain of 1 says nothing of them; 5 rad are 286°, and no gimbal turns beyond 90°."""
    time = np.arange(0.0, 4.0, 0.01)
    command = np.where(time % 1.0 < 0.5, 0.0, 5.0)
    angle = np.interp(time - 0.02, time, command) + np.random.default_rng(0).normal(0, 0.02, 400)
    degrees = measurement(time, command[:, None], angle=angle)
    radians = measurement(time, np.radians(command)[:, None], angle=np.radians(angle))
    said = [w for w in identify([degrees], poles=1).warnings if "reaches 5 rad" in w]
    assert len(said) == 1
    assert "is it in degrees?" in said[0]
    assert not any("reaches" in w for w in identify([radians], poles=1).warnings)
    # whatever else a note of the file says; only a doubt of the unit itself is not said twice
    noted = replace(degrees, note="row 7 reaches column 9")
    assert any("reaches 5 rad" in w for w in identify([noted], poles=1).warnings)
    said = "command 'u' is 286°"
    doubted = replace(degrees, note=f"row 7 left out; {said}", unit_doubt=said)
    assert not any("reaches" in w for w in identify([doubted], poles=1).warnings)
