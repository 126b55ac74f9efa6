"""The seat of a rig, between the frames of a poll and the joints of the plant."""

from types import SimpleNamespace

import pytest

from hardware.frames import GimbalState
from hardware.rig import Phase
from twin.hil.gimbal import RigGimbal


def test_the_vehicle_follows_the_newest_estimate_of_a_tick():
    """Two frames came since the last tick; the older one's angle is not that of the gimbal."""
    states = [
        GimbalState(1_000_000, (0.01, -0.02), (0.5, 0.0), (1e-3, 1e-3)),
        GimbalState(3_000_000, (0.02, -0.03), (0.7, 0.1), (1e-3, 1e-3)),
    ]
    counts = SimpleNamespace(dropped=0, round_trip_ns=0, round_trips=0, lost=9, crc_errors=2)
    fusion = SimpleNamespace(
        monitor=SimpleNamespace(note="", faults=()), state=lambda _: states[0], snapshot=dict
    )
    rig = SimpleNamespace(
        states=states, poll=list, phase=Phase.READY, statistics=counts, health="ok", session=1,
        gyro_delay=3e-3, fusion=fusion,
    )  # fmt: skip
    followed = []
    plant = SimpleNamespace(
        follows=True, time_ns=4_000_000, follow=lambda angle, rate: followed.append((angle, rate))
    )
    seat = RigGimbal(rig, plant, clock=lambda: 4_000_000, wait=lambda _: None, lockstep=False)
    seat._ready = True
    state = seat.poll()
    assert state.angle == states[1].angle
    assert followed == [(states[1].angle, states[1].rate)]
    assert seat.readings.age_ns == pytest.approx(1_000_000)
    counts.lost, counts.crc_errors = 12, 3
    seat.poll()
    readings = seat.readings
    assert (readings.lost, readings.crc_errors) == (3, 1)  # none of before time zero
