"""A recorded run flown again: equal to the last bit, or refused, or changed as asked."""

import json
from dataclasses import fields, replace
from pathlib import Path
from types import MappingProxyType
from typing import get_type_hints

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from analysis.recording import Recording, TimeSeries, read
from hardware.calibration import write as write_calibration
from hardware.frames import HardwareError
from tests.twin.experiments.test_desk import served
from twin.config import Fly, Replay, Step
from twin.config.recorded import configuration_of, typed
from twin.errors import TwinError
from twin.experiments.differences import differences
from twin.experiments.flight.fly import fly
from twin.experiments.replay import ReplayResult, replay
from twin.experiments.step import step
from twin.hil import nominal_calibration, parameters
from twin.loop.loop import run
from twin.physics import native
from twin.plant.model.model import ModelConfig, load


@pytest.fixture(scope="module")
def flight(tmp_path_factory):
    out = tmp_path_factory.mktemp("replay") / "flight.rrd"
    fly(
        Fly(
            out=out, duration_s=1.0, programme="doublet", at_s=0.3, seed=5,
            set=("wind_speed=4", "wind_turbulence=0.2"),
        )
    )  # fmt: skip
    return out


def test_a_flight_with_gusts_repeats_itself_to_the_last_bit(flight):
    found = replay(Replay(flight))
    assert found.identical
    assert found.passed
    assert {d.signal for d in found.differences} >= {"vehicle/position", "gimbal/simulated"}
    # not by the comparison alone: the arrays themselves
    old, new = read(flight), read(found.replayed)
    for name, series in old.series.items():
        np.testing.assert_array_equal(series.values, new[name].values)


def test_a_bench_run_repeats_itself_to_the_last_bit(tmp_path):
    out = tmp_path / "step.rrd"
    step(Step(out=out, repeats=1, axis="x", hold_s=0.3))
    assert replay(Replay(out)).identical


def test_another_gain_shows_what_it_would_have_changed(flight, tmp_path):
    config = Replay(flight, set=("control_kp=50",), force=True, out=tmp_path / "gain.rrd")
    found = replay(config)
    assert not found.identical
    assert found.passed
    assert "control_kp=50" in found.changed["set"][1]
    position = next(d for d in found.differences if d.signal == "vehicle/position")
    assert 0.0 < position.largest < 10.0
    assert "attitude error" in found.text()
    assert json.loads(json.dumps(found.as_dict(), allow_nan=False))["identical"] is False


def test_another_integrator_changes_the_path_by_its_error_only(flight, tmp_path):
    found = replay(Replay(flight, integrator="implicitfast", out=tmp_path / "implicit.rrd"))
    position = next(d for d in found.differences if d.signal == "vehicle/position")
    # docs/convergence.md: implicitfast at 1 ms errs by centimetres in seconds
    assert 0.0 < position.largest < 0.1


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (lambda p: p["versions"].update(mujoco="3.0.0"), "flown with mujoco 3.0.0"),
        (lambda p: p.update(model_sha256="0" * 64), "a model that differs"),
        (lambda p: p["configuration"].update(gimbal="/dev/ttyUSB0"), "a model that differs"),
        (lambda p: p["configuration"].update(colour="red"), "'colour'"),
        (lambda p: p["configuration"].update(dt="fast"), "--dt fast: must be a number"),
        (lambda p: p.update(command="rm"), "'rm'"),
        (lambda p: p.pop("configuration"), "no configuration"),
    ],
)
def test_a_recording_that_cannot_be_the_same_run_is_refused(flight, monkeypatch, change, told):
    old = read(flight)
    properties = json.loads(json.dumps(old.properties))
    change(properties)
    monkeypatch.setattr(
        "twin.experiments.replay.read", lambda _: replace(old, properties=properties)
    )
    with pytest.raises(TwinError, match=told) as caught:
        replay(Replay(flight))
    assert "\n" not in str(caught.value)


def test_a_replay_never_overwrites_what_it_repeats(flight):
    with pytest.raises(TwinError, match="must not overwrite"):
        replay(Replay(flight, out=flight))


def test_one_changed_bit_is_found():
    values = np.zeros((3, 1))

    def recording(last):
        changed = values.copy()
        changed[2] = last
        series = TimeSeries("vehicle/mass", np.arange(3.0), changed, "kg", ("mass",))
        return Recording({}, MappingProxyType({"vehicle/mass": series}))

    (same,) = differences(recording(1.0), recording(1.0))
    (other,) = differences(recording(1.0), recording(np.nextafter(1.0, 2.0)))
    assert same.equal
    assert not other.equal
    assert (other.largest, other.at) == (2.0**-52, 2.0)
    unchanged = ReplayResult("a.rrd", "b.rrd", {}, (other,), (), {}, {})
    assert not unchanged.passed
    assert "another type of processor" in unchanged.text()
    asked = replace(unchanged, changed={"seed": ("0", "1")})
    assert asked.passed
    assert "processor" not in asked.text()


@given(
    dt=st.none() | st.floats(1e-4, 0.005),
    seed=st.integers(0, 2**31),
    overrides=st.dictionaries(
        st.text("abc_.1", min_size=1, max_size=12), st.floats(-9, 9), max_size=3
    ),
    out=st.none() | st.just(Path("a/b.rrd")),
    target=st.none() | st.tuples(*[st.floats(-1e3, 1e3)] * 3),
)
def test_a_configuration_comes_back_from_json_as_it_was(dt, seed, overrides, out, target):
    config = Fly(dt=dt, seed=seed, set=overrides, out=out, target=target)
    properties = {"command": "fly", "configuration": json.loads(json.dumps(config.as_properties()))}
    assert configuration_of(Recording(properties, MappingProxyType({}))) == config


_JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=3), inner),
    max_leaves=6,
)


@settings(max_examples=25)
@given(value=_JSON, field=st.sampled_from([f.name for f in fields(Fly)]))
def test_a_hostile_setting_is_refused_in_one_line_or_taken_as_its_type(value, field):
    told = ""
    try:
        typed(field, value, get_type_hints(Fly)[field])
    except TwinError as error:
        told = str(error)
    assert "\n" not in told


@pytest.fixture(scope="module")
def rig_flight(tmp_path_factory):
    """A rig's flight whose cable is out for a while, on a calibration that is gone afterwards."""
    folder = tmp_path_factory.mktemp("tape")
    calibration = folder / "calibration.json"
    with native.installed():
        bench = load(ModelConfig(scene="bench")).mj
        known = nominal_calibration(bench, parameters(bench, 3))
        x, y = known.zero  # 5 µs off, half a degree: not what a replay would make up by itself
        write_calibration(calibration, replace(known, zero=(x + 5e-6, y - 5e-6)))
    out = folder / "hil.rrd"
    fly(
        Fly(
            gimbal="emulator", unit=3, calibration=calibration, out=out, duration_s=2.2, seed=2,
            programme="doublet", at_s=0.3, fault=("link:unplug:0.3@1.7",), on_fault="ignore",
        )
    )  # fmt: skip
    calibration.unlink()
    return out


def without_a_rig(monkeypatch):
    """Make opening any rig an error."""

    def refused(*_):
        raise AssertionError("a rig was opened")

    monkeypatch.setattr("twin.hil.connect.opened", refused)


@pytest.mark.thorough
def test_a_rigs_flight_repeats_itself_from_its_frames_to_the_last_bit(rig_flight, monkeypatch):
    without_a_rig(monkeypatch)
    found = replay(Replay(rig_flight))
    assert found.identical, [d for d in found.differences if not d.equal]
    told = {d.signal for d in found.differences}
    assert told >= {"gimbal/measured", "gimbal/sigma", "vehicle/position", "link/connected"}
    old, new = read(rig_flight), read(found.replayed)
    # the gap is in it, and the estimate began anew behind it
    assert np.diff(old["gimbal/measured"].time).max() > 0.25
    assert np.ptp(old["sensors/session"].values) == 1
    np.testing.assert_array_equal(old["gimbal/measured"].values, new["gimbal/measured"].values)


def test_a_replay_of_a_replay_is_the_flight(rig_flight, tmp_path):
    again = replay(Replay(rig_flight, out=tmp_path / "a.rrd"))
    assert replay(Replay(Path(again.replayed), out=tmp_path / "b.rrd")).identical


def test_another_gain_commands_otherwise_while_the_rig_moves_as_it_did(rig_flight, tmp_path):
    asked = Replay(rig_flight, set=("control_kp=50",), force=True, out=tmp_path / "a.rrd")
    differs = {d.signal: d for d in replay(asked).differences}
    assert differs["gimbal/measured"].equal
    assert not differs["gimbal/command"].equal
    assert differs["vehicle/position"].equal  # the vehicle follows what the rig did


def test_another_integrator_flies_the_same_angles(rig_flight, tmp_path):
    differs = {
        d.signal: d
        for d in replay(Replay(rig_flight, integrator="rk4", out=tmp_path / "a.rrd")).differences
    }
    assert differs["gimbal/measured"].equal
    assert 0.0 < differs["vehicle/position"].largest < 0.1


def test_a_cable_that_is_out_at_time_zero_is_replayed_too(tmp_path):
    out = tmp_path / "gap.rrd"
    fault = ("link:unplug:0.02@0.895",)  # the rig was powered 0.9 s before
    fly(Fly(gimbal="emulator", fault=fault, on_fault="ignore", duration_s=1.0, out=out))
    sessions = read(out)["sensors/session"].values
    assert sessions[0] == 2.0  # the first frame already belongs to another one than the memory
    found = replay(Replay(out))
    assert found.identical, [d for d in found.differences if not d.equal]


def test_a_run_that_was_cut_off_is_replayed_up_to_there(tmp_path, monkeypatch):
    out = tmp_path / "cut.rrd"

    def interrupted(seats, **more):
        return run(seats, **{**more, "duration_ns": 600_000_000})

    with monkeypatch.context() as patch:
        patch.setattr("twin.experiments.session.run", interrupted)
        fly(Fly(gimbal="emulator", duration_s=5.0, out=out))
    found = replay(Replay(out))
    assert found.identical, [d for d in found.differences if not d.equal]


def test_a_turntables_tape_without_its_map_is_refused(tmp_path, monkeypatch):
    out = tmp_path / "turntable.rrd"
    fly(Fly(gimbal="emulator", attitude="base-gyro", out=out, duration_s=0.5))
    tape = read(out)
    for base in (None, {}, {**tape.properties["base"], "tilt": 10**400}):
        changed = replace(tape, properties={**tape.properties, "base": base})
        monkeypatch.setattr("twin.experiments.replay.read", lambda _, changed=changed: changed)
        with pytest.raises((TwinError, HardwareError), match=r"no map of its base|base\.tilt"):
            replay(Replay(out, out=tmp_path / "a.rrd"))


def test_a_rig_that_is_named_is_asked_anew(rig_flight, tmp_path):
    found = replay(Replay(rig_flight, gimbal="emulator", out=tmp_path / "a.rrd"))
    assert set(found.changed) == {"gimbal"} or not found.changed
    assert "sensors/gyro" in read(found.replayed).series


def test_a_model_in_the_rigs_place_flies_nearly_the_same(rig_flight, tmp_path):
    asked = Replay(rig_flight, gimbal="transfer-function", force=True, out=tmp_path / "a.rrd")
    found = replay(asked)
    assert found.changed["gimbal"] == ("emulator", "transfer-function")
    assert found.changed["fault"][1] == "nothing"
    position = next(d for d in found.differences if d.signal == "vehicle/position")
    assert 0.0 < position.largest < 3.0


@pytest.mark.realtime
def test_a_flight_in_real_time_over_a_line_repeats_itself_without_either(tmp_path, monkeypatch):
    out = tmp_path / "live.rrd"
    with served(tcp=0) as (_, url):
        told = fly(Fly(gimbal=url, out=out, duration_s=1.0, programme="doublet", at_s=0.3))
    assert read(out).timing == told.timing.as_dict()  # the verdict is part of the recording
    assert read(out).events[-1].text == f"timing {told.timing.text()}"
    without_a_rig(monkeypatch)
    found = replay(Replay(out))
    assert found.identical, [d for d in found.differences if not d.equal]


def test_a_turntables_flight_repeats_itself(tmp_path, monkeypatch):
    out = tmp_path / "turntable.rrd"
    fly(Fly(gimbal="emulator", attitude="base-gyro", out=out, duration_s=0.8, unit=2))
    without_a_rig(monkeypatch)
    found = replay(Replay(out))
    assert found.identical, [d for d in found.differences if not d.equal]
    assert "turntable/measured" in {d.signal for d in found.differences}


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (lambda t: replace(t, estimator=""), "no state of the estimator"),
        (lambda t: replace(t, estimator="[]"), "state of the estimator is invalid"),
        (lambda t: replace(t, estimator="{" * 9000), "state of the estimator is invalid"),
        (lambda t: replace(t, estimator='{"session": 1, "fusion": {}}'), "not a snapshot"),
        (lambda t: replace(t, estimator=" " * 200_000), "must be at most 100000"),
        (lambda t: without(t, "sensors/taken"), "no sensors/taken"),
        (lambda t: without(t, "sensors/gyro"), "no sensors/gyro"),
        (lambda t: without(t, "sensors/device_time"), "no sensors/device_time"),
        (lambda t: without(t, "link/connected"), "no link/connected"),
        (lambda t: with_values(t, "link/lost", lambda v: v[:0]), "no link/lost"),
        (lambda t: shorter(t, "sensors/gyro"), "have different lengths"),
        (lambda t: with_values(t, "sensors/taken", lambda v: v * np.nan), "impossible values"),
        (lambda t: with_values(t, "sensors/session", lambda v: v + 1e300), "impossible values"),
        (lambda t: with_values(t, "sensors/gyro", lambda v: v + 1e300), "impossible values"),
        (lambda t: with_values(t, "sensors/device_time", lambda v: v + 1e300), "impossible values"),
        (lambda t: with_values(t, "sensors/taken", lambda v: v[::-1]), "must not decrease"),
        (lambda t: with_calibration(t, "nonsense"), "calibration is not JSON"),
        (lambda t: with_calibration(t, None), "names the calibration"),
    ],
)
def test_a_tape_that_lacks_something_is_refused_in_one_line(
    rig_flight, tmp_path, monkeypatch, change, told
):
    changed = change(read(rig_flight))
    monkeypatch.setattr("twin.experiments.replay.read", lambda _: changed)
    with pytest.raises((TwinError, HardwareError), match=told) as caught:
        replay(Replay(rig_flight, out=tmp_path / "a.rrd"))
    assert "\n" not in str(caught.value)
    assert list(tmp_path.glob("*.rrd*")) == []


def without(tape, name):
    return replace(tape, series={k: v for k, v in tape.series.items() if k != name})


def shorter(tape, name):
    cut = replace(tape[name], time=tape[name].time[:-1], values=tape[name].values[:-1])
    return replace(tape, series={**tape.series, name: cut})


def with_values(tape, name, change):
    values = change(tape[name].values)
    changed = replace(tape[name], time=tape[name].time[: len(values)], values=values)
    return replace(tape, series={**tape.series, name: changed})


def with_calibration(tape, text):
    return replace(tape, properties={**tape.properties, "files": {"calibration": {"text": text}}})


def test_a_flight_with_other_servos_is_flown_again_with_the_identified_model(tmp_path):
    tuned = Fly(set=("gimbal_servo_gain=1.5", "gimbal_backlash=0.02"), duration_s=0.2)
    fly(replace(tuned, out=tmp_path / "fly.rrd"))
    asked = Replay(tmp_path / "fly.rrd", gimbal="transfer-function", out=tmp_path / "a.rrd")
    assert replay(asked).changed["set"] == ("gimbal_servo_gain=1.5 gimbal_backlash=0.02", "nothing")
    with pytest.raises(TwinError, match="gimbal_servo_slew needs --gimbal linkage"):
        replay(replace(asked, set=("gimbal_servo_slew=5",)))


def test_an_override_that_changed_nothing_and_is_refused_by_now_spoils_no_old_recording(
    tmp_path, monkeypatch
):
    out = tmp_path / "fly.rrd"
    fly(Fly(gimbal="transfer-function", duration_s=0.2, out=out))
    old = read(out)
    set_ = ["gimbal_servo_gain[0]=20", "wind_speed=0"]
    settings = {**old.properties["configuration"], "set": set_}
    changed = replace(old, properties={**old.properties, "configuration": settings})
    monkeypatch.setattr(
        "twin.experiments.replay.read", lambda path: changed if path == out else read(path)
    )
    found = replay(Replay(out))
    assert found.identical, [d for d in found.differences if not d.equal]
    settings["set"] = ["motor_length=1"]
    with pytest.raises(TwinError, match=r"cannot be repeated unchanged: .*motor_length"):
        replay(Replay(out))
