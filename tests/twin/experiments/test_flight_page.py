"""Charts of a flight on a report's page, also on a narrow screen."""

import json
import re
import shutil
import time

import pytest

from analysis.recording import read
from tests import browser
from twin.config import Fly, Report
from twin.evaluation.report import write_report
from twin.experiments.flight.fly import fly
from twin.plant.model.compose import MJCF


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    """A flight to the east: its north is centimetres."""
    folder = tmp_path_factory.mktemp("page")
    rocket = MJCF / "examples" / "large_rocket.xml"
    fly(Fly(vehicle=rocket, duration_s=8.0, out=folder / "f.rrd"))
    write_report(Report((folder / "f.rrd",), out=folder / "f.html"))
    return folder / "f.html", read(folder / "f.rrd")


def test_neither_axis_of_a_ground_track_is_less_than_a_tenth_of_the_other(page):
    file, recording = page
    plots = json.loads(re.search(r'id="?plots"?[^>]*>(.*?)</script>', file.read_text(), re.S)[1])
    (track,) = [p for s in plots for p in s["panels"] if p["title"] == "ground track"]
    way = recording["vehicle/position"].values
    east, north = (float(way[:, k].max() - way[:, k].min()) for k in (0, 1))
    assert north < 0.01 * east
    low, high = track["y_range"]
    assert high - low == pytest.approx(0.1 * east, rel=0.02)
    assert track["x_range"] is None


@pytest.mark.skipif(not any(map(shutil.which, browser.NAMES)), reason="needs chromium")
def test_on_a_narrow_screen_every_chart_of_a_flight_has_numbers_and_a_label_below(page):
    file, _ = page
    shown = (
        "(() => { const f = document.getElementById('plot-flight')._fullLayout;"
        " return Object.keys(f).filter(k => k.startsWith('xaxis'))"
        ".map(k => [f[k].showticklabels, f[k].title.text]); })()"
    )
    with browser.opened(file.as_uri(), (500, 900)) as opened:

        def value(expression):
            answer = opened.send("Runtime.evaluate", expression=expression, returnByValue=True)
            return answer["result"].get("value")

        until = time.monotonic() + 60.0
        while not value("document.documentElement.dataset.drawn") and time.monotonic() < until:
            time.sleep(0.1)
        axes = value(shown)
    assert len(axes) >= 5
    labels = {"time [s]", "east [m]", "distance from the launch [m]"}
    assert all(ticks and label in labels for ticks, label in axes), axes
