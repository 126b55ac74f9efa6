"""Servos whose speed is bounded: simulated by other means, and a real one."""

import importlib.util
import json
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from analysis.identify import (
    ChannelFit,
    Estimate,
    IdentificationError,
    IdentifiedModel,
    ServoBounds,
    identify,
    identify_gimbal,
)
from analysis.identify.channels import changes, nothing
from analysis.identify.doubts import effective_warnings, warnings_of
from analysis.identify.evidence.diagnostics import Saturation, limited
from analysis.identify.evidence.uncertainty import whole_jacobian
from analysis.identify.gimbal import shared_structure
from analysis.identify.identification import layout_of
from analysis.identify.linear.fit import search
from analysis.identify.prediction import fit_to, predict
from analysis.identify.problem.assemble import assemble
from analysis.identify.problem.layout import Layout
from analysis.identify.problem.ramps import ramps
from analysis.identify.servo.motion import play, speed_servo
from analysis.identify.servo.starts import command_unit, limits, scaled, scales
from analysis.recording import measurement
from analysis.transfer_function import TransferFunctionModel
from analysis.transfer_function.servo import play as reference_play
from tests.benchmarks import real_servo as two_axes

_PATH = Path(__file__).parents[1] / "benchmarks" / "identification.py"
_SPEC = importlib.util.spec_from_file_location("identification_studies", _PATH)
assert _SPEC is not None
assert _SPEC.loader is not None
studies = importlib.util.module_from_spec(_SPEC)
sys.modules.setdefault(_SPEC.name, studies)
_SPEC.loader.exec_module(studies)


@pytest.fixture(scope="module")
def runs(shared_data):
    path = shared_data / "servo_sysid_miuzei" / "real-action-state-dataset.json"
    found = {}
    for run in json.loads(path.read_text(encoding="utf-8"))["data"]:
        actions = np.array(run["actions"]) * np.pi
        sensed = np.array(run["sensor_data"]) * np.pi
        r = measurement(np.arange(len(actions)) * 0.02, actions, angle=sensed, before=[0.0])
        found.setdefault(run["type"], []).append(r)
    return found


@pytest.fixture(scope="module")
def real_servo(runs):
    return identify(runs["step"], servo=True)


@pytest.mark.thorough
def test_the_real_servo_is_fitted_and_its_speed_found(real_servo):
    """95 % and 281 °/s: what a rate-limited model reaches on these steps (data/README)."""
    assert np.median(real_servo.axes[0].fit_angle) >= 95.0
    assert np.degrees(real_servo.servo[0].rate_limit.value) == pytest.approx(281.0, rel=0.02)


@pytest.mark.parametrize(
    ("kind", "least"),
    [("square", 88.0), ("triangle", 89.0), ("ramp", 95.0), ("prbs", 75.0), ("chirp", 79.0)],
)
def test_the_real_servo_is_predicted_in_motions_not_fitted(real_servo, runs, kind, least):
    assert np.median(fit_to(real_servo, runs[kind])) >= least


def test_a_linear_fit_of_the_real_servo_is_flagged(runs):
    model = identify(runs["step"])
    assert any("rate-limited" in w for w in model.warnings)
    assert any("poor fit" in w for w in model.warnings)


def test_both_axes_have_the_structure_that_predicts_them_best_together():
    """Losses of the real servo's steps, five to an axis: alone the axes prefer different ones."""
    x = {"speed": 53.8, "set-point": 109.1, "command": 127.6}
    y = {"speed": 94.2, "set-point": 74.9, "command": 79.3}
    assert shared_structure([x, y]) == "speed"
    assert shared_structure([y, {"speed": 2.0, "command": 1.0}]) == "command"


@pytest.mark.slow
def test_the_real_servo_on_two_axes_is_predicted_without_a_lead(shared_data):
    """Poles and delay of one structure beside the limits of another answered 45 ms early."""
    given = two_axes.runs(shared_data / "servo_sysid_miuzei")
    records = {}
    for kind in ("step", "triangle"):
        rows = [[v if v != "" else np.nan for v in row] for row in two_axes.rows(given[kind])]
        table = np.array(rows)
        records[kind] = measurement(
            table[:, 0], np.radians(table[:, 1:3]), angle=np.radians(table[:, 3:]),
            before=[0.0, 0.0],
        )  # fmt: skip
    model = identify_gimbal([records["step"]], servo=True)
    first, second = model.servo
    assert first.structure == second.structure
    assert fit_to(model, [records["triangle"]]).min() > 80.0


@pytest.mark.thorough
def test_a_simulated_limit_is_found_and_the_linear_fit_flagged():
    found = studies.limited_study(0, 7.0)
    assert found["limit error"] <= 0.01
    assert found["frequency error"] <= 0.01
    assert found["flagged"]
    assert found["structure"] == "speed"


def test_an_unlimited_servo_is_not_flagged():
    rng = np.random.default_rng(1)
    r = studies.servo_record(rng, studies.Gimbal(40.0, 0.7, 0.01, 1.0), duration=6.0)
    assert identify([r]).warnings == ()


def test_a_record_that_begins_in_motion_is_said_to():
    rng = np.random.default_rng(1)
    g = studies.Gimbal(20.0, 0.5, 0.02, 1.0)
    at, u = studies.random_steps(rng, 8.0, 0.5, 8.0)
    t = np.arange(at[3] + 0.06, 8.0, 0.005)  # on the way to the fourth angle
    u[2:4] = [[-0.1], [0.1]]
    angle, rate = studies.sensed(rng, *studies.moved([g], t, at, u))
    r = measurement(
        t, u[3:], command_time=np.append(t[0], at[4:]), before=u[3], angle=angle, rate=rate
    )
    found = identify([r])
    assert any("already moves when a record begins" in w for w in found.warnings)
    assert found.axes[0].beginning > 5.0
    free = identify([replace(r, initial="free")])
    assert free.warnings == ()
    assert studies.frequency_error(free, g, g) < studies.frequency_error(found, g, g)


@pytest.mark.parametrize(
    ("exponent", "std", "spread", "flagged"),
    [
        (0.899, 0.006, 4.0, True),
        (0.901, 0.006, 4.0, True),  # 4 ** -0.099 = 0.87: the largest step is 13 % slower
        (0.901, 0.040, 4.0, False),  # not clear
        (0.930, 0.006, 2.0, False),  # 2 ** -0.07 = 0.95
        (0.930, 0.006, 20.0, True),  # 20 ** -0.07 = 0.81
        (1.000, 0.006, 20.0, False),
    ],
)
def test_a_speed_is_limited_where_the_largest_step_is_a_tenth_slower(
    exponent, std, spread, flagged
):
    assert limited(exponent, std, spread) is flagged


def stepped(jumps, gimbals):
    """A record of steps 0.6 s apart, each answered by its own gimbal; settled before the next."""
    rng = np.random.default_rng(5)
    t, at = np.arange(0.0, 7.0, 0.01), np.arange(0.2, 7.0, 0.6)
    pairs = [
        np.multiply(jump, studies.step_pair(g, t - begin))
        for begin, jump, g in zip(at, jumps, gimbals, strict=True)
    ]
    angle, rate = np.sum(pairs, axis=0) + np.array([[1e-6], [1e-5]]) * rng.normal(size=(2, len(t)))
    u = np.cumsum(jumps)
    return measurement(t, u, command_time=at, before=[0.0], angle=angle, rate=rate)


def test_the_change_of_poles_and_delay_with_the_size_of_steps_is_that_of_the_gimbal():
    """Gimbals that answer steps of 6° by a share s slower, later and more damped than of 2.4°.

    The change is one Gauss-Newton step, off by a share of first order in s (3.4 s of the damping,
    2 s of the delay), which changes by s and by s/2 extrapolate away. 1 %: the square of 3.4 s is
    left, s = 3 %.
    """
    jumps = np.radians(np.tile([6.0, -6.0, 2.4, -2.4], 3))
    small, found = studies.Gimbal(40.0, 0.7, 0.01, 1.0), []
    for s in (0.03, 0.015):
        large = studies.Gimbal(40.0 * (1 - s), 0.7 * (1 + s), 0.01 * (1 + s), 1.0)
        r = stepped(jumps, [large, large, small, small] * 3)
        problem = assemble([r], 0, layout_of([r], 2, 0), shared_offset=False)
        fit = search(problem, max_delay=0.05)
        changed = changes(fit, whole_jacobian(fit.solution), 0)
        found.append({e.name: e.value / s for e in changed})
    slope = {name: 2.0 * found[1][name] - found[0][name] for name in found[0]}
    assert slope == pytest.approx(
        {"natural frequency": -40.0, "damping": 0.7, "delay": 0.01}, rel=0.01
    )


def test_a_limited_servo_is_said_to_be_slower_in_large_steps():
    rng = np.random.default_rng(5)
    t, at = studies.stamps(rng, 7.0, 0.01), np.arange(0.2, 7.0, 0.6)
    u = np.cumsum(np.radians(6.0) * np.tile([1.0, -1.0, 0.4, -0.4], 3))
    angle, rate = studies.sensed(
        rng, *studies.rate_limited(t, at, u, 40.0, 0.7, 0.01, 2.0, step=1e-4)
    )
    model = identify(
        [measurement(t, u, command_time=at, before=[0.0], angle=angle, rate=rate)], max_delay=0.05
    )
    name = "natural frequency"
    change = next(e for e in model.axes[0].sizes if e.name == name)
    assert change.value < -1.96 * change.std
    assert any(f"{name} -" in w for w in model.warnings if "rate-limited" in w)


@pytest.mark.parametrize(
    ("poles", "pole", "change", "warned"),
    [
        (2, "natural frequency", 4.0, True),
        (2, "natural frequency", 0.4, False),
        (1, "time constant", 5e-3, True),
        (1, "time constant", 2e-4, False),
        (4, "natural frequency 1", 100.0, True),
        (4, "natural frequency 1", 1e-2, False),
        (2, "damping", 1e-4, True),  # of a pole's speed nothing is known
    ],
)
def test_a_power_of_the_speed_is_a_warning_unless_the_poles_are_shown_not_to_change(
    poles, pole, change, warned
):
    """Change from the smallest step to the largest: 0 ± less or more than a tenth of the pole's.

    A limit hides a pole; names of axes may have spaces.
    """
    t = np.arange(0.0, 1.0, 0.01)
    answer = studies.step_pair(studies.Gimbal(40.0, 0.7, 0.013, 1.0), np.clip(t - 0.2, 0.0, 1.0))[0]
    angle = np.radians(5.0) * answer + 1e-5 * np.random.default_rng(1).normal(size=len(t))
    r = measurement(
        t, np.radians([5.0]), command_time=[0.2], before=[0.0], angle=angle, outputs=["pitch axis"]
    )
    model, problem = identify([r], poles), assemble([r], 0, layout_of([r], poles, 0))
    axis = replace(
        model.axes[0],
        saturation=Saturation(0.8, 0.02, 16, 2.0, True),
        sizes=(Estimate(pole, 0.0, change / 1.96, ""),),
        simpler=poles > 1,
    )
    said = " ".join(warnings_of(axis, model.channels[0], 0.5, problem))
    assert ("rate-limited" in said) == warned
    assert (f"--poles {poles - 1}" in said) == (poles > 1 and not warned)


def behind_a_set_point(h=1e-4):
    """Steps of a servo behind a slewed set point, by Euler steps of its equations; delay 4 ms."""
    rng = np.random.default_rng(2)
    t, at = np.arange(0.0, 4.0, 0.01), 0.1 + np.cumsum(rng.uniform(0.05, 0.25, 25))
    u = rng.uniform(0.02, 0.1, len(at)) * np.where(np.arange(len(at)) % 2, -1.0, 1.0)
    every = round(0.01 / h)
    late = np.searchsorted(at + 0.004, np.arange(len(t) * every) * h + 1e-9, side="right")
    y = v = r = 0.0
    angle = np.empty(len(t))
    for i, c in enumerate(np.append(0.0, u)[late]):
        if i % every == 0:
            angle[i // every] = y
        r += min(max(c - r, -4.0 * h), 4.0 * h)
        beyond = r - y - min(max(r - y, -0.003), 0.003)
        v += h * 80.0 * (min(max(75.0 * beyond, -3.6), 3.2) - v)
        y += h * v
    angle += 2e-4 * rng.normal(size=len(t))
    return measurement(t, u, command_time=at, before=[0.0], angle=angle)


def test_the_bounds_of_a_servo_behind_a_set_point_are_found():
    """3.3 of their stated deviations: one in a thousand records is further off."""
    model = identify([behind_a_set_point()], servo="set-point", max_delay=0.05)
    true = {"rate limit": 3.2, "rate limit back": 3.6, "slew of the set point": 4.0}
    for name, value in {**true, "dead band": 0.003}.items():
        found = model.estimate(f"x {name}")
        assert found.std < 0.02 * value
        assert abs(found.value - value) < 3.3 * found.std
    assert not any("effective" in w for w in model.warnings)


def test_colour_that_chance_gives_a_short_record_makes_no_effective_values():
    """Of 200 white readings two in five have an autocorrelation of 0.15 among twenty lags."""
    t = np.arange(0.0, 1.0, 0.01)
    answer = studies.step_pair(studies.Gimbal(40.0, 0.7, 0.013, 1.0), np.clip(t - 0.2, 0.0, 1.0))[0]
    angle = answer + 1e-3 * np.random.default_rng(1).normal(size=len(t))
    axis = identify([measurement(t, [1.0], command_time=[0.2], before=[0.0], angle=angle)]).axes[0]
    none = Estimate("x", 0.0, 0.0, "")
    bounds = ServoBounds("speed", {}, none, none, none)
    by_chance, coloured, faint = (
        replace(axis.residual_angle, autocorrelation=size, whiteness=whiteness)
        for size, whiteness in ((0.2, 0.05), (0.2, 1e-6), (0.05, 1e-6))
    )
    for angle_, rate, warned in (
        (by_chance, None, False),
        (coloured, None, True),
        (by_chance, faint, False),  # what matters of one sensor, what is shown of the other
        (faint, by_chance, False),
        (faint, coloured, True),
    ):
        found = replace(axis, residual_angle=angle_, residual_rate=rate, repeats=0.0)
        assert bool(effective_warnings(found, bounds)) == warned


def test_a_servo_is_idle_only_where_none_of_its_limits_is_reached():
    """Behind a set point any of the three may be the one that hides a pole."""
    reached, idle = (Estimate("x", 1.0, 0.1, "rad/s", not least, least) for least in (False, True))
    for up in (idle, reached):
        assert ServoBounds("speed", {}, up, reached, reached).idle == (up is idle)
        for back, slew in ((idle, reached), (reached, idle), (idle, idle)):
            bounds = ServoBounds("set-point", {}, up, reached, reached, back, slew)
            assert bounds.idle == (up is back is slew is idle)


@pytest.mark.thorough
def test_a_structure_that_leaves_more_than_noise_has_effective_values():
    """Both speeds of the true servo are missing here."""
    model = identify([behind_a_set_point()], servo="speed", max_delay=0.05)
    assert any("effective values" in w for w in model.warnings)


@pytest.mark.parametrize("clipped", [False, True])
def test_speed_servo_without_limit_is_the_linear_response(clipped):
    """2e-6: fourth-order steps of 1 ms at ωn = 40 rad/s."""
    g = studies.Gimbal(40.0, 0.7, 0.013, 1.0)
    t = np.linspace(0.0, 0.5, 101)
    w = 2 * 0.7 * 40.0
    angle, rate = speed_servo(
        t, np.array([-1.0, 0.0]), np.array([0.0, 1.0]), 0.013, 1600.0 / w, w, 1e9, 0.0, clipped
    )
    exact = studies.step_pair(g, t)
    assert angle == pytest.approx(exact[0], abs=2e-6)
    assert rate == pytest.approx(exact[1], abs=2e-4)


def test_ramps_reach_the_command_at_the_limit():
    at, slope, value = ramps(np.array([0.0, 1.0]), np.array([1.0, 0.0]), 2.0, 0.0)
    assert at == pytest.approx([0.0, 0.5, 1.0, 1.5])
    assert slope == pytest.approx([2.0, 0.0, -2.0, 0.0])
    assert value == pytest.approx([0.0, 1.0, 1.0, 0.0])


def test_a_ramp_cut_short_turns_where_it_is():
    at, slope, value = ramps(np.array([0.0, 0.25]), np.array([1.0, 0.0]), 2.0, 0.0)
    assert at == pytest.approx([0.0, 0.25, 0.5])
    assert value == pytest.approx([0.0, 0.5, 0.0])
    assert slope == pytest.approx([2.0, -2.0, 0.0])


def test_play_is_that_of_the_flown_model():
    drive = np.cumsum(np.random.default_rng(0).normal(size=200))
    drive -= drive[0]
    out, rate = play(drive, np.ones(200), 1.5)
    assert out == pytest.approx(reference_play(drive[:, None], 1.5)[:, 0])
    assert set(rate) == {0.0, 1.0}


@pytest.mark.slow  # the next one is its short form
def test_a_servo_is_the_same_in_every_unit_of_its_command():
    """0.5 %: the search ends within 1e-9 of the loss; pulses here grow the other way."""
    rng = np.random.default_rng(4)
    t = np.arange(0.0, 5.0, 0.01)
    at = np.arange(0.2, 5.0, 0.6)
    u = np.radians([2.0, -4.0, 8.0, -10.0, 5.0, -2.0, 10.0, -10.0])[: len(at)]
    angle = studies.rate_limited(t, at, u, 40.0, 0.8, 0.01, 1.5, step=2e-4)[0]
    angle = angle + 1e-4 * rng.normal(size=len(t))
    models = [
        identify(
            [measurement(t, a + b * u, command_time=at, before=[a], angle=angle, input_unit=unit)],
            servo="speed",
        )
        for a, b, unit in ((0.0, 1.0, "rad"), (1500.0, -600.0, "us"))
    ]
    limits = [m.estimate("x rate limit").value for m in models]
    assert limits[1] == pytest.approx(limits[0], rel=0.005)
    gains = [m.estimate("x/x gain") for m in models]
    assert gains[1].value * -600.0 == pytest.approx(gains[0].value, rel=0.005)
    assert gains[1].unit == "rad/us"


@pytest.mark.parametrize("factor", [1e3, 1e-3, -600.0])
def test_the_search_of_a_servo_is_the_same_in_every_unit_of_the_commands(factor):
    """Two axes: steps and ranges of one are of its own commands, not of the other's size."""
    t = np.arange(0.0, 3.0, 0.01)
    u = np.radians(np.repeat([[0.0, 0.0], [5.0, 0.0], [0.0, 0.0], [0.0, -8.0]], 75, axis=0))
    angle = np.roll(u, 3, axis=0)
    searches = []
    for k in (1.0, factor):
        r = measurement(t, 1500.0 * (k != 1.0) + k * u, angle=angle, input_unit="us")
        problem = assemble([r], 1, Layout(2, 0, 2, True, (np.nan, np.nan)))
        unit = command_unit(problem, 1)
        alike = scaled(problem, 1, unit)
        amplitude = np.ptp(alike.parts[0].input)
        assert amplitude == pytest.approx(np.ptp(angle[:, 1]))
        searches.append((scales(alike, "set-point"), *limits(alike, 0.1, "set-point")))
    for one, other in zip(*searches, strict=True):
        assert other == pytest.approx(one, rel=1e-9)


def test_zeros_and_servo_exclude_each_other():
    rng = np.random.default_rng(1)
    r = studies.servo_record(rng, studies.Gimbal(40.0, 0.7, 0.01, 1.0), duration=3.0)
    with pytest.raises(IdentificationError, match="1 or 2 poles and no zeros"):
        identify([r], 2, 1, servo=True)


@pytest.mark.parametrize("structure", ["clipped", "set-point"])
def test_a_structure_of_second_order_is_not_fitted_with_one_pole(structure):
    rng = np.random.default_rng(1)
    r = studies.servo_record(rng, studies.Gimbal(40.0, 0.7, 0.01, 1.0), duration=3.0)
    with pytest.raises(IdentificationError, match=f"structure '{structure}' has 2 poles, not 1"):
        identify([r], 1, servo=structure)


def servo_of_gain(gain, structure, up, down, slew):
    """An identified servo of an axis: its channel, and its bounds at the output."""
    w = 45.0
    no = np.zeros(0)
    channel = ChannelFit((gain * w * w,), (1.0, 1.6 * w, w * w), 0.012, (), no, np.diag(no))
    figures = {"rate_limit": up, "dead_band": 0.004, "backlash": 0.003}
    if structure == "set-point":
        figures |= {"rate_limit_back": down, "slew": slew}
    estimates = {name: Estimate(name, value, 0.0, "") for name, value in figures.items()}
    return channel, ServoBounds(structure, {}, **estimates)


@pytest.mark.parametrize("structure", ["speed", "clipped", "command", "set-point"])
def test_an_identified_servo_is_flown_as_it_was_found_on_each_axis(structure):
    """The file's own simulation against the identification's; steps of 1 ms, hence 0.5 % of 0.2.

    Speeds are those of the output, whatever the gain: a file that took them ahead of a gain of 0.8
    would move at 0.8 of them.
    """
    x, of_x = servo_of_gain(0.8, structure, 1.5, 1.2, 2.0)
    y, of_y = servo_of_gain(-0.5, structure, 0.9, 0.6, 0.7)
    none = nothing(x)
    model = IdentifiedModel(("x", "y"), ("x", "y"), ((x, none), (none, y)), (of_x, of_y), ())
    flown = TransferFunctionModel.from_dict(model.to_transfer_function().to_dict())
    time = np.arange(1500) * 1e-3
    command = np.where(time < 0.7, 0.2, -0.1)[:, None] * np.ones(2)
    asked = measurement(time, command, angle=0.0 * command, command_time=time, before=[0.0, 0.0])
    said = predict(model, asked)[0]
    assert flown.simulate(command, 1e-3) == pytest.approx(said, abs=1e-3)
    fastest = np.abs(np.diff(said, axis=0)).max(axis=0) / 1e-3
    assert fastest == pytest.approx([1.5, 0.7 if structure == "set-point" else 0.9], rel=0.15)
