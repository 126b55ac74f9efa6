"""Repeated flights: what scatters, what does not, and the page about it."""

import json
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest

from analysis.comparison.flights import FlightPath, flight_path
from analysis.recording import read
from tests.twin.cli.test_cli import run as command
from twin.config import Fly
from twin.experiments.flight.result import FlightResult
from twin.experiments.repeat import repeat as study
from twin.experiments.repeat import result as results
from twin.experiments.repeat.repeat import repeat


@pytest.fixture(scope="module")
def flights(tmp_path_factory):
    out = tmp_path_factory.mktemp("repeat") / "flights"
    return repeat(
        Fly(
            gimbal="emulator", unit=4, repeat=3, programme="step", at_s=0.3, duration_s=1.8, out=out
        )
    )


@pytest.mark.thorough
def test_a_rig_scatters_and_its_models_do_not(flights):
    rig, linkage, model = flights.seats
    assert [s.gimbal for s in flights.seats] == ["emulator", "linkage", "transfer-function"]
    assert len(rig.results) == 3
    assert not rig.repeats
    assert rig.spread.worst > 0.0
    for seat in (linkage, model):
        assert seat.repeats
        assert len(seat.results) == 2
        assert seat.spread.worst < 1e-9


def test_the_spread_is_that_of_the_recordings(flights):
    rig = flights.seats[0]
    ends = np.array([flight_path(read(r.recording)).position[-1] for r in rig.results])
    by_hand = np.sqrt(((ends - ends.mean(axis=0)) ** 2).sum() / (len(ends) - 1))
    assert rig.spread.distance[-1] == pytest.approx(by_hand, rel=1e-9)


def test_overshoot_and_settling_are_told_with_their_intervals(flights):
    told = {f.name: f for f in flights.seats[0].figures}
    assert set(told) >= {"overshoot", "settling_time", "rise_time", "attitude_error_rms"}
    assert told["rise_time"].n == 3
    low, high = told["rise_time"].interval
    assert low < told["rise_time"].value < high
    assert flights.seats[1].figures[0].n == 1  # equal to the last bit is one flight


def test_the_page_and_the_numbers_hold_every_seat(flights):
    page = Path(flights.page).read_text()
    for name in ("emulator", "linkage", "transfer-function", "Repeatability"):
        assert name in page
    told = json.loads(json.dumps(flights.as_dict(), allow_nan=False))
    assert [s["flights"] for s in told["seats"]] == [3, 2, 2]
    assert 0.0 < told["differences"]["linkage"]["path_worst"] < 2.0


def test_a_first_flight_unlike_the_others_is_no_repetition(monkeypatch, tmp_path):
    """The four after a cold start are equal to the last bit; all five are told."""
    asides, errors = iter([0.0, 1.0, 1.0, 1.0, 1.0]), iter([5.0, 1.0, 1.0, 1.0, 1.0])

    def flown(_):
        time = np.arange(0.0, 1.0, 0.02)
        position = np.stack([next(asides) + 0 * time, 0 * time, 10 * time], axis=1)
        return FlightPath(time, position, np.tile([0.0, 0.0, 1.0], (len(time), 1)), len(time))

    def result(config):
        return FlightResult(**{
            **{f.name: None for f in fields(FlightResult)}, "recording": str(config.out),
            "attitude_error_rms_deg": next(errors),
        })  # fmt: skip

    monkeypatch.setattr(study, "fly", result)
    monkeypatch.setattr(study, "read", lambda _: None)
    monkeypatch.setattr(study, "flight_path", flown)
    monkeypatch.setattr(study, "attitude_step", lambda _: None)
    (seat,) = repeat(Fly(gimbal="linkage", repeat=5, out=tmp_path / "f")).seats
    assert not seat.repeats
    assert len(seat.paths) == 5
    assert seat.figures[0].n == 5
    assert results._count(seat) == "5 flights"
    assert seat.spread.distance[-1] == pytest.approx(np.sqrt(0.2))


def test_gusts_make_every_flight_another(tmp_path):
    result = repeat(
        Fly(repeat=3, duration_s=2.0, set=("wind_speed=5", "wind_turbulence=0.2"), out=tmp_path)
    )
    (seat,) = result.seats
    assert len(seat.results) == 3
    assert seat.spread.worst > 0.01


def test_parameters_of_servos_stay_with_the_seats_that_have_servos(tmp_path):
    result = repeat(
        Fly(
            gimbal="emulator", repeat=2, duration_s=0.1, out=tmp_path,
            set=("gimbal_servo_gain=1.5", "wind_speed=2"),
        )
    )  # fmt: skip
    asked = {
        seat.gimbal: read(Path(seat.results[0].recording)).properties["configuration"]["set"]
        for seat in result.seats
    }
    assert asked == {
        "emulator": ["gimbal_servo_gain=1.5", "wind_speed=2.0"],
        "linkage": ["gimbal_servo_gain=1.5", "wind_speed=2.0"],
        "transfer-function": ["wind_speed=2.0"],
    }


@pytest.mark.thorough
def test_a_rig_that_fails_at_once_is_named_and_not_compared(capsys, tmp_path):
    line = f"--repeat 2 --duration-s 2 --fault link:unplug:1@0.95 --json --out {tmp_path / 'f'}"
    code, text, _ = command(capsys, "fly", "--gimbal", "emulator", *line.split())
    assert code == 1
    told = json.loads(text)
    assert len(told["seats"][0]["faults"]) == 2
    assert told["differences"] == {}


@pytest.mark.thorough
def test_a_turntables_flights_are_compared_with_models_that_turn_the_same_way(tmp_path):
    result = repeat(
        Fly(
            gimbal="emulator", attitude="base-gyro", programme="step", at_s=0.2, duration_s=0.8,
            repeat=2, out=tmp_path,
        )
    )  # fmt: skip
    for apart in result.differences.values():
        assert np.degrees(apart.attitude_rms) < 1.5


@pytest.mark.parametrize(
    ("more", "told"),
    [
        ("--repeat 0", "1 to 1000"),
        ("--repeat 5000", "1 to 1000"),
        ("--repeat 3 --out a.rrd", "must be a folder or a page"),
        ("--repeat 3 --gimbal linkage --unit 2", "needs a rig"),
        ("--gimbal linkage --on-fault neutral", "needs a rig"),
    ],
)
def test_what_cannot_be_repeated_is_one_line(capsys, tmp_path, monkeypatch, more, told):
    monkeypatch.chdir(tmp_path)
    code, _, err = command(capsys, "fly", *more.split())
    assert code == 2
    assert err.count("\n") == 1
    assert told in err
    assert list(tmp_path.iterdir()) == []
