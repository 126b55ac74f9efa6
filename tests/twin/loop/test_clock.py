"""The wall clock keeps absolute deadlines; the ledger remembers lateness in order."""

import gc
import os
import sys
import time

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.conftest import patient
from twin.loop import realtime
from twin.loop.clock import MEANWHILE_NS, Ledger, Lockstep, Wall

MS = 1_000_000


@patient
def test_lateness_of_single_ticks_does_not_add_up_to_drift():
    with Wall() as clock:
        clock.wait(0)
        began = time.monotonic_ns()
        for tick in range(1, 101):
            clock.wait(tick * 2 * MS)
        elapsed = time.monotonic_ns() - began
    # re-arming from now would be late by 100 wake-ups of about 0.1 ms each; one wake-up is allowed,
    # generously, since the machine is shared
    assert 200 * MS - MS <= elapsed <= 205 * MS


@patient
def test_a_missed_deadline_returns_at_once_and_says_by_how_much():
    with Wall() as clock:
        clock.wait(0)
        time.sleep(0.005)
        began = time.monotonic_ns()
        late = clock.wait(MS)
        assert time.monotonic_ns() - began < MS
    assert late >= 4 * MS


@pytest.mark.realtime
def test_lockstep_never_waits():
    with Lockstep() as clock:
        began = time.monotonic_ns()
        assert clock.wait(3600 * 1000 * MS) == 0
        assert time.monotonic_ns() - began < MS


@given(st.lists(st.integers(0, 10**9), max_size=40))
def test_the_ledger_holds_the_latest_entries_oldest_first(entries):
    ledger = Ledger(capacity=16)
    for late in entries:
        ledger.enter(late)
    np.testing.assert_array_equal(ledger.lateness(), entries[-16:])


def test_the_ledger_tells_the_latest_lateness_in_seconds():
    ledger = Ledger(capacity=4)
    view = ledger.latest
    ledger.enter(2_500_000)
    assert view[0] == 0.0025


@patient
def test_only_ticks_that_the_loop_came_late_to_count_as_overruns():
    with Wall(privileged=False) as clock:
        clock.wait(0)
        clock.wait(2 * MS)  # slept
        time.sleep(0.009)  # the deadlines at 4 and 8 ms pass
        clock.wait(4 * MS)
        clock.wait(8 * MS)
        clock.wait(40 * MS)
    assert clock.overruns == 2


@patient
def test_after_an_overrun_the_loop_catches_up_with_the_deadlines_of_old():
    with Wall(privileged=False) as clock:
        clock.wait(0)
        time.sleep(0.011)
        late = [clock.wait(k * 4 * MS) for k in (1, 2, 5)]
        elapsed = time.monotonic_ns() - clock._origin
    assert late[0] > late[1] > 0
    assert 20 * MS <= elapsed < 30 * MS  # the fifth deadline, not five periods after the overrun


@patient
def test_time_counts_from_the_first_wait_whatever_comes_before_it():
    with Wall(privileged=False) as clock:
        time.sleep(0.005)  # catching up with a rig, for example
        assert clock.wait(0) == 0
    assert clock.overruns == 0


@patient
def test_what_is_done_meanwhile_is_left_in_time_for_the_deadline():
    calls = []
    with Wall(privileged=False) as clock:
        clock.wait(0)
        clock.wait(5 * MS, lambda: bool(calls.append(time.monotonic_ns()) or True))
        ended = time.monotonic_ns()
        done = len(calls)
        clock.wait(6 * MS, lambda: bool(calls.append(0)))
    assert done > 1
    assert calls[done - 1] < ended - MEANWHILE_NS  # the last look leaves time to sleep
    assert len(calls) <= done + 1  # false is the end of it


@patient
def test_a_spinning_wait_ends_within_microseconds_of_its_deadline():
    with Wall(spin_ns=300_000, privileged=False) as clock:
        late = [clock.wait(k * 2 * MS) for k in range(1, 51)]
    assert np.median(late) < 20_000  # one look at the clock; other processes may take the tail


def test_the_collector_rests_in_the_loop_and_works_again_after_it():
    with Wall(privileged=False):
        assert not gc.isenabled()
    assert gc.isenabled()
    assert gc.get_freeze_count() == 0


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="Linux only")
def test_the_scheduling_is_given_back_after_the_block():
    before = os.sched_getscheduler(0)
    assert before == os.SCHED_OTHER  # else an earlier test kept what it was lent
    with realtime.requested() as rights:
        if rights.scheduling == realtime.GRANTED:
            assert os.sched_getscheduler(0) & ~os.SCHED_RESET_ON_FORK == os.SCHED_FIFO
    assert os.sched_getscheduler(0) == before


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="Linux only")
def test_a_refused_right_is_told_with_what_would_allow_it(monkeypatch):
    def refuse(*_):
        raise PermissionError(1, "Operation not permitted")

    monkeypatch.setattr(os, "sched_setscheduler", refuse)
    with Wall() as clock:
        pass
    assert any("ulimit -r" in line for line in clock.rights.missing())
