"""Samples of a study follow their distributions; mistakes in a study are one line."""

from pathlib import Path

import numpy as np
import pytest
from scipy import stats

from tests.twin.campaigns.studies import linear, study
from twin.campaigns.flying.runs import Runs
from twin.campaigns.sampling.design import Streams
from twin.campaigns.sampling.parameters import RESPONSE, Binding, binding, response_model
from twin.errors import TwinError

N = 2000
ALL = np.arange(N)


def values(folder, text, column):
    runs = Runs(study(folder, text))
    return [row[column] for row in runs.values(range(runs.count))]


@pytest.mark.parametrize("kind", ["random", "lhs", "sobol"])
def test_streams_are_uniform_and_independent(kind):
    streams = Streams(kind, N, 3, ["a", "b"])
    a, b = streams.uniform("a", ALL), streams.uniform("b", ALL)
    assert stats.kstest(a, "uniform").pvalue > 1e-4
    assert abs(stats.spearmanr(a, b).statistic) < 4 / np.sqrt(N)
    if kind == "lhs":
        assert np.array_equal(np.sort(np.floor(a * N)), ALL)  # one in every stratum


@pytest.mark.parametrize("kind", ["random", "lhs", "sobol"])
def test_a_parameter_more_changes_no_other_ones_numbers(kind):
    few, many = (Streams(kind, N, 3, names) for names in (["a", "b"], ["a", "b", "c"]))
    assert np.array_equal(few.uniform("b", ALL), many.uniform("b", ALL))
    if kind != "sobol":  # there a parameter is added at the end
        first = Streams(kind, N, 3, ["c", "a", "b"])
        assert np.array_equal(few.uniform("b", ALL), first.uniform("b", ALL))


def test_a_longer_random_campaign_begins_with_the_shorter_one():
    short, long = Streams("random", 10, 3, ["a"]), Streams("random", N, 3, ["a"])
    assert np.array_equal(short.uniform("a", ALL[:10]), long.uniform("a", ALL)[:10])


@pytest.mark.parametrize(
    ("table", "distribution"),
    [
        ('distribution = "normal"\nmean = 2\nsd = 0.5', stats.norm(2, 0.5)),
        ('distribution = "uniform"\nlow = -1\nhigh = 3', stats.uniform(-1, 4)),
        ('distribution = "lognormal"\nmedian = 3\nsigma = 0.4', stats.lognorm(0.4, scale=3)),
    ],
)
def test_samples_have_their_distribution(tmp_path, table, distribution):
    given = values(tmp_path, f"[vary.wind_speed]\n{table}\n[design]\nn = {N}", "wind_speed")
    assert stats.kstest(given, distribution.cdf).pvalue > 1e-4


def test_choice_table_grid_and_covariance(tmp_path):
    text = '[vary.wind_speed]\ndistribution = "choice"\nvalues = [1, 2]\nweights = [1, 3]\n'
    given = values(tmp_path, f"{text}[design]\nn = {N}", "wind_speed")
    assert given.count(2) == pytest.approx(0.75 * N, abs=4 * np.sqrt(0.75 * 0.25 * N))
    (tmp_path / "wind.csv").write_text("time,wind\n0,4\n1,5\n")
    text = '[vary.wind_speed]\ndistribution = "table"\nfile = "wind.csv"\ncolumn = "wind"\n'
    assert set(values(tmp_path, f"{text}[design]\nn = 50", "wind_speed")) == {4.0, 5.0}
    text = (
        '[vary.wind]\ndistribution = "covariance"\nnames = ["wind_speed", "wind_azimuth"]\n'
        f"mean = [5, 1]\ncovariance = [[4, 1.2], [1.2, 1]]\n[design]\nn = {N}"
    )
    both = [values(tmp_path, text, name) for name in ("wind_speed", "wind_azimuth")]
    # standard error of a variance of 4 is 4 √(2/N) = 0.13
    assert np.cov(both) == pytest.approx(np.array([[4, 1.2], [1.2, 1]]), abs=0.4)


def test_every_cell_of_a_grid_sees_the_same_samples(tmp_path):
    text = (
        '[vary.control_kp]\ndistribution = "grid"\nlow = 10\nhigh = 30\ncount = 3\n'
        '[vary.wind_speed]\ndistribution = "uniform"\nlow = 0\nhigh = 5\n[design]\nn = 4'
    )
    runs = Runs(study(tmp_path, text))
    rows = runs.values(range(runs.count))
    assert [r["control_kp"] for r in rows[:3]] == [10.0, 20.0, 30.0]
    assert rows[0]["wind_speed"] == rows[2]["wind_speed"] != rows[3]["wind_speed"]
    assert [runs.sample(r) for r in (0, 2, 3)] == [0, 0, 1]


def test_a_sensitivity_design_changes_one_column_at_a_time(tmp_path):
    runs = Runs(study(tmp_path, linear(8, kind="sensitivity")))
    a, b, one, other = runs.values(range(4))
    assert runs.count == 32
    assert (one["wind_speed"], one["wind_azimuth"]) == (b["wind_speed"], a["wind_azimuth"])
    assert (other["wind_speed"], other["wind_azimuth"]) == (a["wind_speed"], b["wind_azimuth"])


def test_a_star_varies_one_parameter_at_a_time(tmp_path):
    text = linear(8, kind="star").replace("mean = 10", "mean = 10\nnominal = 5")
    runs = Runs(study(tmp_path, text.replace("mean = 0", "mean = 0\nnominal = 1")))
    first, second = runs.values(range(2))
    assert runs.count == 16
    assert (first["wind_azimuth"], second["wind_speed"]) == (1, 5)
    assert first["wind_speed"] != 5
    assert second["wind_azimuth"] != 1


def test_processes_do_not_share_the_file_of_a_model(tmp_path, monkeypatch):
    fly = {"gimbal": "transfer-function"}
    files = set()
    for process in (1, 2):
        monkeypatch.setattr("os.getpid", lambda process=process: process)
        files.add(Binding(fly, {}, 0).config({"model.gain": 1.0}, 0, tmp_path).model)
    assert len(files) == 2


def test_the_response_has_the_bandwidth_asked_for():
    model = response_model({"model.bandwidth_hz": 7.0, "model.damping": 0.4, "model.gain": 1.1})
    channel = model.channel("x", "x")
    s = 2j * np.pi * 7.0
    gain = abs(np.polyval(channel.num, s) / np.polyval(channel.den, s))
    assert gain == pytest.approx(1.1 / np.sqrt(2.0), rel=1e-9)
    assert response_model({"model.slew_deg_s": 300.0}).servo.rate_limit == pytest.approx(5.23599)
    assert set(RESPONSE) >= {"model.delay_s", "model.backlash_deg", "model.dead_band_deg"}


VARY = '[vary.wind_speed]\ndistribution = "uniform"\nlow = 0\nhigh = 5\n'
TWO = f"{VARY}[design]\nn = 2\n"
SPEED = "[vary.wind_speed]\ndistribution = "
JOINT = "[design]\nkind = 'sensitivity'\nn = 4\n"
STAR = "[design]\nkind = 'star'\nn = 4\n"
PAIR = "[vary.w]\ndistribution = 'covariance'\nnames = ['wind_speed', 'wind_azimuth']\n"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", r"\[vary\]: nothing varies"),
        ("x = [", "not TOML"),
        (f"{VARY}[desing]\nn = 1", r"\[desing\]: unknown section"),
        (f"{VARY}[design]\nkind = 'random'", r"\[design\]: random needs n, .* n = 100"),
        (VARY.replace("low", "lo"), "unknown key of uniform 'lo'; did you mean low"),
        (f"{VARY}[design]\nn = true", r"\[design\] n True"),
        (f"{VARY}[design]\nkind = 'grid'", "wind_speed is not a grid"),
        (f"{TWO}[fly]\nseeed = 3", "unknown setting 'seeed'; did you mean seed"),
        (f"{TWO}[fly]\nclock = 'wall'", "a campaign decides it"),
        (f"{TWO}[fly]\ngimbal = '/dev/ttyUSB0'", "use `twin fly --repeat`"),
        (f"{TWO}[measure]\nhit = 'closest_aproach_m < 5'", "did you mean closest_approach_m"),
        (f"{TWO}[measure]\nhit = '__import__(1)'", "must be FIGURE <= NUMBER"),
        (
            f"{TWO}[stop]\nstatistic = 'hit_rate'\nhalf_width = 1",
            "must be NAME_rate of a .measure., cep_m",
        ),
        (f"{TWO}[fail_if]\nlate = 'apoge_m_mean < 5'", "did you mean apogee_m_mean"),
        (f"{TWO}[stop]\nstatistic = 'cep_m'", "needs half_width"),
        (
            f"{TWO}[fail_if]\nlate = 'cep_m = 5'",
            r"\[fail_if\] late: 'cep_m = 5': must be",
        ),
        (f"{SPEED}'gauss'", "'gauss': must be one of normal"),
        (f"{SPEED}'normal'\nmean = 1", "needs sd"),
        (f"{SPEED}'normal'\nmean = 1\nsd = -1", "must be a positive number"),
        (f"{SPEED}'uniform'\nlow = 2\nhigh = 1", "must be less than high"),
        (f"{SPEED}'table'\nfile = 'no.csv'\ncolumn = 'a'", "no.csv"),
        (f"{PAIR}mean = [0, 0]\ncovariance = [[1, 2], [2, 1]]", "and positive definite"),
        (
            f"{JOINT}{PAIR}mean = [0, 0]\ncovariance = [[1, 0], [0, 1]]",
            "w has a covariance, and Sobol",
        ),
        (
            f"{STAR}{PAIR}nominal = 1\nmean = [0, 0]\ncovariance = [[1, 0], [0, 1]]",
            r"\[vary.w\] nominal 1: .* covariance of several",
        ),
        (
            f"{STAR}[vary.gimbal]\ndistribution = 'choice'\nvalues = ['linkage']\nnominal = 1",
            r"\[vary.gimbal\] nominal 1: .* choice of names",
        ),
        (
            f"{STAR}[vary.gimbal]\ndistribution = 'choice'\nvalues = ['linkage']\nnominal = ['a']",
            "nominal 'a': is none of its values",
        ),
        (f"{VARY}{PAIR}mean = [0, 0]\ncovariance = [[1, 0], [0, 1]]", "wind_speed varies twice"),
    ],
)
def test_a_mistake_in_a_study_is_one_line(tmp_path, text, message):
    with pytest.raises(TwinError, match=message) as refused:
        study(tmp_path, text)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("name", "message"),
    [("wind_sped", "did you mean wind_speed"), ("duration_s", "gives it a value already"),
     ("wind_azimuth", "gives it a value already"), ("model.bandwith_hz", "model.bandwidth_hz"),
     ("model.delay_s", "needs .fly. gimbal = 'transfer-function'"), ("gravity", "has 3 values")],
)  # fmt: skip
def test_a_parameter_that_cannot_vary_is_refused(tmp_path, name, message):
    text = f'[vary."{name}"]\ndistribution = "uniform"\nlow = 1\nhigh = 2\n[design]\nn = 2\n'
    s = study(tmp_path, f"{text}[fly]\nduration_s = 1\nset = {{ wind_azimuth = 1 }}\n")
    with pytest.raises(TwinError, match=message):
        binding(s.fly, s.vary)


@pytest.mark.parametrize("where", ["fly", "choice", "set"])
@pytest.mark.parametrize("changed", ["v.toml", "m.eng", "drag.csv"])
def test_a_changed_file_is_another_study_wherever_it_is_named(tmp_path, where, changed):
    mjcf = Path(__file__).parents[3] / "mjcf"
    text = (mjcf / "examples" / "reference.toml").read_text()
    text = text.replace("../motors/reference.eng", "m.eng").replace("drag = 0.5 ", "#")
    (tmp_path / "v.toml").write_text(f'drag_table = "drag.csv"\n{text}')
    (tmp_path / "m.eng").write_bytes((mjcf / "motors" / "reference.eng").read_bytes())
    (tmp_path / "drag.csv").write_text("mach,cd\n0,0.5\n1,0.6\n")
    vary = {
        "fly": f"[fly]\nvehicle = 'v.toml'\n{TWO}",
        "choice": f"{TWO}[vary.vehicle]\ndistribution = 'choice'\nvalues = ['v.toml']",
        "set": f"{TWO}[vary.v]\ndistribution = 'choice'\nvalues = [{{ vehicle = 'v.toml' }}]",
    }[where]
    s = study(tmp_path, vary)
    flight = Binding(s.fly, {}, 0, s.folder).config(Runs(s).values([0])[0], 0, tmp_path)
    assert flight.vehicle == tmp_path / "v.toml"
    with (tmp_path / changed).open("a") as file:
        file.write("\n")
    assert study(tmp_path, vary).digest != s.digest


def test_a_shipped_study_is_named_without_its_ending():
    from twin.campaigns.sampling.study import SHIPPED, read

    for file in SHIPPED.glob("*.toml"):
        s = read(file.stem)
        binding(s.fly, s.vary)
        assert Runs(s).count > 0
    with pytest.raises(TwinError, match="one of dispersion"):
        read("dispersal")
