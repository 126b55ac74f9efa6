"""`twin demo`: every stage runs, and its page and screen say what the stages measured."""

import json
import math
from types import SimpleNamespace

import pytest

import twin
from analysis.recording import read
from hardware.calibration import write
from twin.config import Demo, Step
from twin.config.verbs import BY_NAME
from twin.experiments.assembly import rig_calibration
from twin.workflows.demo import demo

# twenty flights on two processes; what a campaign answers is tested with it
CAMPAIGN = SimpleNamespace(
    answers=SimpleNamespace(text="hit holds in 95.0 % of 20 runs"), passed=True, as_dict=dict
)
SHORT = {"REPEATS": 1, "HOLD_S": 0.3, "LONGEST_FLIGHT_S": 0.6}


@pytest.fixture(scope="module")
def shown(tmp_path_factory):
    """A demonstration with a calibration that was given, short steps and short flights."""
    folder = tmp_path_factory.mktemp("demo")
    given = folder / "nominal.json"
    write(given, rig_calibration(Step(gimbal="emulator")))
    with pytest.MonkeyPatch.context() as patch:
        for name, value in SHORT.items():
            patch.setattr(f"twin.workflows.demo.stages.{name}", value)
        patch.setitem(BY_NAME, "campaign", SimpleNamespace(run=lambda **_: CAMPAIGN))
        patch.setattr("twin.hil.connect.check_motion", lambda seat: None)
        return twin.demo(calibration=given, out=folder / "out")


@pytest.mark.thorough
def test_the_folder_holds_every_recording_the_model_and_one_page(shown):
    names = {p.name for p in shown.folder.iterdir()}
    assert {"steps.rrd", "model.json", "flight-model.rrd", "flight-rig.rrd", "demo.html"} <= names
    assert read(shown.folder / "flight-rig.rrd").properties["configuration"]["gimbal"] == "emulator"
    page = shown.page.read_text(encoding="utf-8")
    assert all(fact.topic in page for fact in shown.facts())


def test_the_screen_gives_the_numbers_of_the_stages(shown):
    text = shown.text()
    errors = [a.as_is.rmse for a in shown.stages.physics.comparison.axes]
    assert f"{math.degrees(max(errors)):.2f}° rms" in text
    assert f"{shown.stages.looped.attitude_error_rms_deg:.2f}° rms attitude error" in text
    assert str(shown.page) in text
    assert "calibrated" not in text  # the calibration was given
    json.dumps(shown.as_dict(), allow_nan=False)


def test_a_stage_that_fails_is_named_and_an_existing_folder_is_kept(shown, tmp_path, capsys):
    with pytest.raises(twin.TwinError, match="exists; give the name"):
        twin.demo(out=shown.folder)
    with pytest.raises(twin.HardwareError, match=r"stage 1, calibrate: .*no such port"):
        demo(Demo(gimbal="/dev/ttyUSB77", out=tmp_path / "new"))
    assert "1/9 calibrate\n" in capsys.readouterr().err  # where no status line is shown


@pytest.mark.slow
@pytest.mark.parametrize("gimbal", ["emulator", "firmware"])
def test_a_simulated_rig_goes_all_the_way(gimbal, tmp_path):
    result = twin.demo(gimbal=gimbal, out=tmp_path / "all")
    assert result.passed
    assert result.stages.physics.comparison.fit > 90.0
    assert result.stages.apart.flight.share < 0.01
