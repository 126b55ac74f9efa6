"""Signals, units and the way to storage and back."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as npst

from analysis import schema
from tests.conftest import ROOT

FINITE = st.floats(-1e9, 1e9, allow_subnormal=False)


@given(
    st.sampled_from(list(schema.SIGNALS.values())),
    npst.arrays(np.float64, npst.array_shapes(max_dims=3), elements=FINITE),
)
def test_storing_and_reading_back_changes_at_most_the_last_bits(signal, values):
    back = signal.from_stored(signal.to_stored(values))
    # one rounding each way, half a unit in the last place each
    np.testing.assert_allclose(back, values, rtol=2.3e-16, atol=1e-300)


@given(npst.arrays(np.float64, 4, elements=FINITE))
def test_sensor_readings_survive_bit_for_bit(values):
    exact = [s for s in schema.SIGNALS.values() if s.name.startswith("sensors/")]
    for signal in exact:
        if signal.name != "sensors/pulse":  # whole half-microseconds; see below
            assert np.array_equal(signal.from_stored(signal.to_stored(values)), values)


def test_pulse_widths_in_timer_counts_survive_bit_for_bit():
    widths = np.arange(1000, 6000) * 0.5e-6  # Timer1 counts of 0.5 µs, 0.5 … 3 ms
    signal = schema.SIGNALS["sensors/pulse"]
    counts = np.rint(signal.from_stored(signal.to_stored(widths)) / 0.5e-6)
    assert np.array_equal(counts, np.arange(1000, 6000))


def test_angles_are_stored_in_degrees():
    signal = schema.SIGNALS["gimbal/command"]
    assert signal.to_stored([math.pi, -math.pi / 2]).tolist() == [180.0, -90.0]


def test_every_signal_can_be_stored():
    for signal in schema.SIGNALS.values():
        assert signal.entity == f"/{signal.name}"
        assert schema.ENTITIES[signal.entity] is signal
        assert len(set(signal.components)) == len(signal.components) > 0
        assert signal.scale > 0.0


def test_stored_units_are_what_their_names_say():
    """By the prefixes of the SI brochure, and 360° a turn."""
    one = {"ms": 1e-3, "µs": 1e-6, "µm": 1e-6, "deg": math.tau / 360, "deg/s": math.tau / 360}
    for signal in schema.SIGNALS.values():
        value = one.get(signal.stored_unit, 1.0)
        assert signal.to_stored([value])[0] == pytest.approx(1.0, rel=1e-15), signal.name


def test_a_wrong_name_is_answered_with_the_right_ones():
    with pytest.raises(
        schema.AnalysisError, match=r"'gimbal/comand'.*did you mean.*timing/lateness"
    ):
        schema.signal("gimbal/comand")


def test_the_manual_lists_every_signal_with_its_units():
    text = (ROOT / "docs" / "recording.md").read_text(encoding="utf-8")
    for signal in schema.SIGNALS.values():
        components = ", ".join(signal.components)
        row = f"| `{signal.entity}` | {components} | {signal.stored_unit} | {signal.unit} |"
        assert row in text, f"docs/recording.md lacks: {row}"
