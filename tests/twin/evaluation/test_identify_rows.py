"""What `twin identify` prints of a residual."""

from dataclasses import replace

import numpy as np
import pytest

from analysis.identify import identify
from analysis.recording import measurement
from twin.evaluation.identify_result import _unexplained


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
