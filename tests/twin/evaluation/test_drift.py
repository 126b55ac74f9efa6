"""What changed in a gimbal beside its model."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from analysis.comparison import Comparison
from analysis.comparison import compare as side_by_side
from analysis.comparison.explanation import Explanation, Share
from analysis.recording import Measurement
from analysis.recording.series import Event
from tests.benchmarks.drift import BEFORE, CHANGES, PERIOD, commands, drifted, made
from tests.benchmarks.explain import EFFECTS, explained
from twin.errors import TwinError
from twin.evaluation.compare import _before_fault, _Pair
from twin.evaluation.compare_result import CompareResult, _percent
from twin.evaluation.drift import RunDrift, run_drift
from twin.evaluation.effects import COLUMNS, Motions
from twin.evaluation.explain import RunExplanation
from twin.hil.resimulation import Resimulation, Variant
from twin.plant.compiled import compiled


@pytest.fixture(scope="module")
def moved():
    angles = commands(5, BEFORE + 8.0)
    with compiled():
        changed = [Variant(), CHANGES["backlash"], EFFECTS["servo gain"]]
        motions = Resimulation(made(angles)).motions(changed)
    return angles, motions


@pytest.mark.thorough
def test_a_servo_with_more_backlash_is_named_and_nothing_else(moved):
    angles, (new, worn, _) = moved
    late = round(BEFORE / PERIOD)
    both = np.concatenate([new[:late], np.column_stack([new[late:, 0], worn[late:, 1]])])
    seen = drifted(angles, both, 7)
    assert [(c.axis, c.what.name) for c in seen.changes] == [("y", "backlash")]
    change = seen.changes[0]
    assert abs(change.since - BEFORE) < 0.8
    assert abs(np.degrees(change.after - change.before) - 0.5) < 0.1
    signals = seen.signals(made(angles)["gimbal/measured"])
    assert signals["shadow/estimate/backlash"][1].shape[1] == 4
    assert any(label == "CHANGED" for label, _ in seen.rows())


def test_a_run_without_commands_is_refused():
    with pytest.raises(TwinError, match="no axis moves"):
        run_drift(made(np.zeros((200, 2))))


def test_shares_are_given_of_the_whole_difference_too_and_drift_beside_them_is_told_apart():
    share = Share("slew limit", 1.0, "speed 1.00 → 0.90")
    found = RunExplanation((Explanation("x", 1.0, np.sqrt(0.94), 0.1, (share,)),), 15.0)
    (text,) = [text for label, text in found.rows() if label == "x slew limit"]
    assert text == "100 % of that, 6 % of the whole: speed 1.00 → 0.90"
    both = CompareResult(
        Comparison("a", "b", ()), 0.0, None, Path("c.rrd"), 1.0,
        drift=RunDrift((), {}), explanation=found,
    )  # fmt: skip
    told = [text for _, text in both.rows() if text.startswith("drift is of changes during")]
    assert len(told) == 1


def test_of_a_value_that_a_rival_explains_as_well_the_rival_is_printed_and_no_figure():
    share = Share("friction", 1.0, "friction 1.00 → 4.30 ± 0.10", 0.01, ("dead band",))
    rows = RunExplanation((Explanation("x", 1.0, 0.1, 0.1, (share,)),), 15.0).rows()
    (text,) = [text for label, text in rows if label == "x friction"]
    assert text.endswith("of the whole: not determined: not told apart from dead band")


def test_a_weaker_servo_gain_is_an_effect_of_the_explanation(moved):
    angles, (new, _, weak) = moved
    assert np.abs(weak - new).max() > np.radians(0.2)
    with compiled():
        motions = Motions(Resimulation(made(angles)))
        level = motions.level.copy()
        level[[c.effect for c in COLUMNS].index("servo gain")] = 1.08 / 1.8  # mjcf/mechanism.xml
        (motion,) = motions([level])
    assert np.array_equal(motion, weak)


@pytest.mark.slow
@pytest.mark.parametrize(("run", "effect"), [(1, "backlash"), (2, "servo gain")])
def test_the_difference_of_a_rig_is_given_to_the_effect_that_changed(moved, run, effect):
    angles, motions = moved
    for axis in explained(angles, motions[run], 9).axes:
        assert axis.shares[0].effect == effect
        assert axis.shares[0].share > 0.8
        assert axis.explained > 0.8
        assert axis.rest < 1.5 * np.radians(0.02)  # the noise of the estimated angle


def test_a_run_that_a_fault_cut_off_is_compared_up_to_the_fault():
    angles = commands(6, 6.0)
    run = made(angles, 0.9 * angles)
    run = replace(run, events=(Event(4.0, "ERROR", "fault: servo_x not following"),))
    motion = run["gimbal/measured"]
    other = replace(motion, values=np.where(motion.time[:, None] < 4.0, angles, 9.0))
    given = Measurement(run["gimbal/command"], motion, name="cut.rrd", recording=run)
    pair, (warning,) = _before_fault(_Pair(motion, other, given))
    assert warning == "cut.rrd was cut off by a fault: compared up to 4.00 s, of 6.00 s"
    assert side_by_side(pair.reference, pair.other).fit > 80.0
    ignored = replace(run, properties={"configuration": {"on_fault": "ignore"}})
    whole = _Pair(motion, other, replace(given, recording=ignored))
    assert _before_fault(whole) == (whole, ())


def test_a_fit_far_below_zero_is_not_printed_as_a_figure():
    assert [_percent(v) for v in (98.3, -10178.0)] == ["98.30 %", "< -100 %"]
