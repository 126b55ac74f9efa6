"""The verdict on made-up recordings of known delays, with a flight whose path is a formula."""

from types import MappingProxyType

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from analysis.convergence import Trajectory
from analysis.delays import loop_delay, percentiles
from analysis.recording import Recording, TimeSeries
from analysis.schema import AnalysisError
from analysis.timing import assess

PERIOD = 0.004
TIME = np.arange(1000) * PERIOD
SPEED = 50.0  # m/s


def recorded(ticks=1000, **signals):
    series = {
        f"timing/{name}": TimeSeries(
            f"timing/{name}",
            TIME[:ticks],
            np.broadcast_to(values, (ticks,))[:, None].copy(),
            "s",
            ("t",),
        )
        for name, values in signals.items()
    }
    return Recording({}, MappingProxyType(series))


def straight(delays, finer):
    """A path that a delay of one second moves sideways by 100 m, and a coarse step by 1 mm."""
    late = 0.0 if delays is None else float(np.mean(delays.value))
    time = TIME[::25].copy()
    position = np.stack(
        [SPEED * time, np.full_like(time, 100.0 * late), np.full_like(time, 1e-3 / finer)], axis=1
    )
    return Trajectory(time, position, np.tile([1.0, 0, 0, 0], (len(time), 1)))


@given(out=st.floats(0, 0.05), back=st.floats(0, 0.05), age=st.floats(0, 0.01))
def test_the_loops_delay_does_not_depend_on_which_way_was_slow(out, back, age):
    # the clock offset takes both ways for equal, and is wrong by half their difference
    offset = 0.5 * (out - back)
    seen = recorded(sensor_age=age + back + offset, round_trip=out + back)
    assert loop_delay(seen).value == pytest.approx(out + back + age, abs=1e-12)


def test_a_run_in_time_is_valid_without_a_reason():
    verdict = assess(recorded(lateness=5e-5, sensor_age=2e-3, round_trip=4e-3), PERIOD)
    assert (verdict.word, verdict.reasons) == ("valid", ())
    assert verdict.delay.p50 == pytest.approx(4e-3)


@pytest.mark.parametrize("ticks", [1, 99])
def test_a_run_that_ended_after_few_ticks_is_not_called_valid(ticks):
    verdict = assess(recorded(ticks, lateness=5e-5), PERIOD, overruns=0)
    assert verdict.text() == f"not judged: {ticks} of at least 100 ticks"
    assert assess(recorded(100, lateness=5e-5), PERIOD, overruns=0).word == "valid"
    assert assess(recorded(ticks, lateness=2 * PERIOD), PERIOD).word == "invalid"


@pytest.mark.parametrize("late", [0.010, 0.020, 0.040])
def test_a_delayed_loop_is_invalid_and_its_path_error_is_told(late):
    seen = recorded(lateness=5e-5, sensor_age=0.5 * late, round_trip=late)
    verdict = assess(seen, PERIOD, rerun=straight)
    assert verdict.word == "invalid"
    assert "delayed" in verdict.reasons[0]
    assert verdict.moved.timing.position == pytest.approx(100.0 * late)
    assert verdict.moved.step.position == pytest.approx(0.75e-3)
    # 0.1 s short of the last sample
    assert verdict.moved.path == pytest.approx(SPEED * TIME[975])


def test_late_ticks_and_overruns_are_named_as_the_reason():
    slow = np.where(np.arange(1000) % 20 == 0, 0.006, 1e-5)
    verdict = assess(recorded(lateness=slow), PERIOD)
    assert verdict.word == "invalid"
    assert verdict.overruns == 50
    assert [r.split()[0] for r in verdict.reasons] == ["50", "ticks"]


def test_a_single_late_tick_in_a_thousand_does_not_spoil_a_run():
    once = np.where(np.arange(1000) == 500, 0.005, 1e-5)
    verdict = assess(recorded(lateness=once), PERIOD)
    assert verdict.word == "valid"
    assert verdict.lateness.worst == pytest.approx(0.005)


def test_what_the_machine_denied_is_named_where_ticks_were_late():
    rights = {"SCHED_FIFO": "Operation not permitted", "locked memory": "granted"}
    late = assess(recorded(lateness=2e-3), PERIOD, rights=rights)
    assert late.reasons[-1] == "it ran without SCHED_FIFO"
    assert late.text().startswith("invalid: ")
    assert "without SCHED_FIFO" in late.text()
    host = assess(recorded(lateness=2e-3), PERIOD, stolen=0.25)
    assert host.reasons[-1] == "the host withheld 250 ms from this virtual machine"
    # where nothing was lost, nothing is blamed on it
    assert assess(recorded(lateness=5e-5), PERIOD, rights=rights, stolen=0.25).reasons == ()


def test_percentiles_are_those_of_an_even_ramp():
    found = percentiles(np.append(np.linspace(0.0, 1.0, 1001), np.nan))
    assert (found.p50, found.p99, found.p999, found.worst) == pytest.approx((0.5, 0.99, 0.999, 1.0))
    assert found.n == 1001
    assert percentiles(np.array([np.nan])) is None


def test_the_round_trip_is_split_into_host_wire_and_device():
    seen = recorded(lateness=5e-5, round_trip=4e-3, sensor_age=2e-3)
    split = assess(seen, PERIOD, wire=0.7e-3, frame=0.01).split
    assert (split.host, split.wire, split.device, split.frame) == pytest.approx(
        (5e-5, 0.7e-3, 3.3e-3, 0.01)
    )


def test_a_lockstep_recording_has_no_timing_to_judge():
    with pytest.raises(AnalysisError, match="wall clock"):
        assess(recorded(), PERIOD)


def test_the_verdict_is_json_with_one_word():
    import json

    verdict = assess(recorded(lateness=5e-5), PERIOD, rerun=straight).as_dict()
    assert json.loads(json.dumps(verdict, allow_nan=False))["verdict"] == "valid"
