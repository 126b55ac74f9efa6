"""Tables in tests/data, of a gimbal of another make, against the constants of its simulation."""

import pytest

from analysis.comparison.compare import compare
from analysis.identify import identify
from analysis.recording import Columns
from analysis.recording.columns import measurement_of_table
from analysis.recording.tables import read
from tests.data.generate import DELAY, FOLDER, GAIN, LAG, LATER, SHORT


def _measured(name):
    columns = Columns("t_s", ("command_deg",), ("angle_deg",), unit="deg")
    return measurement_of_table(read(FOLDER / name), columns)


@pytest.mark.parametrize(("name", "delay"), [("gimbal_a.csv", DELAY), ("gimbal_b.csv", LATER)])
def test_a_measured_gimbal_is_identified(name, delay):
    model = identify([_measured(name)], 1)
    dead, lag = model.estimate("x/x delay"), model.estimate("x/x time constant")
    assert GAIN - SHORT < model.estimate("x/x gain").value < GAIN
    assert abs(dead.value - delay) < 2.0 * dead.std
    # delay and lag are hard to tell apart by readings every 8 ms, their sum is not
    assert dead.value + lag.value == pytest.approx(delay + LAG, abs=1e-3)
    assert model.fit > 93.0


def test_two_measured_gimbals_are_compared():
    found = compare(_measured("gimbal_a.csv").angle, _measured("gimbal_b.csv").angle).axes[0]
    assert found.delay == pytest.approx(LATER - DELAY, abs=0.5e-3)
    assert found.aligned.fit > 95.0 > found.as_is.fit
