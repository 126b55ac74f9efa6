"""The covariance of an identified model's figures, and models with other figures."""

import math
from dataclasses import replace

import numpy as np
import pytest

from analysis.identify import identify
from analysis.transfer_function import (
    Channel,
    Covariance,
    ModelFileError,
    Servo,
    TransferFunctionModel,
    distribution,
    with_figures,
)
from tests.analysis.test_identify_fit import studies

FIGURES = {"x/x gain": 1.1, "x/x delay": 0.02, "x/x natural frequency": 50.0, "x/x damping": 0.6}
PLAIN = TransferFunctionModel(
    ((Channel((1.1 * 2500.0,), (1.0, 60.0, 2500.0), 0.02),),), ("x",), ("x",)
)
KNOWN = Covariance(
    tuple(FIGURES), tuple(FIGURES.values()), tuple(map(tuple, np.diag([1e-4, 1e-6, 4.0, 1e-4])))
)


def test_the_file_keeps_the_covariance(tmp_path):
    known = replace(PLAIN, covariance=KNOWN)
    known.write(tmp_path / "m.json")
    assert TransferFunctionModel.read(tmp_path / "m.json").covariance == KNOWN
    assert np.diag(distribution(known)[1]) == pytest.approx([1e-2, 1e-3, 2.0, 1e-2])


def test_the_covariance_is_that_of_the_noise_and_the_closed_form_of_the_motion():
    """σ²(JᵀJ)⁻¹ with J of the closed form; 0.1: correlations of a fit to 2000 noisy readings."""
    truth = studies.Gimbal(40.0, 0.7, 0.018, 1.0)
    rng = np.random.default_rng(3)
    t = studies.stamps(rng, 10.0, 0.005)
    at, u = studies.random_steps(rng, 10.0, 0.5, 8.0)
    angle, rate = studies.sensed(rng, *studies.moved([truth], t, at, u))
    model = identify(
        [studies.measurement(t, u, command_time=at, before=[0.0], angle=angle, rate=rate)]
    )
    known = model.to_transfer_function().covariance
    noise = studies.true_noise()
    figures = np.array([truth.gain, truth.delay, truth.frequency, truth.damping])

    def readings(p):
        y, v = studies.moved([studies.Gimbal(p[2], p[3], p[1], p[0])], t, at, u)
        return np.concatenate([y / noise[0], v / noise[1]])

    steps = np.diag([1e-4, 1e-5, 1e-2, 1e-4])
    slope = np.stack([(readings(figures + s) - readings(figures - s)) for s in steps], axis=1)
    slope /= 2.0 * np.diag(steps)
    offsets = np.kron(np.eye(2), np.ones((len(t), 1)))
    bound = np.linalg.inv((j := np.hstack([slope, offsets])).T @ j)[:4, :4]
    assert known.names == ("x/x gain", "x/x delay", "x/x natural frequency", "x/x damping")
    found = np.array(known.matrix)
    assert np.sqrt(np.diag(found)) == pytest.approx([e.std for e in model.estimates], rel=1e-6)
    assert np.abs(_correlation(found) - _correlation(bound)).max() < 0.1
    assert np.sqrt(np.diag(found) / np.diag(bound)) == pytest.approx(1.0, abs=0.02)  # 1.01


def _correlation(covariance):
    std = np.sqrt(np.diag(covariance))
    return covariance / np.outer(std, std)


def test_a_model_with_other_figures_has_them():
    one = with_figures(PLAIN, {"x/x natural frequency": 40.0, "x/x damping": 0.5, "x/x gain": 0.9})
    assert one.channel("x", "x") == Channel((0.9 * 1600.0,), (1.0, 40.0, 1600.0), 0.02)
    assert with_figures(PLAIN, {"x/x delay": -1e-3}).channel("x", "x").delay == 0.0
    third = Channel((-50.0, 1000.0), (1.0, 25.0, 200.0, 1000.0))  # of (s² + 20 s + 100)(s + 10)
    both = replace(PLAIN, channels=((replace(third, num=(1.0, 1.0)),),))
    made = with_figures(
        both,
        {"x/x gain": 1.0, "x/x natural frequency": 10.0, "x/x damping": 1.0,
         "x/x time constant": 0.1, "x/x zero": 20.0},
    ).channel("x", "x")  # fmt: skip
    s = 3.0j
    expected = (1.0 - s / 20.0) / (1.0 + s / 10.0) ** 3
    value = np.polyval(made.num, s) / np.polyval(made.den, s)
    assert value == pytest.approx(expected, rel=1e-12)


def test_each_servo_has_the_figures_of_its_axis_ahead_of_its_gain():
    """The figures are those of the output; y is turned, so that its upward is the servo's downward.

    They come back from the file, and are the model's own in the check of the covariance.
    """
    x, none = PLAIN.channels[0][0], Channel((0.0,), (1.0,))
    y = Channel((-0.5 * x.den[-1],), x.den, 0.01)
    servo = Servo(3.0, 0.01, 0.0, "set-point", 3.0, 3.0)
    two = TransferFunctionModel(((x, none), (none, y)), servo=(servo, servo))
    figures = {"x rate limit": 2.2, "y rate limit": 1.0, "y rate limit back": 1.2}
    made = with_figures(two, {**figures, "y backlash": 0.02})
    assert made.servos[0].rate_limit == pytest.approx(2.0)
    assert made.servos[1] == replace(servo, rate_limit=2.4, rate_limit_back=2.0, backlash=0.02)
    known = Covariance(tuple(figures), tuple(figures.values()), tuple(map(tuple, np.eye(3))))
    read = TransferFunctionModel.from_dict(replace(made, covariance=known).to_dict())
    assert read == made
    assert distribution(read)[0] == known
    with pytest.raises(ModelFileError, match="not those of the channels and the servo"):
        distribution(replace(read, servo=(servo, servo)))


def test_one_servo_has_the_means_of_its_axes():
    x, none = PLAIN.channels[0][0], Channel((0.0,), (1.0,))
    two = TransferFunctionModel(((x, none), (none, x)), servo=Servo(3.0, 0.01, 0.0, "speed"))
    made = with_figures(two, {"x rate limit": 2.0, "y rate limit": 4.0, "x dead band": -0.1})
    assert (made.servo.rate_limit, made.servo.dead_band) == (3.0, 0.0)
    with pytest.raises(ModelFileError, match="rate limit is -1; it must be positive"):
        with_figures(two, {"x rate limit": -1.0})


@pytest.mark.parametrize(
    ("figures", "says"),
    [({"x/x dampin": 1.0}, "not those of this channel"),
     ({"x/x natural frequency": 1.0}, "needs the damping"),
     ({"x/x damping": -0.1, "x/x natural frequency": 1.0}, "damping is -0.1; it must be positive"),
     ({"x/x time constant": 1.0}, "not those of this channel"),
     ({"x/x zero": 1.0}, "not those of this channel"), ({"x/x zero": 0.0}, "without gain"),
     ({"x/x gain": math.nan}, "must be finite"), ({"y/y gain": 1.0}, "is no figure"),
     ({"x rate limit": 1.0}, "has no servo")],
)  # fmt: skip
def test_figures_that_no_model_has_are_refused(figures, says):
    with pytest.raises(ModelFileError, match=says):
        with_figures(PLAIN, figures)


def _with(row, column, value, *, both=False):
    matrix = np.array(KNOWN.matrix)
    scale = np.sqrt(np.diag(matrix))
    matrix[row, column] = value * scale[row] * scale[column]
    if both:
        matrix[column, row] = matrix[row, column]
    if row == column:
        matrix[row, column] = value
    return matrix.tolist()


@pytest.mark.parametrize(
    ("change", "says"),
    [({"names": ["a", "a", "b", "c"]}, "repeats a name"), ({"values": [1.0]}, "4 values"),
     ({"matrix": [[1.0]]}, "a square matrix"), ({"matrix": "x"}, "must be a list"),
     ({"matrix": _with(0, 0, -1.0)}, "variance -1 for"),
     ({"matrix": _with(0, 1, 9.0)}, "not symmetric"),
     ({"matrix": _with(0, 1, 9.0, both=True)}, "not positive semidefinite"),
     ({"values": ["x"] * 4}, "must be a number"), ({"more": 1}, "unknown key")],
)  # fmt: skip
def test_a_covariance_of_a_stranger_is_checked(change, says):
    content = replace(PLAIN, covariance=KNOWN).to_dict()
    content["covariance"] |= change
    with pytest.raises(ModelFileError, match=says):
        TransferFunctionModel.from_dict(content)
