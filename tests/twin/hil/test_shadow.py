"""The model beside a rig: same commands, nothing measured, one recording."""

import json

import numpy as np
import pytest

from analysis.comparison import errors
from analysis.recording import load, read
from analysis.recording.caveats import caveats
from tests.twin.cli.test_cli import run as command
from twin.config import Compare, Replay, Step
from twin.errors import TwinError
from twin.experiments.replay import replay
from twin.experiments.step import step
from twin.hil.resimulation import Resimulation, Variant
from twin.plant.compiled import compiled
from twin.plant.model.model import REFERENCE_GIMBAL

SHORT = {"gimbal": "emulator", "repeats": 1, "hold_s": 0.3, "axis": "x"}


def made(folder, name, **changes):
    out = folder / f"{name}.rrd"
    step(Step(**{**SHORT, **changes}, out=out))
    return read(out)


def fit(run):
    seen, shown = run["gimbal/measured"], run["gimbal/simulated"]
    there = np.interp(seen.time, shown.time, shown.column("x"))
    return errors(seen.column("x"), there).fit


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("shadow")


@pytest.fixture(scope="module")
def nominal(folder):
    return made(folder, "nominal")


def test_the_linkage_with_the_rigs_own_parameters_moves_as_the_rig_does(nominal):
    assert fit(nominal) > 97.0


@pytest.mark.thorough
def test_a_rig_with_slower_servos_moves_otherwise_and_the_recording_names_them(folder, nominal):
    slow = made(folder, "slow", set={"gimbal_servo_slew": 6.0})
    assert fit(slow) < fit(nominal) - 3.0
    assert caveats([load(folder / "slow.rrd")])[0].endswith("without the rig's gimbal_servo_slew")
    both = made(
        folder, "both", set={"gimbal_servo_slew": 6.0}, shadow_set={"gimbal_servo_slew": 6.0}
    )
    assert fit(both) > 97.0
    assert not caveats([load(folder / "both.rrd")])


def test_nothing_that_is_measured_touches_it(folder, nominal):
    fault = {"fault": ("potentiometer_x_a:offset:2@0.5",), "on_fault": "ignore"}
    noisy = made(folder, "noisy", **fault)
    assert not np.array_equal(noisy["gimbal/measured"].values, nominal["gimbal/measured"].values)
    for name in ("gimbal/simulated", "gimbal/rate/simulated"):
        assert noisy[name].values.tobytes() == nominal[name].values.tobytes()


def test_a_replay_computes_it_from_the_recording_to_the_last_bit(folder, nominal):
    again = replay(Replay(folder / "nominal.rrd", out=folder / "again.rrd"))
    assert again.identical
    same = {d.signal for d in again.differences}
    assert same >= {"gimbal/simulated", "gimbal/rate/simulated", "gimbal/followed"}
    assert np.ptp(read(folder / "again.rrd")["gimbal/simulated"].values) > 0.1


def test_an_identified_model_beside_a_rig_is_that_of_a_run_without_a_rig(folder):
    beside = made(folder, "beside", shadow="transfer-function")["gimbal/simulated"]
    alone = made(folder, "alone", gimbal="transfer-function")["gimbal/simulated"]
    np.testing.assert_array_equal(beside.time, alone.time)
    # the one beside the rig has been held at zero for half a second before
    np.testing.assert_allclose(beside.values, alone.values, atol=np.radians(2e-3))


def test_a_model_of_other_axes_is_refused_before_a_servo_moves(capsys, folder):
    model = json.loads(REFERENCE_GIMBAL.read_text())
    model |= {"inputs": ["x"], "outputs": ["x"], "channels": [[model["channels"][0][0]]]}
    model.pop("covariance", None)
    file = folder / "one.json"
    file.write_text(json.dumps(model))
    line = f"step --gimbal emulator --shadow transfer-function --model {file}"
    code, _, error = command(capsys, *line.split(), "--out", str(folder / "never.rrd"))
    assert code == 2
    assert error.count("\n") == 1
    assert "['x']" in error
    assert not (folder / "never.rrd").exists()


@pytest.mark.parametrize(
    ("settings", "match"),
    [
        ({"shadow": "linkage"}, "--shadow needs a rig"),
        ({"gimbal": "emulator", "shadow": "none", "shadow_set": {"a": 1.0}}, "has no parameters"),
    ],
)
def test_settings_without_effect_are_refused(settings, match):
    with pytest.raises(TwinError, match=match):
        Step(**settings)


def test_without_it_only_the_joints_that_follow_are_recorded(capsys, folder):
    run = made(folder, "none", shadow="none")
    assert "gimbal/simulated" not in run.series
    assert run["gimbal/followed"].values.shape[1] == 2
    code, _, error = command(capsys, "compare", str(folder / "none.rrd"))
    assert code == 2
    assert "holds no simulated angles" in error


def test_a_run_simulated_again_moves_as_the_model_beside_its_rig_did(nominal):
    with compiled():
        same, later, at_once = Resimulation(nominal).motions(
            [Variant(), Variant(late=0.008), Variant(at_once=True)]
        )
    beside = nominal["gimbal/simulated"]
    # the stepper of the run calls MuJoCo from Python, this one from C: a last bit may differ
    np.testing.assert_allclose(same, beside.values, atol=1e-12)
    shift = round(0.008 / 0.002)
    np.testing.assert_allclose(later[shift:], same[:-shift], atol=1e-5)  # it still settles
    step_up = np.flatnonzero(same[:, 0] > 0.04)[0], np.flatnonzero(at_once[:, 0] > 0.04)[0]
    assert 0.0 < (step_up[0] - step_up[1]) * 0.002 <= 0.023  # a frame of 20 ms and the wire


def test_a_record_too_short_for_an_estimate_is_refused(folder, nominal, capsys):
    out = folder / "no.rrd"
    code, _, error = command(
        capsys, "compare", str(folder / "nominal.rrd"), "--drift", "--out", str(out)
    )
    assert code == 2
    assert "an estimate needs 10 s" in error
    assert not out.exists()
    with pytest.raises(TwinError, match="takes one recording"):
        Compare((out, out), drift=True)
