"""A recording as a pandas table: every value at its stamp, nothing invented between them."""

import subprocess
import sys
from types import MappingProxyType

import numpy as np
import pytest

from analysis.recording import Recording, RecordingError, TimeSeries


def series(name, time, values, components):
    values = np.asarray(values, float).reshape(len(time), -1)
    return TimeSeries(name, np.asarray(time, float), values, "rad", components)


@pytest.fixture
def run():
    signals = (
        series("gimbal/command", [0.0, 0.1, 0.2], [1, 2, 3, 4, 5, 6], ("x", "y")),
        series("gimbal/measured", [0.05, 0.1, 0.1], [7, np.nan, 9], ("x",)),
    )
    return Recording({}, MappingProxyType({s.name: s for s in signals}))


def test_signals_of_different_stamps_stand_in_one_table(run):
    frame = run.frame()
    assert frame.index.name == "time"
    assert frame.index.tolist() == [0.0, 0.05, 0.1, 0.2]
    assert list(frame) == ["gimbal/command.x", "gimbal/command.y", "gimbal/measured.x"]
    nan = np.nan
    np.testing.assert_array_equal(frame["gimbal/command.y"], [2, nan, 4, 6])
    np.testing.assert_array_equal(frame["gimbal/measured.x"], [nan, 7, 9, nan])


def test_stamps_that_differ_by_rounding_alone_are_one_row():
    a = series("a", [0.1 + 0.2], [1.0], ("x",))
    b = series("b", [0.3], [2.0], ("x",))
    frame = Recording({}, MappingProxyType({"a": a, "b": b})).frame()
    assert frame.values.tolist() == [[1.0, 2.0]]


@pytest.mark.parametrize("signals", ["gimbal/measured", ["gimbal/measured"]])
def test_some_signals_are_chosen_by_name(run, signals):
    assert run.frame(signals).shape == (2, 1)


def test_a_signal_that_was_not_recorded_is_named(run):
    with pytest.raises(RecordingError, match="gimbal/measured"):
        run.frame(["gimbal/mesured"])


def test_a_recording_without_signals_is_an_empty_table():
    assert Recording({}, MappingProxyType({})).frame().empty


def test_without_pandas_the_extra_is_named():
    code = (
        "import sys; sys.modules['pandas'] = None\n"
        "from analysis.recording import Recording; Recording({}, {}).frame()"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert "ImportError: frame() needs pandas; run pip install '.[notebook]'" in done.stderr
