"""A study that samples an identified model from the covariance of its figures."""

import numpy as np
import pytest

from analysis.transfer_function import Channel, Covariance, TransferFunctionModel
from tests.twin.campaigns.studies import study
from twin.campaigns.flying.runs import Runs, flown
from twin.campaigns.sampling.parameters import binding
from twin.campaigns.statistics.figures import FIGURES as FIGURES_OF_ROW
from twin.campaigns.statistics.figures import figures_of
from twin.config import Fly
from twin.errors import TwinError
from twin.experiments.flight.fly import fly

N = 2000
FIGURES = {"x/x gain": 1.03, "x/x delay": 0.017, "x/x natural frequency": 52.0, "x/x damping": 0.6}
CORRELATION = np.array([[1, 0, 0.1, 0.3], [0, 1, 0.9, 0.8], [0.1, 0.9, 1, 0.9], [0.3, 0.8, 0.9, 1]])
DEVIATIONS = np.array([0.011, 0.0012, 2.1, 0.027])  # of a run of `twin demo`
IDENTIFIED = """
[fly]
gimbal = "transfer-function"
duration_s = 0.2
[vary.model]
distribution = "model"
file = "model.json"
[design]
n = {n}
"""


def identified(folder, matrix=None, figures=FIGURES):
    """The file of an identified model whose first axis varies."""
    gain, delay, w, damping = FIGURES.values()
    x, none = (
        Channel((gain * w * w,), (1.0, 2.0 * damping * w, w * w), delay),
        Channel((0.0,), (1,)),
    )
    if matrix is None:
        matrix = CORRELATION * np.outer(DEVIATIONS, DEVIATIONS)
    known = Covariance(tuple(figures), tuple(figures.values()), tuple(map(tuple, matrix.tolist())))
    TransferFunctionModel(((x, none), (none, x)), covariance=known).write(folder / "model.json")


def test_samples_of_an_identified_model_have_its_mean_and_covariance(tmp_path):
    """Within 4 standard errors: σ/√N of a mean, √((1 + ρ²)/N) of a correlation, σ/√2N of a σ."""
    identified(tmp_path)
    runs = Runs(study(tmp_path, IDENTIFIED.format(n=N)))
    rows = runs.values(range(N))
    given = np.array([[row[f"model.{name}"] for name in FIGURES] for row in rows])
    off = given.mean(axis=0) - list(FIGURES.values())
    assert (np.abs(off) < 4.0 * DEVIATIONS / np.sqrt(N)).all()
    assert given.std(axis=0) == pytest.approx(DEVIATIONS, rel=4.0 / np.sqrt(2 * N))
    error = np.corrcoef(given.T) - CORRELATION
    assert (np.abs(error) < 4.0 * np.sqrt((1.0 + CORRELATION**2) / N)).all()
    wind = '[vary.wind_speed]\ndistribution = "uniform"\nlow = 0\nhigh = 5\n'
    more = wind + IDENTIFIED.format(n=N)  # a parameter more changes no other's samples
    assert [r["model.x/x gain"] for r in Runs(study(tmp_path, more)).values(range(9))] == [
        r["model.x/x gain"] for r in rows[:9]
    ]


def test_a_run_flies_the_model_of_its_row(tmp_path):
    """To the last bit, the second axis as identified."""
    identified(tmp_path)
    s = study(tmp_path, IDENTIFIED.format(n=3))
    row = flown(s, runs := Runs(s), binding(s.fly, s.vary, s.folder), tmp_path)(2)
    gain, delay, w, damping = (row[f"model.{name}"] for name in FIGURES)
    assert w != FIGURES["x/x natural frequency"]
    whole = TransferFunctionModel.read(tmp_path / "model.json")
    x = Channel((gain * (w * w),), (1.0, 2.0 * damping * w, w * w), delay)
    (_, none), second = whole.channels
    file = tmp_path / "one.json"
    TransferFunctionModel(((x, none), second)).write(file)
    config = Fly(gimbal="transfer-function", duration_s=0.2, model=file, seed=runs.sample(2))
    assert figures_of(fly(config, recorded=False)) == {k: row[k] for k in FIGURES_OF_ROW}


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda f: (f / "model.json").unlink(), "model.json: No such file"),
        (lambda f: (f / "model.json").write_text("{}"), "the model lacks 'channels'"),
        (lambda f: TransferFunctionModel.second_order(50, 0.6).write(f / "model.json"),
         "has no covariance; `twin identify` writes one"),
        (lambda f: identified(f, -np.eye(4)), "has the variance -1 for"),
        (lambda f: identified(f, np.ones((4, 4))), "must be symmetric and positive definite"),
        (lambda f: identified(f, np.triu(np.ones((4, 4)))), "is not symmetric"),
        (lambda f: identified(f, np.eye(1), {"x/x gain": 2.0}), "are not those of the channels"),
        (lambda f: identified(f, np.eye(1), {"x rate limit": 2.0}), "has no servo"),
    ],
)  # fmt: skip
def test_a_file_that_is_not_an_uncertain_model_is_refused(tmp_path, change, message):
    identified(tmp_path)
    change(tmp_path)
    with pytest.raises(TwinError, match=message) as refused:
        study(tmp_path, IDENTIFIED.format(n=2))
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('"transfer-function"', '"linkage"', r"\[vary.model\]: needs \[fly\] gimbal"),
        ('duration_s = 0.2', 'model = "model.json"', r"\[vary.model\]: needs .* without a model"),
        ('[design]', '[vary."model.gain"]\ndistribution = "normal"\nmean = 1\nsd = 1\n[design]',
         r"\[vary.model.gain\]: \[vary.model\] varies the whole model"),
        ('[vary.model]', '[vary.gimbal_model]', r"is for \[vary.model\]"),
        ('[vary.model]', '[vary.model]\nrelative = true', "without relative"),
        ('[vary.model]', '[vary.model]\nnominal = 1', "nominal 1: a number is for"),
        ('[design]', '[design]\nkind = "sensitivity"', "model has a covariance, and Sobol"),
    ],
)  # fmt: skip
def test_contradictions_of_an_identified_model_are_refused(tmp_path, old, new, message):
    identified(tmp_path)
    text = IDENTIFIED.format(n=2).replace(old, new)
    with pytest.raises(TwinError, match=message) as refused:
        binding((s := study(tmp_path, text)).fly, s.vary, s.folder)
    assert "\n" not in str(refused.value)
