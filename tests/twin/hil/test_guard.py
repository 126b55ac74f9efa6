"""What becomes of a run whose rig fails: commands, events, endings, exit codes."""

from dataclasses import replace
from math import radians

import numpy as np
import pytest

from analysis.recording import read
from hardware.events import RigLost
from hardware.faults import Fault
from hardware.frames import GimbalState
from hardware.rig import Rig
from tests.hardware.test_base import STILL
from tests.twin.cli.test_cli import run as command
from twin.config import Fly
from twin.experiments.flight.fly import fly
from twin.hil.failsafe import Guard
from twin.loop.readings import Readings

WELL = GimbalState(0, (0.0, 0.0))
ILL = GimbalState(0, (0.0, 0.0), healthy=False)


class Ahead:
    def __init__(self):
        self.asked = 0

    def update(self, time, gimbal):
        self.asked += 1
        return 0.1, -0.1


def guarded(policy):
    readings = Readings(frames=[STILL], ready=True)
    return Guard(Ahead(), readings, policy), readings


@pytest.mark.parametrize("policy", ["end", "neutral", "ignore"])
def test_while_all_is_well_it_is_not_there(policy):
    guard, _ = guarded(policy)
    assert guard.update(0.0, WELL) == (0.1, -0.1)
    assert (guard.fault, guard.over()) == (None, None)


@pytest.mark.parametrize(
    ("named", "end"), [(0.3, 1.3), (9.0, 1.4)]
)  # s after the fault, whose name is awaited for 0.4 s
def test_a_run_waits_at_neutral_for_the_name_of_a_servo_that_does_not_follow(named, end):
    guard, readings = guarded("end")
    guard.update(0.9, WELL)
    for time in np.arange(1.0, 2.0, 0.01).round(2):
        kind = "reversed" if time >= 1.0 + named else "not following"
        readings.faults = (Fault("servo_x", kind, 1.0),)
        readings.health = f"servo_x {kind}"
        assert guard.update(time, ILL) == (0.0, 0.0)
        if guard.over():
            break
    assert time == end
    assert guard.over() == f"fault: servo_x {kind}"


def test_a_run_waits_for_the_readings_of_a_potentiometer_to_tell_a_glitch_from_an_open_wire():
    """They fall to the rail by way of other angles: glitch, deviating, open within 50 ms."""
    guard, readings = guarded("end")
    for time in np.arange(1.0, 1.2, 0.004).round(3):
        kind = "glitch" if time < 1.01 else "deviating" if time < 1.03 else "open"
        readings.faults = (Fault("potentiometer_y_a", kind, 1.0),)
        readings.health = f"potentiometer_y_a {kind}"
        assert guard.update(time, ILL) == (0.0, 0.0)
        if guard.over():
            break
    assert time == 1.06
    assert guard.over() == "fault: potentiometer_y_a open"


def fails(readings, how):
    if how == "sensor":
        readings.health = "gyro frozen"
        readings.faults = (Fault("gyro", "frozen", 0.1),)
        return ILL
    readings.frames = []
    if how == "cable":
        readings.ready = False
        readings.events.append(RigLost("unplugged"))
    return WELL


@pytest.mark.parametrize(
    ("how", "told"),
    [("sensor", "gyro frozen"), ("cable", "rig lost: unplugged"), ("silence", "no readings")],
)
def test_each_fault_is_named_and_answered_with_zero(how, told):
    guard, readings = guarded("end")
    guard.update(0.0, WELL)
    state = fails(readings, how)
    assert guard.update(0.15, state) == (0.0, 0.0)
    assert told in guard.fault
    assert told in guard.over()
    assert [(e.level, told in e.text) for e in guard.events] == [("ERROR", True)]


def test_a_short_silence_is_no_fault():
    guard, readings = guarded("end")
    guard.update(0.0, WELL)
    readings.frames = []
    assert guard.update(0.09, WELL) == (0.1, -0.1)


def test_readings_that_stay_old_are_a_fault_and_a_pause_is_not():
    guard, readings = guarded("end")
    guard.update(0.0, WELL)
    readings.age_ns = 290_000_000
    guard.update(0.2, WELL)
    assert guard.fault is None
    readings.age_ns = 5_400_000_000  # frames come, but each is old
    guard.update(0.25, WELL)
    assert guard.fault is None
    assert guard.update(0.31, WELL) == (0.0, 0.0)
    assert guard.fault == "readings are 5.4 s old"


def test_neutral_stays_neutral_when_the_rig_is_back():
    guard, readings = guarded("neutral")
    state = fails(readings, "cable")
    guard.update(0.1, state)
    readings.frames, readings.ready = [STILL], True
    assert guard.update(0.2, WELL) == (0.0, 0.0)
    assert guard.over() is None


def test_ignored_faults_are_told_all_the_same():
    guard, readings = guarded("ignore")
    assert guard.update(0.1, fails(readings, "sensor")) == (0.1, -0.1)
    assert guard.over() is None
    assert "ignored" in guard.events[0].text


FLY = "fly --gimbal emulator --programme doublet --at-s 0.3"


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("more", "told", "code", "ends"),
    [
        # unplugged 2 s after the rig's power-up, 0.9 s of which pass before time zero
        ("--fault link:unplug:3@1.5", "rig unplugged", 1, True),
        ("--fault link:unplug:0.5@1.5 --on-fault neutral", "rig unplugged", 1, False),
        ("--fault link:unplug:0.5@1.5 --on-fault ignore", "rig unplugged", 0, False),
        ("--fault potentiometer_x_a:stuck@1.2", "potentiometer_x_a", 1, True),
        ("--fault link:corrupt:0.6@1.5", "no readings", 1, True),
    ],
)
def test_a_flight_with_a_fault_ends_safely_and_its_recording_is_whole(
    capsys, tmp_path, more, told, code, ends
):
    out = tmp_path / "a.rrd"
    line = f"{FLY} --duration-s 2.6 {more} --json --out {out}"
    status, _, _ = command(capsys, *line.split())
    assert status == code
    run = read(out)
    (fault,) = [e for e in run.events if e.level == "ERROR"]
    assert told in fault.text
    time = run["gimbal/command"].time
    after = run["gimbal/command"].values[time >= fault.time]
    assert (after == 0.0).all() == (code == 1)  # only an ignored fault goes on steering
    assert (time[-1] < 2.5) == ends
    if ends:  # up to the tick of the fault, which is the last
        assert time[-1] == pytest.approx(fault.time)


def test_while_the_rig_is_away_the_joints_go_where_its_servos_go(capsys, tmp_path):
    out = tmp_path / "a.rrd"
    line = f"{FLY} --duration-s 2 --fault link:unplug:0.6@1.5 --on-fault ignore --out {out}"
    command(capsys, *line.split())
    run = read(out)
    time, link = run["gimbal/followed"].time, run["link/connected"]  # recorded where it changes
    away = link.values[np.searchsorted(link.time, time + 1e-9) - 1, 0] == 0.0
    angle = abs(run["gimbal/followed"].values).max(axis=1)
    begin = time[away][0]
    # 0.1 s until the rig's own timeout, 0.1 s for its servos; then a joint that follows exactly
    assert (angle[away & (time > begin + 0.21)] < radians(0.01)).all()
    assert angle[away & (time < begin + 0.18)].min() > radians(0.05)
    held = run["gimbal/followed"].values[away & (time > begin + 0.01) & (time < begin + 0.18)]
    assert np.ptp(held, axis=0).max() < radians(0.01)


@pytest.mark.parametrize("begin_s", [0.0, 1.0])
def test_impossible_readings_end_in_a_fault_and_not_in_a_diverged_simulation(
    begin_s, monkeypatch, tmp_path
):
    def garbled(rig, telemetry):
        if telemetry.device_us >= begin_s * 1e6:
            telemetry = replace(
                telemetry,
                potentiometer=(65535,) * 4,
                holder_gyro=(-32768,) * 3,
                base_gyro=(32767,) * 3,
                imu_age_us=(65535,) * 2,
                flags=65535,
            )
        return received(rig, telemetry)

    received = Rig._telemetry
    monkeypatch.setattr(Rig, "_telemetry", garbled)
    result = fly(Fly(gimbal="emulator", duration_s=0.3, out=tmp_path / "fly.rrd"))
    assert not result.passed
    assert "potentiometer_x_a" in result.fault


@pytest.mark.parametrize("unit", [1, 3, 5])
@pytest.mark.parametrize(
    ("fault", "kind", "advice"),
    [("open", "open", "its wire and plug"), ("glitch:0.2", "glitch", "loose contact")],
)
def test_the_kind_of_a_potentiometers_fault_ends_a_run_with_what_to_look_at(
    capsys, tmp_path, unit, fault, kind, advice
):
    line = f"step --gimbal emulator --unit {unit} --fault potentiometer_y_a:{fault}@2"
    status, text, _ = command(capsys, *line.split(), "--out", str(tmp_path / "a.rrd"))
    assert status == 1
    (told,) = [row for row in text.splitlines() if row.startswith("FAULT")]
    assert f"potentiometer_y_a {kind}; check" in told
    assert advice in told
