"""Measuring until known: what is expected of a signal comes true, and what cannot be is refused."""

from dataclasses import replace

import numpy as np
import pytest

import twin
from analysis.identify import Plant, Wish, remaining
from tests.benchmarks import live
from twin.config import Identify
from twin.errors import TwinError
from twin.workflows.live import measurement, pieces


@pytest.fixture(scope="module")
def first():
    """A gimbal, its first piece and the model from it."""
    _, measure = live.unit(3)
    run = measure(measurement.FIRST)
    return measure, run, live.fitted([run])


def test_the_time_errors_of_changes_bound_what_a_delay_can_be_known_to(first):
    """Closed form: n changes, each late by τ at random, leave a delay of deviation τ/√n."""
    _, run, model = first
    plant = Plant(model.channels[0][0], 1e-5, 5.8e-3, run.period)
    times = np.append(0.0, 0.5 + 0.6 * np.arange(16))
    M = plant.information(times, np.append(0.0, np.tile([0.05, 0.0], 8)))
    half = Wish("delay", 1.0).deviation(plant.channel, np.linalg.inv(M))
    assert half == pytest.approx(1.96 * 5.8e-3 / 4.0, rel=0.05)
    twice = remaining(Wish("delay", 1e-9), plant, M, M, 10.0)[0]
    assert twice(30.0) == pytest.approx(0.5 * twice(0.0), rel=1e-6)


def test_a_wish_out_of_reach_is_refused_after_the_first_piece_with_what_is_reachable(first):
    measure, _, model = first
    taken = []

    def one(piece):
        taken.append(piece)
        return measure(piece)

    asked = [Wish("delay", 1e-5)]
    with pytest.raises(TwinError, match=r"delay:0.01ms: needs about .* h .*; .* ms is reachable"):
        measurement.until_known(one, asked, float(live.LARGEST), 60.0, lambda _: model)
    assert taken == [measurement.FIRST]


def test_the_chosen_signal_needs_less_than_longer_holds_and_lets_every_answer_end(first):
    _, run, model = first
    asked = list(live.ASKED)
    piece, needed, _ = pieces.following(model, [run], asked, float(live.LARGEST), 600.0)
    expected = dict(pieces.expected(model, [run], asked, float(live.LARGEST)))
    slow = expected[pieces.Piece("steps", 1.0, 0.8, 1)]
    assert needed < 0.6 * max(t for _, _, t in slow)
    slowest = max(-4.0 / np.roots(row[k].den).real.max() for k, row in enumerate(model.channels))
    assert piece in expected
    assert min(p.hold for p in expected) > slowest


@pytest.mark.parametrize(
    ("until", "message"),
    [
        ("delay:3%", "must be delay:1ms"),
        ("bandwidth:1ms", "must be delay:1ms"),
        ("speed:1%", "natural-frequency"),
        ("gain:0%", "must be"),
        ("gain:nan%", "must be"),
    ],
)
def test_what_is_no_half_width_is_refused(until, message):
    with pytest.raises(TwinError, match=message):
        measurement.wishes(Identify(live="linkage", until=until))


def test_flags_of_a_measurement_and_of_files_exclude_each_other():
    given = Identify(live="linkage", until="gain:3%")
    for change, message in (
        ({"live": None}, "both or neither"),
        ({"servo": True}, "excludes --servo"),
        ({"live": None, "until": None, "sources": ("a.rrd",), "unit": 3}, "--unit 3: needs --live"),
    ):
        with pytest.raises(TwinError, match=message):
            replace(given, **change)


def test_a_seat_is_measured_until_the_gain_is_known(tmp_path):
    found = twin.identify(
        live="transfer-function", until="gain:2%,delay:5ms", out=tmp_path / "m.json"
    )
    assert found.passed
    assert found.file.exists()
    assert sorted((tmp_path / "m-pieces").iterdir()) == sorted(found.pieces)
    true = twin.load("mjcf/gimbal.json")
    assert found.model.channels[0][0].delay == pytest.approx(true.channels[0][0].delay, abs=5e-4)
