"""The map against regions whose boundary is known."""

import math
from dataclasses import replace

import numpy as np
import pyarrow as pa
import pytest

from tests.twin.campaigns.studies import HIT, place, study
from twin.campaigns.flying.runs import Runs
from twin.campaigns.results.answers import answers
from twin.campaigns.results.page import sections
from twin.campaigns.results.result import CampaignResult
from twin.campaigns.statistics.boundary import region


def test_the_boundary_of_a_known_region():
    rng = np.random.default_rng(2)
    x = {"gain": rng.uniform(1.0, 10.0, 3000), "delay": rng.uniform(0.0, 0.1, 3000)}
    # P = 0.9 where 4 ln(gain) − 60 delay − 4 = ln 9, with delay 0.02: gain = exp(1.849) = 6.36
    p = 1.0 / (1.0 + np.exp(-(4.0 * np.log(x["gain"]) - 60.0 * x["delay"] - 4.0)))
    hits = (rng.random(3000) < p).astype(float)
    found = region(x, hits, {"gain": 8.0, "delay": 0.02}, 0.95)
    gain, delay = found.properties
    exact = math.exp((math.log(9.0) + 4.0 + 60.0 * 0.02) / 4.0)
    assert gain.threshold.low < exact < gain.threshold.high
    assert gain.threshold.value == pytest.approx(exact, rel=0.1)
    assert (gain.better, delay.better) == (1, -1)
    assert gain.margin == pytest.approx(8.0 / gain.threshold.value)
    f = found.frontier("delay", "gain")
    k = int(np.argmin(np.abs(f.at - 0.02)))
    assert f.value[k] == pytest.approx(gain.threshold.value, rel=0.03)
    assert f.low[k] < exact < f.high[k]


def test_the_page_draws_the_boundary_between_the_two_smallest_margins(tmp_path):
    uniform = '[vary.{}]\ndistribution = "uniform"\nlow = 0\nhigh = 6\nnominal = {}\n'
    text = uniform.format("wind_speed", 1) + uniform.format("wind_azimuth", 1.5)
    s = study(tmp_path, f"{text}[design]\nn = 300\n{HIT}")
    runs = Runs(s)
    work = place(s, runs, lambda v: (v["wind_speed"] + v["wind_azimuth"] - 6.0, 0.0))
    table = pa.Table.from_pylist([work(run) for run in range(300)])
    a = answers(s, runs, table)
    f = a.frontier
    there = np.isfinite(f.value)
    # hits up to a sum of 7
    assert f.value[there] + f.at[there] == pytest.approx(np.full(there.sum(), 7.0), abs=0.5)
    assert there.sum() > 20
    made = CampaignResult(a, "out", "", "", 300, 300, 300, (), 1.0)
    plots = [part for section in sections(s, made, table) for part in section.parts]
    assert [p.name for p in plots if getattr(p, "name", "") == "frontier"]
    influences = next(t for t in plots if "partial rank correlation" in getattr(t, "head", ()))
    assert len(influences.head) == 2  # no columns of Sobol indices, which this design does not give
    few = table.slice(0, 17)
    made = replace(made, answers=answers(s, runs, few))
    missing = next(part for part in sections(s, made, few) if part.name == "map")
    # three for each of 1, x, y, x², y², xy
    assert "needs 18 runs over 2 parameters" in missing.text[0]
    assert missing.text[0].endswith("Give a larger n in [design].")
    hits = table.filter(table["hit"])  # enough of them, and none that misses
    made = replace(made, answers=answers(s, runs, hits))
    missing = next(part for part in sections(s, made, hits) if part.name == "map")
    assert missing.text[0].endswith(
        "Give a narrower limit in [measure], or other ranges in [vary]."
    )


def test_a_threshold_that_part_of_the_resamples_lack_has_an_open_end():
    rng = np.random.default_rng(4)
    gain = rng.uniform(0.0, 10.0, 1000)
    hits = (rng.random(1000) < 1.0 / (1.0 + np.exp(-gain - 1.8))).astype(float)  # 90 % at 0.4
    (found,) = region({"gain": gain}, hits, {"gain": 8.0}, 0.95).properties
    assert found.threshold.low == -math.inf
    assert found.threshold.value < found.threshold.high < 1.5
    assert "(open to 0." in found.limit


def test_a_region_without_failures_has_no_boundary():
    x = {"gain": np.linspace(1.0, 2.0, 200)}
    assert region(x, np.ones(200), {}, 0.95) is None


def test_a_parameter_of_a_star_that_never_misses_has_no_limit_in_its_range(tmp_path):
    uniform = '[vary.{}]\ndistribution = "uniform"\nlow = 0\nhigh = 6\nnominal = 1\n'
    text = "".join(map(uniform.format, ("wind_speed", "wind_azimuth")))
    s = study(tmp_path, f"{text}[design]\nkind = 'star'\nn = 128\n{HIT}")
    work = place(s, runs := Runs(s), lambda v: (v["wind_speed"] - 2.0, 0.0))
    table = pa.Table.from_pylist([work(run) for run in range(runs.count)])
    speed, azimuth = answers(s, runs, table).map
    assert (speed.name, speed.better) == ("wind_speed", -1)  # hits below 3
    assert speed.threshold is not None
    assert (azimuth.name, azimuth.limit) == ("wind_azimuth", "no limit in its range")
    assert azimuth.low[0] == pytest.approx(128 / (128 + 1.96**2), abs=1e-4)  # Wilson of 128 of 128
