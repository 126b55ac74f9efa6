"""The motion check before a run with a rig."""

import itertools
import json
import re
from dataclasses import replace
from math import radians

import numpy as np
import pytest

from analysis.recording import read
from hardware.calibration import write
from hardware.emulator import identity
from hardware.faults import Fault
from hardware.frames import POTENTIOMETER_NAMES
from hardware.simavr.nano import missing
from tests.twin.cli.test_cli import run as command
from twin.errors import CheckError
from twin.hil import RigOptions, open_rig
from twin.hil.check import LARGEST, SMALLEST, check_motion, remedy, wrong_motion
from twin.hil.simulated import nominal_calibration, parameters
from twin.plant.compiled import compiled
from twin.plant.model.model import ModelConfig, load

pytestmark = pytest.mark.checked
STEP = "step --gimbal emulator --signal steps --amplitude-deg 1 --hold-s 0.2 --repeats 1"


def response(own=(1.0, 1.0), other=(0.0, 0.0)):
    return (own[0], other[0]), (other[1], own[1])


@pytest.mark.parametrize("own", [0.72, 1.0, 1.13, 1.25])
def test_play_and_tolerances_of_healthy_rigs_pass(own):
    assert wrong_motion(response((own, own), (0.1, -0.1)), 0.02) == ""


@pytest.mark.parametrize(
    ("own", "other", "problem"),
    [
        ((-1.0, 1.0), (0.0, 0.0), "servo_x reversed"),
        ((1.0, -0.7), (0.0, 0.0), "servo_y reversed"),
        ((0.0, 0.1), (1.0, 0.9), "servos swapped"),
        ((0.1, 0.0), (-1.0, 0.9), "servos swapped"),
        ((1.0, 0.02), (0.0, 0.0), "servo_y not following"),
        ((0.5 * 1.13, 1.0), (0.0, 0.0), "servo_x moves by the wrong angle"),
        ((1.0, 2.0 * 0.72), (0.0, 0.0), "servo_y moves by the wrong angle"),
        ((1.0, 1.0), (0.7, 0.0), "x moves by 0.70 of the command of y"),
    ],
)
def test_each_wrong_motion_is_named(own, other, problem):
    assert wrong_motion(response(own, other)).startswith(problem)


@pytest.mark.parametrize(
    ("stall_ms", "every", "fault", "says"),
    [
        (280, 126, (), r"readings came up to 28\d ms late; this computer is too busy"),
        (280, 30, (), r"readings came up to 28\d ms late; this computer is too busy"),
        (40, 30, ("servo_x:reversed",), "servo_x reversed"),
        (280, 126, ("potentiometer_x_a:open",), "potentiometer_x_a open"),
    ],
)
def test_a_rig_that_goes_neutral_in_a_stall_is_not_blamed(stall_ms, every, fault, says):
    """Its servos return to zero 100 ms after the last command: in a sample (126), or before it."""
    with compiled(), open_rig(RigOptions("emulator", faults=fault), None) as seat:
        wait, calls = seat.wait, itertools.count(1)

        def stalled(ns):
            wait(ns + (stall_ms * 1_000_000 if next(calls) % every == 0 else 0))

        seat.wait = stalled
        with pytest.raises(CheckError, match=says) as refusal:
            check_motion(seat)
    assert ("plugs" in str(refusal.value)) is bool(fault)


def test_a_run_is_refused_in_one_line_and_leaves_no_recording(capsys, tmp_path):
    line = f"{STEP} --fault servo_x:reversed --out {tmp_path / 'a.rrd'}"
    status, out, err = command(capsys, *line.split())
    assert status == 1
    assert out == ""
    (text,) = err.strip().splitlines()
    assert text.startswith("twin: motion check: servo_x reversed: x moved by -4")
    assert "--no-check" in text
    assert list(tmp_path.iterdir()) == []


def refused(**options):
    with (
        pytest.raises(CheckError) as refusal,
        compiled(),
        open_rig(RigOptions("emulator", check=True, **options), None),
    ):
        pass
    return str(refusal.value)


@pytest.mark.parametrize(
    ("fault", "name"),
    [
        ("servos:swapped", "servos swapped"),
        ("servo_y:dead", "servo_y not following"),
        ("servo_x:hard_over", "servo_x not following"),
        ("servo_y:slipped:12", "servo_y offset by 5."),
        ("potentiometer_x_a:glitch:0.2", "motion check: potentiometer_x_a deviating"),
    ],
)
def test_each_fault_of_a_servo_is_refused(fault, name):
    assert name in refused(faults=(fault,))


@pytest.mark.parametrize(
    ("change", "name"),
    [
        (((-1, 0), (0, 1)), "servo_x reversed"),
        (((0, 1), (1, 0)), "servos swapped"),
        (((2, 0), (0, 1)), "wrong angle"),
        (((0.5, 0), (0, 1)), "wrong angle"),
    ],
)
def test_a_tampered_calibration_is_refused(tmp_path, change, name):
    bench = load(ModelConfig(scene="bench")).mj
    true = nominal_calibration(bench, parameters(bench))
    matrix = tuple(map(tuple, (np.array(change) @ np.array(true.matrix)).tolist()))
    write(tmp_path / "c.json", replace(true, rig=identity(parameters(bench)), matrix=matrix))
    assert name in refused(calibration=tmp_path / "c.json")


@pytest.mark.thorough
def test_a_healthy_run_records_its_check_and_fault_times_do_not_count_it(capsys, tmp_path):
    out = tmp_path / "a.rrd"
    fault = "potentiometer_x_a:open@1.4"
    status, text, _ = command(
        capsys, *STEP.split(), "--fault", fault, "--on-fault", "ignore", "--out", str(out), "--json"
    )
    assert "potentiometer_x_a" in json.loads(text)["fault"]
    events = read(out).events
    assert any("motion check: x moved 1." in e.text for e in events)
    named = next(e for e in events if "potentiometer_x_a" in e.text)
    assert 0.0 < named.time < 0.7  # about 0.9 s of the rig's time are before the run
    assert status == 0


def test_a_rig_that_fails_at_the_start_is_named_although_nothing_was_measured(capsys, tmp_path):
    fault = "potentiometer_x_a:glitch:0.2"
    line = f"{STEP} --no-check --fault {fault} --out {tmp_path / 'a.rrd'}"
    status, out, _ = command(capsys, *line.split())
    assert status == 1
    assert re.search(r"^FAULT +potentiometer", out, re.MULTILINE)


def test_a_skipped_check_is_recorded(capsys, tmp_path):
    out = tmp_path / "a.rrd"
    line = f"{STEP} --no-check --fault servo_x:reversed --out {out}"
    status, _, _ = command(capsys, *line.split())
    assert status == 1
    texts = [e.text for e in read(out).events]
    assert any("motion check skipped as requested" in t for t in texts)
    assert (
        "servo fault: servo_x reversed"
        in texts[texts.index("servo fault: servo_x not following") :]
    )
    assert any(t.startswith("fault: servo_x") and "the run ends" in t for t in texts)


def test_no_check_needs_a_rig(capsys):
    status, _, err = command(capsys, "fly", "--no-check")
    assert status == 2
    assert "--no-check needs a rig" in err


@pytest.mark.skipif(bool(missing()), reason="the AVR tools are missing")
def test_the_simulated_nano_is_checked_too():
    with compiled(), open_rig(RigOptions("firmware", unit=3, check=True), None) as seat:
        (event,) = seat.notices
    assert all(SMALLEST < own < LARGEST for own in event.response)


@pytest.mark.parametrize("units", [range(3), pytest.param(range(200), marks=pytest.mark.slow)])
def test_healthy_units_pass(units):
    for unit in units:
        with compiled(), open_rig(RigOptions("emulator", unit=unit, check=True), None) as seat:
            assert len(seat.notices) == 1


def test_a_rig_whose_potentiometers_are_all_open_is_pointed_to_the_minimal_calibration():
    faults = [Fault(name, "open", 0.0) for name in POTENTIOMETER_NAMES]
    assert "twin calibrate --minimal" in remedy(faults)
    assert "--minimal" not in remedy(faults[:3])


def test_a_simulated_rig_has_the_tracks_it_is_given():
    """The same angle turns a track of 333° by 0.72 of what it turns one of 240°."""
    bench = load(ModelConfig(scene="bench")).mj
    for unit in (None, 3):
        plain, longer = (parameters(bench, unit, radians(t)).sensors for t in (240.0, 333.0))
        for p, q in zip(plain.potentiometers, longer.potentiometers, strict=True):
            turned = [r.fraction(0.1) - r.fraction(0.0) for r in (p, q)]
            assert turned[1] / turned[0] == pytest.approx(240 / 333)


@pytest.mark.slow
@pytest.mark.parametrize("unit", range(1, 9))
def test_a_calibrated_unit_without_a_fault_is_not_accused(unit, capsys, tmp_path):
    """Unit 2 shows 0.1° of hysteresis to a creeping calibration, and stops 0.33° off after a step.

    Its servo stops anywhere within the dead band.
    """
    file, rig = tmp_path / "rig.json", f"--gimbal emulator --unit {unit}"
    status, *_ = command(capsys, *f"calibrate {rig} --repeats 1 --out {file}".split())
    assert status == 0
    out = tmp_path / "steps.rrd"
    line = f"step {rig} --calibration {file} --seed 1 --repeats 1 --out {out}"
    status, text, err = command(capsys, *line.split())
    assert status == 0, text + err
