"""The stages of the demonstration, each of them a verb that could be given alone."""

import time
from pathlib import Path
from typing import Any

from analysis.files import write_text
from analysis.report import render
from twin import status
from twin.config import Demo
from twin.config.paths import RUNS, dated, point_latest
from twin.config.verbs import BY_NAME
from twin.errors import TwinError
from twin.workflows.demo.page import sections
from twin.workflows.demo.result import DemoResult, Stages

STAGES = 9
REPEATS, HOLD_S = 3, 0.8  # of the steps
LONGEST_FLIGHT_S = 600.0
STUDY = """\
[study]
title = "Flights to a point in changing wind, with the identified model"

[fly]
gimbal = "transfer-function"
model = "model.json"
programme = "point"
off_axis_deg = [15.0, 5.0]

[vary.wind_speed]
distribution = "lognormal"
median = 3.0
sigma = 0.4

[vary.wind_azimuth]
distribution = "uniform"
low = -3.1416
high = 3.1416

[design]
kind = "random"
n = 20

[measure]
hit = "closest_approach_m <= 5"
"""


def demo(config: Demo) -> DemoResult:
    """Go all the way with one rig: calibrate, step, identify, compare, fly, report.

    Raises
    ------
    TwinError, HardwareError, AnalysisError, CheckError : a stage that failed; what earlier ones
        wrote stays in the folder
    """
    began = time.perf_counter()
    folder = _folder(config)
    result = DemoResult(
        config.gimbal, config.serial, folder, _run(config, folder), time.perf_counter() - began
    )
    render(sections(result), "A gimbal from the bench to a flight", result.page, result.as_dict())
    point_latest(folder)
    return result


def _folder(config: Demo) -> Path:
    folder = config.out or dated(RUNS, "demo", "")
    try:
        folder.mkdir(parents=True)
    except FileExistsError:
        raise TwinError(f"--out {folder}: exists; give the name of a new folder") from None
    except OSError as error:
        raise TwinError(f"cannot write {folder}: {error.strerror}") from None
    return folder


def _run(config: Demo, folder: Path) -> Stages:
    rig: dict[str, Any] = {"gimbal": config.gimbal, "seed": config.seed}
    if config.serial is not None:
        rig["unit"] = config.serial
    calibration, calibrated = config.calibration, None
    if calibration is None:
        calibration = folder / "calibration.json"
        calibrated = _stage(1, "calibrate", **rig, out=calibration)
    rig["calibration"] = calibration
    steps = _stage(2, "step", **rig, repeats=REPEATS, hold_s=HOLD_S, out=folder / "steps.rrd")
    model = _stage(3, "identify", sources=steps, out=folder / "model.json")
    physics = _stage(4, "compare", recordings=steps, out=folder / "compare-linkage.rrd")
    fitted = _stage(
        5, "compare", recordings=steps, with_=str(model.file), out=folder / "compare-model.rrd"
    )
    flight: dict[str, Any] = {"programme": "doublet", "duration_s": LONGEST_FLIGHT_S}
    flown = _stage(
        6, "fly", gimbal="transfer-function", model=model.file, **flight, seed=config.seed,
        out=folder / "flight-model.rrd",
    )  # fmt: skip
    looped = _stage(7, "fly", **rig, **flight, out=folder / "flight-rig.rrd")
    apart = _stage(8, "compare", recordings=(looped, flown), out=folder / "compare-flights.rrd")
    study = folder / "wind.toml"
    write_text(study, STUDY)
    windy = _stage(9, "campaign", action="run", study=str(study), out=folder / "wind")
    return Stages(calibrated, steps, model, physics, fitted, flown, looped, apart, windy)


def _stage(number: int, name: str, **settings: object) -> Any:  # noqa: ANN401
    """Run a verb as a stage that the status line names.

    Raises
    ------
    the verb's own errors, with the stage in front
    """
    began = time.perf_counter()
    status.begun(f"{number}/{STAGES} {name}")
    with status.stage(f"{number}/{STAGES} {name}: "):
        status.say("starting")
        try:
            result = BY_NAME[name].run(**settings)
        except Exception as error:
            error.args = (f"stage {number}, {name}: {error}", *error.args[1:])
            raise
    status.done(f"{number}/{STAGES} {name}, {time.perf_counter() - began:.0f} s")
    return result
