"""The model file and its discretisation, against python-control and closed forms."""

import json
import os
import time

import control
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from analysis.response import step_response
from analysis.schema import AnalysisError
from analysis.transfer_function import Channel, ModelFileError, Servo, TransferFunctionModel
from tests.conftest import ROOT

SECOND = TransferFunctionModel.second_order(50.0, 0.7, 0.018)


def coupled() -> TransferFunctionModel:
    return TransferFunctionModel(
        (
            (
                Channel((2500.0,), (1.0, 70.0, 2500.0), 0.012),
                Channel((3.0, 40.0), (1.0, 30.0, 900.0), 0.007),
            ),
            (
                Channel((90.0,), (1.0, 60.0, 1600.0), 0.02),
                Channel((3.0, 8e4), (1.0, 90.0, 4e3, 8e4), 0.0),
            ),
        )
    )


def closed_form(wn: float, zeta: float, t: np.ndarray) -> np.ndarray:
    """Unit step of the underdamped second order (any control textbook)."""
    wd = wn * np.sqrt(1 - zeta**2)
    y = 1 - np.exp(-zeta * wn * t) * (np.cos(wd * t) + zeta * wn / wd * np.sin(wd * t))
    return np.where(t >= 0, y, 0.0)


def test_step_of_second_order_with_any_delay_equals_the_closed_form():
    """1e-9: 50 000 steps of a matrix exponential."""
    for delay in (0.0, 0.018, 0.01234567):
        model = TransferFunctionModel.second_order(50.0, 0.7, delay)
        t, y = step_response(model.channel("x", "x"))
        assert np.abs(y - closed_form(50.0, 0.7, t - delay)).max() < 1e-9


@pytest.mark.parametrize("delay", [0.0, 1e-4, 9.999e-4, 0.001, 0.012, 0.0123456])
def test_sampled_staircase_is_exact_for_whole_and_fractional_delays(delay):
    dt = 1e-3
    discrete = TransferFunctionModel.second_order(50.0, 0.7, delay).discretise(dt)
    u = np.random.default_rng(1).normal(size=(150, 2))
    t = np.arange(150) * dt
    truth = np.zeros(150)  # sum of delayed closed-form steps, one per change of the command
    for k, change in enumerate(np.diff(u[:, 0], prepend=0.0)):
        truth += change * closed_form(50.0, 0.7, t - k * dt - delay)
    assert np.abs(discrete.simulate(u)[:, 0] - truth).max() < 1e-12


def coupled_error() -> float:
    """Worst difference of the coupled system from python-control's [rad], of motions up to 0.3."""
    dt = 1e-3  # every delay of the model is a multiple of it
    model = coupled()
    u = np.cumsum(np.random.default_rng(2).normal(size=(300, 2)), axis=0) * 0.01
    y = model.discretise(dt).simulate(u)
    worst = 0.0
    for i in range(2):
        truth = np.zeros(300)
        for j in range(2):
            c = model.channel(i, j)
            shift = round(c.delay / dt)
            held = np.concatenate([np.zeros(shift), u[: 300 - shift, j]])
            system = control.c2d(control.ss(control.tf(list(c.num), list(c.den))), dt, "zoh")
            truth += control.forced_response(system, inputs=held).outputs
        worst = max(worst, float(np.abs(y[:, i] - truth).max()))
    return worst


def test_coupled_system_equals_forced_response_of_python_control():
    assert coupled_error() < 1e-12


def test_frequency_response_is_the_ratio_of_polynomials_with_the_delay_as_phase():
    w = np.logspace(0, 3, 40)
    c = Channel((3.0, 20.0), (1.0, 7.0, 100.0), 0.02)
    s = 1j * w
    truth = (3.0 * s + 20.0) / (s * s + 7.0 * s + 100.0) * np.exp(-0.02 * s)
    np.testing.assert_allclose(c.frequency_response(w), truth, rtol=1e-12)


def test_discrete_frequency_response_tends_to_the_continuous_one():
    dt, w = 1e-4, np.array([5.0, 50.0])
    A, B, C, D = SECOND.discretise(dt).state_space
    z = np.exp(1j * w * dt)
    hold = (1 - np.exp(-1j * w * dt)) / (1j * w * dt)
    continuous = SECOND.channel("x", "x").frequency_response(w)
    for k in range(2):
        gain = (C @ np.linalg.solve(z[k] * np.eye(len(A)) - A, B) + D)[0, 0]
        # the held input's first image lies 2π/dt away, where the gain is (ωn dt/2π)² = 6e-7
        assert gain == pytest.approx(continuous[k] * hold[k], rel=1e-6)


def test_integrator_and_feedthrough_channels_are_exact():
    late = np.arange(10) * 1e-3 - 0.0015
    ramp, lead = Channel((1.0,), (1.0, 0.0), 0.0015), Channel((1.0, 3.0), (1.0, 10.0), 0.0015)
    integral, y = (
        TransferFunctionModel(((c,),), ("x",), ("x",)).simulate(np.ones((10, 1)), 1e-3)[:, 0]
        for c in (ramp, lead)
    )
    np.testing.assert_allclose(integral, np.maximum(late, 0), atol=1e-15)
    np.testing.assert_allclose(
        y, np.where(late >= 0, 0.3 + 0.7 * np.exp(-10 * late), 0), atol=1e-14
    )


def test_rate_limit_moves_the_output_at_that_rate():
    servo = Servo(rate_limit=4.0)
    fast = TransferFunctionModel.second_order(500.0, 1.0).discretise(1e-3)
    y = fast.simulate(np.full((400, 2), 0.8), servo)[:, 0]
    assert np.diff(y)[50:150] == pytest.approx(4e-3, rel=1e-6)
    tolerance = 4e-3 * 1e-3  # the staircase of means errs in second order: 0.1 % of one step
    # a ramp through ωn = 500, ζ = 1 runs 2ζ/ωn = 4 ms behind: y(0.1 s) = 4·(0.1 − 0.004)
    assert y[100] == pytest.approx(4.0 * 0.096, abs=tolerance)


def test_dead_band_holds_and_backlash_lags_by_half_its_width():
    fast = TransferFunctionModel.second_order(500.0, 1.0).discretise(1e-3)
    steps = np.repeat([0.01, 0.015, 0.05], 100)[:, None] * np.ones(2)
    y = fast.simulate(steps, Servo(dead_band=0.008))[:, 0]
    assert y[[99, 199, 299]] == pytest.approx([0.01, 0.01, 0.05], abs=1e-9)
    up_down = np.repeat([0.1, 0.0], 200)[:, None] * np.ones(2)
    z = fast.simulate(up_down, Servo(backlash=0.02))[:, 0]
    assert z[[199, 399]] == pytest.approx([0.09, 0.01], abs=1e-6)


def test_a_speed_bounded_servo_is_linear_for_small_commands_and_slews_for_large_ones():
    linear = TransferFunctionModel.second_order(45.0, 0.8, 0.0123)
    bounded = TransferFunctionModel(linear.channels, servo=Servo(rate_limit=4.0, structure="speed"))
    small = np.full((200, 2), 0.05)
    # k·e stays below the limit: fourth-order steps of 1 ms against the exact hold
    assert np.abs(bounded.simulate(small, 1e-3) - linear.simulate(small, 1e-3)).max() < 1e-6
    large = bounded.simulate(np.full((400, 2), 1.0), 1e-3)[:, 0]
    assert np.diff(large)[120:150] == pytest.approx(np.full(30, 4e-3), rel=0.01)
    assert large[-1] == pytest.approx(1.0, abs=1e-3)
    again = TransferFunctionModel.from_dict(bounded.to_dict())
    assert again == bounded


def test_a_speed_bounded_servo_with_zeros_is_refused():
    with pytest.raises(ModelFileError, match="1 zeros and 2 poles"):
        TransferFunctionModel(
            ((Channel((1.0, 2.0), (1.0, 2.0, 3.0)),),), ("x",), ("x",), Servo(structure="speed")
        )


def test_a_model_survives_its_file(tmp_path):
    path = tmp_path / "model.json"
    model = coupled()
    model = TransferFunctionModel(
        model.channels, servo=Servo(5.0, 0.01, 0.02, "command"), source={"run": 3}
    )
    model.write(path)
    again = TransferFunctionModel.read(path)
    assert again == model
    assert again.source == {"run": 3}
    assert [p.name for p in tmp_path.iterdir()] == ["model.json"]


def test_a_failed_write_leaves_the_old_file_and_nothing_beside_it(tmp_path, monkeypatch):
    path = tmp_path / "model.json"
    SECOND.write(path)
    before = path.read_bytes()

    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(AnalysisError, match="No space left"):
        coupled().write(path)
    assert path.read_bytes() == before
    assert len(list(tmp_path.iterdir())) == 1


GOOD = SECOND.to_dict()


def changed(**changes):
    content = json.loads(json.dumps(GOOD))
    content.update(changes)
    return content


def with_channel(**changes):
    content = changed()
    content["channels"][0][1].update(changes)
    return content


def with_own(**changes):
    content = changed()
    content["channels"][0][0].update(changes)
    return content


@pytest.mark.parametrize(
    ("content", "says"),
    [
        ([], "must be an object"),
        (changed(schema="tvc-twin/transfer-function/9"), "schema"),
        (changed(chanels=[]), "unknown key 'chanels'"),
        (changed(inputs=["x"]), r"channels\[0\] has 2 columns for 1 inputs"),
        (changed(inputs=["x", "x"]), "repeats"),
        (changed(outputs=[]), "outputs has 0 elements"),
        (changed(channels=[[1, 2], [3, 4]]), r"channels\[0\]\[0\] must be an object"),
        (with_channel(num=[]), r"channels\[0\]\[1\].num has 0 elements"),
        (with_channel(num=[1, 2, 3], den=[1, 2]), "improper"),
        (with_channel(num=[1e308], den=[1e-308, 1, 1]), "finite also where den begins with 1"),
        (with_channel(den=[0, 0]), "den is zero"),
        (with_channel(num=["1"]), r"num\[0\] must be a number, not a string"),
        (with_channel(num=[True]), "not a truth value"),
        (with_channel(num=[1e999]), "finite"),
        (with_channel(num=[10**400]), "finite"),
        (with_channel(den=[1.0] * 40), "1 to 21"),
        (with_channel(delay_s=-0.001), "delay_s is -0.001"),
        (with_channel(delay_s=30.0), "delay_s is 30"),
        (with_channel(delay=0.1), "unknown key 'delay'"),
        (changed(servo={"rate": 1}), "unknown key 'rate'"),
        (changed(servo={"backlash_rad": -1}), "servo: backlash is -1"),
        (changed(servo=[]), "servo has 0 elements"),
        (changed(servo=[{}]), "servo has 1 entries for 2 outputs"),
        (changed(servo=[{}, None]), r"servo\[1\] must be an object"),
        (changed(servo=[{}, {"slew_rad_s": "1"}]), r"servo\[1\].slew_rad_s must be a number"),
        (changed(servo=[{}, {"slew_rad_s": -1}]), r"servo\[1\]: slew is -1"),
        (changed(servo={"structure": "torque"}), "structure is 'torque'; there are command, speed"),
        (changed(servo={"structure": []}), "structure is"),
        (changed(std={"x/x gain": -1}), r"std.x/x gain is -1; a standard deviation must be ≥ 0"),
        (changed(std=-1), "std is -1"),
        (changed(std=[0.1, -1e-9]), r"std\[1\] is -1e-09"),
        (with_own(num=[0]), "output 'x' has gain 0 from every input"),
        (with_own(num=[1, 0]), "output 'x' has gain 0 from every input"),
        (changed(source=[[[[[[[[[[[]]]]]]]]]]]), "nested"),
    ],
)
def test_bad_content_is_refused_in_one_line_that_names_the_key(content, says):
    with pytest.raises(AnalysisError, match=says) as caught:
        TransferFunctionModel.from_dict(content)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "not a JSON file"),
        ("{", "not a JSON file"),
        ('{"schema": "a", "channels": [{"num": [1], "num": [2]}]}', "key 'num' stands twice"),
        ('{"schema": NaN}', "NaN is not finite"),
        ("[" * 100_000, "not a JSON file"),
        (" " * ((1 << 20) + 1), "larger than 1048576 bytes"),
        ("\udcff", "not a JSON file"),
    ],
)
def test_hostile_files_are_refused_by_name_in_one_line(tmp_path, text, says):
    path = tmp_path / "bad.json"
    path.write_bytes(text.encode("utf-8", "surrogateescape"))
    with pytest.raises(ModelFileError, match=says) as caught:
        TransferFunctionModel.read(path)
    assert "bad.json" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(ModelFileError, match="No such file"):
        TransferFunctionModel.read(tmp_path / "none.json")


JSON = st.recursive(
    st.none() | st.booleans() | st.floats() | st.integers() | st.text(max_size=5),
    lambda inner: (
        st.lists(inner, max_size=3)
        | st.dictionaries(
            st.sampled_from(
                ["schema", "inputs", "outputs", "channels", "num", "den", "delay_s", "servo", "std"]
            ),
            inner,
            max_size=5,
        )
    ),
    max_leaves=20,
)


@settings(max_examples=30, deadline=None)
@given(JSON, st.sampled_from(sorted(GOOD)))
def test_any_json_in_any_place_is_taken_or_refused_and_never_crashes(value, key):
    try:
        model = TransferFunctionModel.from_dict(changed(**{key: value}))
    except ModelFileError:
        return
    json.dumps(model.to_dict(), allow_nan=False)


def test_stability_is_told():
    assert SECOND.stable
    assert not TransferFunctionModel(((Channel((1.0,), (1.0, -1.0)),),), ("x",), ("x",)).stable


def test_the_shipped_reference_is_a_plausible_nine_gram_servo():
    model = TransferFunctionModel.read(ROOT / "mjcf" / "gimbal.json")
    assert model.stable
    assert model.inputs == model.outputs == ("x", "y")
    for axis in "xy":
        c = model.channel(axis, axis)
        # nozzle up on the bench the motor's weight pushes outwards: docs/mirror.md
        assert 1.0 < c.frequency_response([0.0])[0].real < 1.08
        # field notes: 9 g servo, delay of the 20 ms class; −90° well above the attitude loop
        assert 0.005 <= c.delay <= 0.03
        assert 30 < abs(c.poles[0]) < 90
        # identified, not guessed: every figure with its deviation
        for figure in ("gain", "delay", "natural frequency", "damping"):
            assert model.std[f"{axis}/{axis} {figure}"] > 0.0
        assert min(model.fit[axis]) > 80.0


def test_discretising_a_model_is_quick():
    begun = time.process_time()
    coupled().discretise(1e-3)
    assert time.process_time() - begun < 0.5
