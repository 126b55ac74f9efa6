"""Paths of flights: differences and spreads of made ones whose answers are plain to see."""

from dataclasses import replace
from types import MappingProxyType

import numpy as np
import pytest

from analysis.comparison.flights import (
    attitude_step,
    flight_path,
    holds_flight,
    path_difference,
    spread,
)
from analysis.recording import Recording, TimeSeries
from analysis.schema import AnalysisError


def quaternion(angle):
    """Turn about x by `angle` (n,)."""
    half = 0.5 * angle
    return np.stack([np.cos(half), np.sin(half), 0 * half, 0 * half], axis=1)


def recording(time, position, attitude, **more):
    units = {"vehicle/position": ("m", "xyz"), "vehicle/attitude": ("1", "wxyz")}
    units |= {"vehicle/thrust": ("N", "t"), "control/setpoint": ("rad", "xy")}
    units |= {"vehicle/tilt": ("rad", "xy")}
    held = {"vehicle/position": position, "vehicle/attitude": attitude}
    held |= {name.replace("_", "/", 1): values for name, values in more.items()}
    series = {
        name: TimeSeries(
            name, time, v.reshape(len(time), -1), units[name][0], tuple(units[name][1])
        )
        for name, v in held.items()
    }
    return Recording({}, MappingProxyType(series))


TIME = 0.004 * np.arange(2501)  # 10 s


def straight(speed=50.0, aside=0.0, turned=0.0, burning=8.0):
    position = np.stack([aside + 0 * TIME, 0 * TIME, speed * TIME], axis=1)
    return recording(
        TIME, position, quaternion(turned + 0 * TIME),
        vehicle_thrust=np.where(burning > TIME, 13.0, 0.0),
    )  # fmt: skip


def test_two_straight_flights_lie_as_far_apart_as_they_were_put():
    a, b = flight_path(straight()), flight_path(straight(aside=0.3, turned=0.02))
    d = path_difference(a, b)
    assert d.path_worst == pytest.approx(0.3)
    assert d.path_rms == pytest.approx(0.3)
    assert d.attitude_rms == pytest.approx(0.02)
    # 8 s under power at 50 m/s; what comes after is no part of it
    assert d.time == pytest.approx(8.0, abs=0.021)
    assert d.length == pytest.approx(400.0, abs=1.1)
    assert d.share == pytest.approx(0.3 / d.length)


def test_roll_is_no_part_of_an_attitude():
    half = 0.5 * np.linspace(0, 3, len(TIME))
    rolled = np.stack([np.cos(half), 0 * half, 0 * half, np.sin(half)], axis=1)
    still = straight()
    spun = recording(TIME, still["vehicle/position"].values, rolled)
    assert path_difference(flight_path(still), flight_path(spun)).attitude_worst < 1e-7


def test_a_spread_is_the_standard_deviation_of_where_they_were():
    asides = np.array([-0.2, 0.1, 0.4, 0.5])
    s = spread([flight_path(straight(aside=a)) for a in asides])
    assert s.n == 4
    np.testing.assert_allclose(s.distance, asides.std(ddof=1), rtol=1e-12)
    assert s.worst == pytest.approx(abs(asides - asides.mean()).max())
    assert s.attitude == pytest.approx(0.0, abs=1e-9)


def test_the_spread_of_few_flights_is_not_narrower_than_that_of_many():
    """Mean square over 500 sets of flights that scatter by 1 m: 10 % is three deviations."""
    rng = np.random.default_rng(0)
    path = flight_path(straight())
    for n in (2, 5):
        squares = []
        for _ in range(500):
            asides = rng.normal(size=(n, 1, 1)) * [1.0, 0.0, 0.0]
            moved = [replace(path, position=path.position + aside) for aside in asides]
            squares.append(spread(moved).distance[-1] ** 2)
        assert np.mean(squares) == pytest.approx(1.0, rel=0.2 if n == 2 else 0.1)


def test_a_single_flight_has_no_spread():
    with pytest.raises(AnalysisError, match="two or more"):
        spread([flight_path(straight())])


def test_a_recording_without_a_vehicle_is_no_flight():
    empty = Recording({}, MappingProxyType({}))
    assert not holds_flight(empty)
    with pytest.raises(AnalysisError, match="no vehicle"):
        flight_path(empty)


def test_a_flight_of_years_is_refused_and_one_that_stood_still_has_no_share():
    far = recording(np.array([0.0, 3e7]), np.zeros((2, 3)), quaternion(np.zeros(2)))
    with pytest.raises(AnalysisError, match="can be compared"):
        flight_path(far)
    still = recording(TIME, np.zeros((len(TIME), 3)), quaternion(0 * TIME))
    assert path_difference(*[flight_path(still)] * 2).to_dict()["path_share"] is None


def stepped(jumps):
    """Nose answering a step of 0.1 rad at 3 s as a second-order system, ω 4 rad/s, ζ 0.5."""
    t = np.clip(TIME - 3.0, 0, None)
    wd = 4 * np.sqrt(0.75)
    answer = 1 - np.exp(-2 * t) * (np.cos(wd * t) + 2 / wd * np.sin(wd * t))
    tilt = np.stack([0.7 + 0.08 * answer, 0.2 + 0.06 * answer], axis=1)  # slanting in the plot
    wanted = np.tile([0.7, 0.2], (len(TIME), 1))
    for at in jumps:
        wanted[at <= TIME] += [0.08, 0.06]
    base = straight()
    return recording(
        TIME, base["vehicle/position"].values, base["vehicle/attitude"].values,
        control_setpoint=wanted, vehicle_tilt=tilt,
    )  # fmt: skip


def test_the_answer_to_a_step_has_the_closed_forms_overshoot_and_settling():
    found = attitude_step(stepped([3.0]))
    # exp(−ζπ/√(1−ζ²)) and, of the 2 % band, the last crossing of 4 rad/s at ζ 0.5 (Ogata, 5-3);
    # samples of 4 ms and a last third that still rings by 1e-4 leave a thousandth
    assert found.overshoot == pytest.approx(100 * np.exp(-0.5 * np.pi / np.sqrt(0.75)), rel=2e-3)
    assert found.amplitude == pytest.approx(0.1)
    assert found.settling_time == pytest.approx(2.02, abs=0.02)


@pytest.mark.parametrize("jumps", [[], [3.0, 4.5]])
def test_other_programmes_have_no_step_to_tell_of(jumps):
    assert attitude_step(stepped(jumps)) is None
