"""A board's recordings over time: which board, what left its interval, when it will."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from analysis.estimate import AxisDrift, Property, Track
from analysis.recording import Recording
from analysis.report import render
from tests.twin.cli.test_cli import run as command
from twin.config import History
from twin.errors import TwinError
from twin.evaluation import history as verb
from twin.evaluation.drift import RunDrift
from twin.evaluation.history import LINKAGE, OTHER, _of_one_board, board_of, title_of
from twin.evaluation.history_page import sections
from twin.evaluation.history_result import Entry, HistoryResult, due, outside

GAIN = Property("gain", "", 1.0, 1.0, 0.01)
BACKLASH = Property("backlash", "°", 180.0 / np.pi, 0.0087, 0.0017)
SPEED = Property("speed", "", 1.0, 1.0, 0.03, bias=0.04)
DAY = 86400.0


def entry(day, gain, backlash=0.0087):
    track = Track(np.zeros(1), np.array([[gain, backlash]]), np.array([[0.01, 0.0017]]))
    drift = RunDrift((GAIN, BACKLASH), {"y": AxisDrift(track, (), np.zeros(0), np.zeros(0))})
    return Entry(Path(f"{day}.rrd"), 1.7e9 + day * DAY, drift, {"y": 98.0})


def run(**properties):
    return Recording(properties, {})


def calibrated(serial):
    return run(files={"calibration": {"text": f'{{"rig": "{serial}"}}'}}, configuration={})


def test_a_board_is_its_calibrations_serial_number():
    assert board_of(calibrated("0000beef")) == "0000beef"
    assert board_of(run(configuration={"unit": 7, "gimbal": "emulator"})) == "unit-7"
    hostile = run(files={"calibration": {"text": "[" * 9000}}, configuration={"gimbal": "emulator"})
    assert board_of(hostile) == "emulator without a calibration"
    assert title_of("unit-7") == "simulated unit 7, uncalibrated"
    assert title_of("0000beef") == "board 0000beef"


def test_recordings_of_several_boards_are_refused_until_one_is_named():
    runs = [(Path("a.rrd"), calibrated("01")), (Path("b.rrd"), calibrated("02"))]
    with pytest.raises(TwinError, match=r"the recordings are of 01, 02; give one of them, or"):
        _of_one_board(runs, History((Path("here"),)))
    with pytest.raises(TwinError, match="--board"):
        _of_one_board(runs, History((Path("here"),), board="03"))
    assert _of_one_board(runs, History((Path("here"),), board="02")) == ("02", [runs[1]])


def test_a_board_is_named_by_its_number_or_its_beginning():
    units = [run(configuration={"unit": n, "gimbal": "emulator"}) for n in (7, 70, 81)]
    runs = [(Path(f"{k}.rrd"), r) for k, r in enumerate([*units, calibrated("0000beef")])]
    runs.append((Path("plain.rrd"), run(configuration={"gimbal": "emulator"})))
    for asked, name in {"unit-7": "unit-7", "8": "unit-81", "0000b": "0000beef",
                        "emulator": "emulator without a calibration"}.items():  # fmt: skip
        assert _of_one_board(runs, History((Path("here"),), board=asked))[0] == name
    with pytest.raises(TwinError, match="--board"):
        _of_one_board(runs, History((Path("here"),), board="7"))  # 7 or 70


def test_a_property_outside_three_standard_deviations_is_named():
    worn = entry(3, 1.0, backlash=0.0087 + np.radians(0.5))
    assert outside(worn) == ["y: backlash 1.00° ± 0.19, of 0.50°"]
    assert outside(entry(3, 1.02)) == []
    assert due([entry(0, 1.0), worn]) == ()  # backlash is not of the calibration
    assert due([entry(0, 1.0), entry(3, 1.05)])[0].startswith("y: gain 1.05")


def test_an_axis_that_stands_still_in_the_last_recording_is_due_by_an_earlier_one():
    moved = entry(3, 1.05)
    still = replace(moved, drift=replace(moved.drift, axes={"x": entry(4, 1.0).drift.axes["y"]}))
    assert due([entry(0, 1.0), moved, still]) == due([entry(0, 1.0), moved]) != ()


def test_a_unit_unlike_the_model_is_due_when_it_differs_from_its_first_recording():
    assert due([entry(0, 0.94)]) == ()
    assert due([entry(0, 0.94), entry(3, 0.95)]) == ()
    assert due([entry(0, 0.94), entry(3, 1.0)]) == ("y: gain 1.00, at first 0.94",)


def test_the_trend_of_a_calibration_says_when_it_is_due():
    # 0.002 a day and no scatter but 0.0001: 0.03 is reached on day 15, nine days after the last
    runs = [entry(d, 1.0 + 0.002 * d + 1e-4 * (-1) ** d) for d in range(7)]
    (text,) = due(runs)
    assert text == "y: gain leaves its interval in about 9 days"
    rng = np.random.default_rng(3)
    assert due([entry(d, 1.0 + 0.005 * rng.standard_normal()) for d in range(7)]) == ()


def test_the_page_has_a_chart_for_each_property_and_a_line_for_each_recording(tmp_path):
    runs = (entry(0, 1.0), entry(1, 1.05))
    page = tmp_path / "history.html"
    parts = sections(HistoryResult("01", runs, (), due(runs), page, OTHER))
    render(parts, "History", page, {})
    text = page.read_text()
    assert "The calibration is due: y: gain 1.05, at first 1.00" in text
    assert "0.rrd" in text
    assert "1.rrd" in text
    chart = parts[-1].parts[0]
    assert [p.y_label for p in chart.panels] == ["gain", "backlash [°]"]
    marks = [line for line in chart.lines if line.style == "dots" and line.panel == 0]
    np.testing.assert_allclose(marks[0].x, [0.0, 24.0])  # hours


def test_the_limits_of_a_biased_property_are_of_its_model_and_its_bias():
    track = Track(np.zeros(1), np.array([[1.0]]), np.array([[0.05]]))
    drift = RunDrift((SPEED,), {"y": AxisDrift(track, (), np.zeros(0), np.zeros(0))})
    run = Entry(Path("0.rrd"), 1.7e9, drift, {"y": 98.0})
    chart = sections(HistoryResult("01", (run,), (), (), Path("h.html"), OTHER))[-1].parts[0]
    limits = [line.y[0] for line in chart.lines if line.style == "dash"]
    np.testing.assert_allclose(limits, [0.85, 1.15])  # three times 0.05, of sides 0.03 and 0.04


@pytest.mark.parametrize(("gimbal", "model"), [("linkage", LINKAGE), ("direct", OTHER)])
def test_the_result_says_which_model_the_recordings_are_compared_with(
    tmp_path, monkeypatch, gimbal, model
):
    kept = run(shadow={"gimbal": gimbal}, configuration={"unit": 7})
    monkeypatch.setattr(verb, "_runs", lambda _: ([(Path("a.rrd"), kept)], []))
    monkeypatch.setattr(verb, "_date", lambda *_: 1.7e9)
    monkeypatch.setattr(verb, "run_drift", lambda *_: entry(0, 1.0).drift)
    monkeypatch.setattr(verb, "_fits", lambda *_: {"y": 98.0})
    (tmp_path / "a.rrd").touch()
    result = verb.history(History((tmp_path,), out=tmp_path / "h.html"))
    assert dict(result.rows())["model"] == result.as_dict()["model"] == model
    assert model in (tmp_path / "h.html").read_text().replace("&#x27;", "'").replace("&#39;", "'")


@pytest.mark.parametrize("place", ["nothing", "."])
def test_a_folder_without_recordings_is_refused(capsys, tmp_path, monkeypatch, place):
    monkeypatch.chdir(tmp_path)
    code, _, error = command(capsys, "history", place)
    assert code == 2
    assert error.count("\n") == 1
    assert not list(tmp_path.rglob("*.html"))


def test_several_folders_and_files_are_read_each_recording_once(tmp_path):
    for name in ("one/b.rrd", "one/a.rrd", "two/c.rrd", "two/d.csv"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).touch()
    places = [tmp_path / "two" / "c.rrd", tmp_path / "one", tmp_path / "two"]
    assert [p.name for p in verb._files(places)] == ["c.rrd", "a.rrd", "b.rrd"]


def test_a_folder_without_recordings_among_others_is_named(capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("full").mkdir()
    Path("full/a.rrd").touch()
    Path("empty").mkdir()
    code, _, error = command(capsys, "history", "full", "empty")
    assert (code, error) == (2, "twin: empty: has no recordings (.rrd)\n")
