"""Flights in reports and comparisons: their figures are those that `twin fly` printed."""

import math
from pathlib import Path

import numpy as np
import pytest

from analysis.flown import attack, flown
from analysis.recording import read
from twin.config import Compare, Export, Fly, Report
from twin.errors import TwinError
from twin.evaluation.compare import compare
from twin.evaluation.export import export
from twin.evaluation.report import write_report
from twin.experiments.fly import fly
from twin.plant.compose import MJCF

ROCKET = MJCF / "examples" / "large_rocket.xml"


@pytest.fixture(scope="module")
def passive(tmp_path_factory):
    """Two flights without a gimbal, in calm air and in wind, and their results."""
    folder = tmp_path_factory.mktemp("passive")
    return {
        name: fly(Fly(vehicle=ROCKET, set=wind, out=folder / f"{name}.rrd"))
        for name, wind in (("calm", ()), ("windy", ("wind_speed=5",)))
    }


@pytest.fixture(scope="module")
def files(passive):
    return {name: Path(result.recording) for name, result in passive.items()}


def test_the_report_of_a_passive_flight_is_about_the_flight(passive, files, tmp_path):
    numbers = write_report(Report((files["windy"],), out=tmp_path / "a.html")).numbers
    assert numbers.title == "Flight report"
    (run,) = numbers.runs
    assert run.label == "windy"
    text = (tmp_path / "a.html").read_text(encoding="utf-8")
    for absent in ('id="histories"', 'id="comparison"', "attitude error", "twin step"):
        assert absent not in text
    expected = passive["windy"].figures
    for name in ("apogee_m", "apogee_s", "rail_exit_speed_m_s", "impact_speed_m_s", "end_east_m"):
        assert run.flight.numbers[name] == getattr(expected, name)
    assert run.flight.numbers["margin_loaded"] == passive["windy"].static_margin[0]
    assert run.flight.texts["wind"].startswith("5 m/s from the west")
    descent = passive["windy"].flight_time_s - expected.apogee_s
    assert run.flight.numbers["descent_s"] == pytest.approx(descent)


def test_the_largest_angle_of_attack_has_one_definition(passive, files):
    """Of the recorded signals, computed here, and of the flight's own figures."""
    recording, figures = read(files["windy"]), passive["windy"].figures
    time = recording["vehicle/airspeed"].time
    speed = recording["vehicle/airspeed"].values[:, 0]
    angle = np.degrees(recording["vehicle/angle_of_attack"].values[:, 0])
    climb = (time > figures.rail_exit_s) & (time <= figures.apogee_s)
    worst = angle[climb & (speed >= speed[climb].max() / 3)].max()
    assert figures.max_angle_of_attack_deg == pytest.approx(worst, rel=1e-9)
    shown = attack(recording, flown(recording).numbers)[1]
    assert math.degrees(shown.max()) == pytest.approx(worst, rel=1e-9)
    first = angle[climb][0]
    assert figures.rail_exit_angle_of_attack_deg == pytest.approx(first, rel=1e-9)
    assert first > worst  # which is why they are two figures


def test_passive_flights_are_compared_by_apogee_and_range(passive, files, tmp_path):
    pair = (files["calm"], files["windy"])
    found = compare(Compare(pair, out=tmp_path / "c.rrd"))
    a, b = (passive[name].figures for name in ("calm", "windy"))
    assert found.as_dict()["difference"]["apogee_m"] == b.apogee_m - a.apogee_m
    apart = math.hypot(b.end_east_m - a.end_east_m, b.end_north_m - a.end_north_m)
    assert found.ends_apart == pytest.approx(apart)
    assert found.rows()[2][0] == "apogee"
    assert not any(row[0].startswith(("fit", "delay", "rmse")) for row in found.rows())
    assert (tmp_path / "c.rrd").stat().st_size > 1000
    assert not (tmp_path / "c.rrd.partial").exists()


@pytest.mark.parametrize(
    ("names", "asked", "says"),
    [
        (("calm", "windy"), {"fail_below": 90.0}, "--fail-below: is about a gimbal"),
        (("calm",), {}, "give another flight too"),
    ],
)
def test_what_a_passive_flight_cannot_answer_is_refused(files, tmp_path, names, asked, says):
    out = tmp_path / "c.rrd"
    with pytest.raises(TwinError, match=says):
        compare(Compare(tuple(files[n] for n in names), out=out, **asked))
    assert not out.exists()


@pytest.mark.parametrize("kind", ["csv", "parquet"])
def test_an_exported_flight_keeps_what_its_format_can_hold(passive, files, tmp_path, kind):
    table = tmp_path / f"f.{kind}"
    export(Export(files["calm"], to=kind, out=table))
    found, figures = flown(read(table)), passive["calm"].figures
    assert found.numbers["apogee_m"] == pytest.approx(figures.apogee_m, rel=1e-9)
    assert ("margin_loaded" in found.numbers) == (kind == "parquet")  # CSV has signals alone


def test_the_report_of_a_flight_to_a_point_names_target_approach_and_wind(tmp_path):
    asked = {"programme": "point", "gimbal": "transfer-function", "duration_s": 2.0}
    result = fly(Fly(**asked, set=("wind_speed=3",), out=tmp_path / "p.rrd"))
    report = write_report(Report((tmp_path / "p.rrd",), out=tmp_path / "p.html"))
    found = report.numbers.runs[0].flight
    assert found.numbers["closest_approach_m"] == result.closest_approach_m
    assert found.target == result.target_m
    text = (tmp_path / "p.html").read_text(encoding="utf-8")
    for words in ("closest approach", "target, east, north, up", "3 m/s from the west", "missed"):
        assert words in text
