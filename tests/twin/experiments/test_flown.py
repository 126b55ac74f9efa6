"""Flights in reports and comparisons: their figures are those that `twin fly` printed."""

import math
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

from analysis.flown import Flown, attack, flown
from analysis.recording import read
from twin.config import Compare, Export, Fly, Report
from twin.errors import TwinError
from twin.evaluation.compare import compare
from twin.evaluation.export import export, size_text
from twin.evaluation.flights import _differing, cut_short, leading
from twin.evaluation.report import write_report
from twin.experiments.flight.fly import fly
from twin.plant.model.compose import MJCF

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


def test_a_flight_that_was_cut_short_is_told_and_one_that_landed_earlier_is_none(files, tmp_path):
    fly(Fly(vehicle=ROCKET, duration_s=1.5, out=tmp_path / "short.rrd"))
    found = compare(Compare((files["calm"], tmp_path / "short.rrd"), out=tmp_path / "c.rrd"))
    whole = read(files["calm"])["vehicle/position"].time[-1]
    names = [name for name, _ in found.rows()]
    text = dict(found.rows())["ended"]
    assert text.startswith(f"at {whole:.2f} s, at 1.50 s; both are compared until 1.50 s")
    assert names.index("ended") < names.index("ends apart")
    assert "paths, 1.5 s" in names
    landed = compare(Compare((files["calm"], files["windy"]), out=tmp_path / "d.rrd"))
    assert "ended" not in dict(landed.rows())


@pytest.mark.parametrize(
    ("times", "cut"),
    [((1.0, 3.0), True), ((3.0, 1.0), True), ((3.0, 3.002), False), ((3.0, None), False)],
)
def test_ends_at_one_time_or_none_are_not_told_apart(times, cut):
    both = tuple(Flown({} if t is None else {"flight_time_s": t}, {}, None) for t in times)
    assert cut_short(both) == (times if cut else None)
    assert ("ended" in dict(leading(both))) == cut


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


def marks(file):
    """Placemarks of points by the first word of their names: longitude, latitude, height."""
    space = "{http://www.opengis.net/kml/2.2}"
    found = {}
    for mark in ElementTree.parse(file).iter(f"{space}Placemark"):
        if mark.find(f"{space}Point") is not None:
            place = mark.find(f"{space}Point/{space}coordinates").text
            found[mark.find(f"{space}name").text.split(",")[0]] = list(map(float, place.split(",")))
    return found


def test_the_map_of_a_flight_shows_launch_apogee_and_landing(passive, files, tmp_path):
    """On a sphere 1e-5 degrees of latitude are 1.11 m; the ellipsoid differs by 0.7 %."""
    made = export(Export(files["windy"], to="kml", out=tmp_path / "f.kml"))
    assert "--latitude-deg" in dict(made.rows())["note"]
    assert made.as_dict()["note"] == made.note
    at, figures = marks(tmp_path / "f.kml"), passive["windy"].figures
    assert list(at) == ["launch", "apogee", "landing"]
    assert at["apogee"][2] - at["launch"][2] == pytest.approx(figures.apogee_m, abs=0.1)
    east = math.radians(at["landing"][0] - at["launch"][0]) * 6371e3
    assert east == pytest.approx(figures.end_east_m, rel=0.01)


@pytest.mark.parametrize(
    ("name", "kind", "says"),
    [
        ("f.csv", "csv", "is csv already"),
        ("f.csv", "glb", "no 3D scene, which glb needs"),
        ("f.txt", "csv", "must be a recording"),
    ],
)
def test_what_cannot_be_exported_again_is_one_line(tmp_path, name, kind, says):
    (tmp_path / name).write_text("x")
    with pytest.raises(TwinError, match=says):
        export(Export(tmp_path / name, to=kind))
    assert len(list(tmp_path.iterdir())) == 1


@pytest.mark.thorough
def test_an_export_is_exported_again_to_the_last_bit(tmp_path):
    """Parquet files have the figures too, CSV files the signals alone."""
    result = fly(Fly(vehicle=ROCKET, duration_s=0.5, out=tmp_path / "f.rrd"))
    assert result.max_speed_m_s == result.figures.max_ascent_speed_m_s  # it ends in its climb
    export(Export(tmp_path / "f.rrd", to="parquet"))
    export(Export(tmp_path / "f.parquet", to="csv"))
    a, b, c = (read(tmp_path / f"f.{kind}") for kind in ("rrd", "parquet", "csv"))
    assert all(np.array_equal(a[n].values, c[n].values, equal_nan=True) for n in a.series)
    assert flown(b) == flown(a)
    height = flown(c).numbers["max_height_m"]  # one tick short of the end
    assert height == pytest.approx(result.max_height_m, abs=result.max_speed_m_s * 0.005)
    assert "margin_loaded" not in flown(c).numbers


@pytest.mark.parametrize(
    ("count", "text"), [(0, "0 B"), (999, "999 B"), (1000, "1 kB"), (46_812, "46.8 kB"),
                        (3_600_000, "3.6 MB"), (12_345_678_901, "12.3 GB")],
)  # fmt: skip
def test_sizes_have_the_unit_that_suits_them(count, text):
    assert size_text(count) == text


def test_the_report_of_a_flight_to_a_point_names_target_approach_and_wind(tmp_path):
    asked = {"programme": "point", "gimbal": "transfer-function", "duration_s": 2.0}
    result = fly(Fly(**asked, set=("wind_speed=3",), out=tmp_path / "p.rrd"))
    report = write_report(Report((tmp_path / "p.rrd",), out=tmp_path / "p.html"))
    found = report.numbers.runs[0].flight
    assert found.numbers["closest_approach_m"] == result.closest_approach_m
    assert found.target == result.target_m
    text = (tmp_path / "p.html").read_text(encoding="utf-8")
    export(Export(tmp_path / "p.rrd", to="kml"))
    at = marks(tmp_path / "p.kml")
    assert at["target"][2] - at["launch"][2] == pytest.approx(result.target_m[2], abs=0.02)
    east = math.radians(at["target"][0] - at["launch"][0]) * 6371e3
    assert east == pytest.approx(result.target_m[0], rel=0.01)
    for words in ("closest approach", "target, east, north, up", "3 m/s from the west", "missed"):
        assert words in text


@pytest.mark.parametrize(
    ("values", "text"),
    [
        ((386.5, -1079.1), "386.5 m, -1079.1 m: -1465.6 m"),
        ((0.0123, -0.0004), "0.0123 m, -0.0004 m: -0.0127 m"),
        ((12.5, 12.62), "12.500 m, 12.620 m: +0.120 m"),
        ((123456.7, 100.4), "123457 m, 100 m: -123356 m"),
        ((0.0, None), "0.0000 m, none"),
    ],
)
def test_a_row_has_one_format_for_both_figures_and_their_difference(values, text):
    both = [Flown({} if v is None else {"end_east_m": v}, {}, None) for v in values]
    assert _differing(tuple(both))[0] == [("end, east of the launch", text)]
