"""What is said of recordings that should not be believed as they are."""

from analysis.recording.caveats import LONGEST, caveats
from analysis.recording.reader import Event, Recording


def recording(command="step", timing=None, events=(), **settings):
    return Recording(
        {"command": command, "configuration": settings}, {}, tuple(events), timing=timing or {}
    )


def test_sound_runs_of_one_kind_have_none():
    a = recording(signal="steps", gimbal="emulator")
    b = recording(signal="steps", gimbal="linkage", timing={"verdict": "valid", "reasons": []})
    assert caveats([a, b], ["a", "b"]) == ()


def test_a_run_that_was_not_on_time_or_failed_is_named_with_the_reason():
    late = recording(timing={"verdict": "invalid", "reasons": ["61 of 250 ticks overran"]})
    lost = recording(
        events=[Event(1.5, "WARN", "rig away"), Event(2.0, "ERROR", "fault: rig lost")]
    )
    assert caveats([late, lost], ["a", "b"]) == (
        "a: its timing was judged invalid; 61 of 250 ticks overran",
        "b: at 2.000 s fault: rig lost",
    )


def test_runs_that_were_asked_for_different_motions_are_told_apart_if_they_stand_together():
    step, chirp = recording(signal="steps", axis="x"), recording(signal="chirp", axis="x")
    assert caveats([step, chirp], ["a", "b"]) == ("b was asked for signal chirp, not steps as a",)
    assert caveats([step, recording("fly")], ["a", "b"])[0].startswith("b is of fly, a of step")
    assert caveats([step, chirp], ["a", "b"], together=False) == ()


def test_of_what_nobody_said_nothing_is_made():
    step, table = recording(signal="steps", about=None), recording(command=None)
    assert caveats([table, step], ["a", "b"]) == caveats([step, table], ["a", "b"]) == ()
    mirrored, spelt = recording("mirror"), recording(signal="steps", about="level")
    assert caveats([step, mirrored, spelt], ["a", "b", "c"]) == ()


def test_what_a_strangers_file_says_is_one_short_line():
    for reasons in ({"a": 1}, [1, None], ["x\n" * 9999]):
        (told,) = caveats([recording(timing={"verdict": "invalid", "reasons": reasons})], ["a"])
        assert len(told) <= LONGEST + 1
        assert "\n" not in told
    assert caveats([recording(timing={"verdict": ["invalid"]})], ["a"]) == ()
