"""What `twin identify` prints of a residual."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from analysis.identify import identify, identify_gimbal
from analysis.recording import measurement
from twin.evaluation.identify_result import IdentifyResult, _unexplained


@pytest.fixture(scope="module")
def axis():
    t = np.arange(0.0, 1.0, 0.01)
    s = np.clip(t - 0.213, 0.0, None)
    answer = 1.0 - np.exp(-30.0 * s) * (1.0 + 30.0 * s)
    angle = 0.1 * answer + 1e-4 * np.random.default_rng(1).normal(size=len(t))
    r = measurement(t, [0.1], command_time=[0.2], before=[0.0], angle=angle)
    return identify([r]).axes[0]


@pytest.mark.parametrize("allowed", [True, False])
def test_intervals_allow_for_coloured_noise_and_never_for_a_wrong_structure(axis, allowed):
    coloured = replace(axis.residual_angle, autocorrelation=0.9, whiteness=1e-9)
    rows = dict(_unexplained(replace(axis, residual_angle=coloured, allowed=allowed)))
    text = rows["x angle residual"]
    assert text.startswith("not white, autocorrelation 0.90")
    said = "the intervals allow for coloured noise, not for a wrong structure"
    assert text.endswith(said) == allowed


def test_readings_that_are_left_out_are_counted_with_the_reason():
    """Axis x is commanded from 0 to 3 s, y from 5 to 8 s, of 9 s: 1 s more counts each way."""
    t = np.arange(0.0, 9.0, 0.01)
    u = np.zeros((len(t), 2))
    for k, begin in enumerate((0.0, 5.0)):
        on = (t > begin - 1e-9) & (t < begin + 3.0 + 1e-9)
        u[on, k] = np.resize(np.repeat([0.0, 0.1, -0.1], 50), on.sum())
    angle = np.zeros_like(u)
    for n in range(1, len(t)):  # first order, 20 rad/s
        angle[n] = angle[n - 1] + (u[n - 1] - angle[n - 1]) * (1.0 - np.exp(-0.2))
    angle += 1e-4 * np.random.default_rng(0).normal(size=u.shape)
    r = measurement(t, u, angle=angle, stamps="exact")
    model = identify_gimbal([r], 1)
    changes = [t[1:][np.diff(u[:, k]) != 0.0] for k in (0, 1)]
    outside = [int(((t < c[0] - 1.0 - 1e-9) | (t > c[-1] + 1.0 + 1e-9)).sum()) for c in changes]
    assert [a.outside for a in model.axes] == pytest.approx(outside, abs=1)
    assert [a.samples + a.outside for a in model.axes] == [len(t)] * 2
    found = IdentifyResult(model, Path("m.json"), ("r",), {}, (), (), (), 1.0)
    rows = dict(found.rows())
    for a in model.axes:
        said = f"{a.samples} readings ({a.outside} more than 1 s before or after its own commands"
        assert said in rows[f"{a.name} fit"]
    whole = identify_gimbal([r], 1, coupling="full")
    found = IdentifyResult(whole, Path("m.json"), ("r",), {}, (), (), (), 1.0)
    assert not any("left out" in text for name, text in found.rows() if name.endswith(" fit"))
