"""The wall clock keeps absolute deadlines; the ledger remembers lateness in order."""

import time

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from twin.clock import Ledger, Lockstep, Wall

MS = 1_000_000


def test_lateness_of_single_ticks_does_not_add_up_to_drift():
    with Wall() as clock:
        began = time.monotonic_ns()
        for tick in range(1, 101):
            clock.wait(tick * 2 * MS)
        elapsed = time.monotonic_ns() - began
    # re-arming from now would be late by 100 wake-ups of about 0.1 ms each; one wake-up is allowed,
    # generously, since the machine is shared
    assert 200 * MS - MS <= elapsed <= 205 * MS


def test_a_missed_deadline_returns_at_once_and_says_by_how_much():
    with Wall() as clock:
        time.sleep(0.005)
        began = time.monotonic_ns()
        late = clock.wait(MS)
        assert time.monotonic_ns() - began < MS
    assert late >= 4 * MS


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
