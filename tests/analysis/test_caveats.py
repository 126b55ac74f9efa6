"""Reasons to doubt recordings."""

from dataclasses import replace

import numpy as np

from analysis.recording import Event, Recording, TimeSeries, measurement
from analysis.recording.caveats import LONGEST, caveats

T = np.arange(0.0, 1.0, 0.1)


def run(name, command="step", timing=None, events=(), **settings):
    recording = Recording(
        {"command": command, "configuration": settings}, {}, tuple(events), timing=timing or {}
    )
    return replace(measurement(T, 0 * T, angle=T, name=name), recording=recording)


def test_valid_runs_of_one_kind_have_none():
    a = run("a", signal="steps", gimbal="emulator")
    b = run("b", signal="steps", gimbal="linkage", timing={"verdict": "valid", "reasons": []})
    assert caveats([a, b]) == ()


def test_a_run_that_was_not_on_time_or_failed_is_named_with_the_reason():
    late = run("a", timing={"verdict": "invalid", "reasons": ["61 of 250 ticks overran"]})
    events = [Event(1.5, "WARN", "rig away"), Event(2.0, "ERROR", "fault: rig lost")]
    assert caveats([late, run("b", events=events)]) == (
        "a: its timing was judged invalid; 61 of 250 ticks overran",
        "b: at 2.000 s fault: rig lost",
    )


def test_different_settings_are_named_only_where_runs_are_compared():
    step, chirp = run("a", signal="steps", axis="x"), run("b", signal="chirp", axis="x")
    assert caveats([step, chirp]) == ("b was asked for signal chirp, not steps as a",)
    assert caveats([step, run("b", "fly")])[0].startswith("b is of fly, a of step")
    assert caveats([step, chirp], together=False) == ()


def test_a_simulated_angle_of_an_earlier_version_is_named_as_the_measured_one():
    names = ("gimbal/measured", "gimbal/simulated", "gimbal/followed")
    series = {n: TimeSeries(n, T, np.zeros((len(T), 1)), "rad", ("x",)) for n in names}
    now = replace(run("a"), recording=Recording({}, series))
    before = replace(now, recording=Recording({}, {n: series[n] for n in names[:2]}))
    assert caveats([now]) == ()
    assert "follows the measured angle" in caveats([before])[0]


def test_unknown_settings_raise_no_doubt():
    step, table = run("a", signal="steps", about=None), run("b", command=None)
    assert caveats([table, step]) == caveats([step, table]) == ()
    mirrored, spelt = run("b", "mirror"), run("c", signal="steps", about="level")
    assert caveats([step, mirrored, spelt]) == ()


def test_text_of_a_hostile_file_becomes_one_short_line():
    for reasons in ({"a": 1}, [1, None], ["x\n" * 9999]):
        (line,) = caveats([run("a", timing={"verdict": "invalid", "reasons": reasons})])
        assert len(line) <= LONGEST + 1
        assert "\n" not in line
    assert caveats([run("a", timing={"verdict": ["invalid"]})]) == ()
