"""When a parachute opens, and the burnout beside it: rows, events and the recorded path agree."""

import numpy as np
import pytest

from analysis.recording import read
from tests.twin.physics.test_air import described
from twin.config import Fly
from twin.experiments.flight.fly import fly

TICK = 0.021  # s, of a flight without moving parts


@pytest.fixture(scope="module")
def flight(tmp_path_factory):
    """A drogue that opens at burnout, on the way up, and a parachute 150 m above the ground."""
    folder = tmp_path_factory.mktemp("chutes")
    small, large = (
        '{ diameter = "0.4 m", delay = "0 s" }',
        '{ diameter = "1.5 m", height = "150 m" }',
    )
    file = described(folder, f"parachutes = [{small}, {large}]")
    result = fly(Fly(vehicle=file, out=folder / "f.rrd"))
    return result, read(folder / "f.rrd")


def said(recording, word):
    (event,) = [e for e in recording.events if e.text.startswith(word)]
    return event


def test_the_burnout_is_that_before_a_parachute_that_opens_at_it(flight):
    """The event is of the tick after, its speed that of the row; drag has not begun there."""
    result, recording = flight
    f, velocity = result.figures, recording["vehicle/velocity"]
    speed = np.linalg.norm(velocity.values, axis=1)
    before = speed[velocity.time <= f.burnout_s][-1]
    after = speed[velocity.time > f.burnout_s + 2 * TICK][0]
    assert before - after > 3.0  # m/s, by the drogue
    assert f.burnout_speed_m_s == pytest.approx(before, abs=0.5)
    event = said(recording, "burnout")
    assert event.text.startswith(f"burnout at {f.burnout_speed_m_s:.1f} m/s,")
    assert 0.0 <= event.time - f.burnout_s <= TICK


def test_each_parachute_has_a_row_an_event_and_the_place_where_it_opens(flight):
    result, recording = flight
    drogue, main = (result.parachutes[f"parachute {k}"] for k in (1, 2))
    assert 0.0 <= drogue.time_s - result.figures.burnout_s <= TICK
    assert drogue.speed_m_s == pytest.approx(result.figures.burnout_speed_m_s, abs=0.5)
    path = recording["vehicle/position"]
    falling = path.time > result.figures.apogee_s
    below = path.time[falling & (path.values[:, 2] < 150.0)][0]
    assert main.time_s == pytest.approx(below, abs=TICK)
    rows = dict(result.rows())
    for name, opening in result.parachutes.items():
        assert rows[name] == f"opens at {opening.time_s:.2f} s, {opening.text()}"
        event = said(recording, name)
        assert event.text == f"{name} opens at {opening.text()}"
        assert event.time == pytest.approx(opening.time_s, abs=1e-9)
    assert result.as_dict()["parachutes"]["parachute 2"]["height_m"] == main.height_m
