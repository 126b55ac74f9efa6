"""The page of the demonstration: verdicts, one step with both models, both flights, the files."""

import math
from typing import TYPE_CHECKING

import numpy as np

from analysis.comparison.grade import FAIR_FIT, GOOD_FIT, Grade, grade
from analysis.recording import read
from analysis.report import Line, Panel, Plot, Section, Table
from analysis.report.parts import Verdicts, held
from twin.workflows.demo.result import DemoResult

if TYPE_CHECKING:
    from analysis.recording import Recording
    from twin.evaluation.compare_result import CompareResult

GRADES = f"Fit: good from {GOOD_FIT:.0f} %, fair from {FAIR_FIT:.0f} %; 100 % is exact."
BEFORE, AFTER = 0.05, 0.45  # s around a step that is shown
FILES = (
    ("steps.rrd", "the rig's answer to steps, and the physical model beside it"),
    ("model.json", "the identified model, for --gimbal transfer-function --model"),
    ("calibration.json", "the rig's calibration, for --calibration"),
    ("flight-model.rrd", "the flight with the identified model"),
    ("flight-rig.rrd", "the same flight with the rig in the loop"),
    ("wind.toml", "the campaign's study: change its wind, its point, its number of flights"),
    ("wind/report.html", "the campaign's own page"),
    ("compare-linkage.rrd", "rig and physical model, with their difference"),
    ("compare-model.rrd", "rig and identified model, with their difference"),
    ("compare-flights.rrd", "gimbal angles of both flights"),
)


def sections(result: DemoResult) -> tuple[Section, ...]:
    """Sections of the page."""
    facts = tuple((f.topic, f.text, f.meaning) for f in result.facts())
    files = tuple((n, what) for n, what in FILES if (result.folder / n).exists())
    verdicts = Verdicts((
        _verdict("physical model", result.stages.physics),
        _verdict("identified model", result.stages.fitted),
    ))  # fmt: skip
    return (
        Section("answer", "Results", (GRADES,), (
            verdicts, Table(("what", "figure", "what it means"), facts))),
        Section("step", "One step of the gimbal", parts=(_step(result),)),
        Section("flights", "The same flight, twice", parts=(_flights(result),)),
        Section("files", "What is in this folder", ("Recordings open with: twin view FILE",),
                (Table(("file", "content"), files),)),
        Section("next", "What to try next", parts=(
            Table(("command", "what it does"), result.ideas()),)),
    )  # fmt: skip


def _verdict(name: str, compared: "CompareResult") -> tuple[str, Grade]:
    fit = compared.comparison.fit
    return f"{name}: fit {fit:.1f} %", grade(fit)


def _step(result: DemoResult) -> Plot:
    run = read(result.folder / "steps.rrd")
    model = read(result.folder / "compare-model.rrd")
    command = run["gimbal/command"]
    x = command.column("x")
    begin = float(command.time[np.flatnonzero(np.diff(x))[0] + 1])
    lines = [Line("command", *held(*_window(run, "gimbal/command", begin)), "command")]
    for name, source, signal, role in (
        ("rig, measured", run, "gimbal/measured", "run0"),
        ("physical model", run, "gimbal/simulated", "run1"),
        ("identified model", model, "gimbal/other", "run2"),
    ):
        if signal in source.series:
            lines.append(Line(name, *_window(source, signal, begin), role))
    caption = "The first step of axis x: commanded, measured on the rig, and by both models."
    return Plot("step", caption, "time [s]", (Panel("", "angle x [°]"),), tuple(lines))


def _window(run: "Recording", signal: str, begin: float) -> tuple[np.ndarray, np.ndarray]:
    series = run[signal]
    rows = (series.time > begin - BEFORE) & (series.time < begin + AFTER)
    return series.time[rows], np.degrees(series.column("x")[rows])


def _flights(result: DemoResult) -> Plot:
    panels = (
        Panel("", "height [m]", x_label="downrange [m]"),
        Panel("", "attitude error [°]", row=1, x_label="time [s]"),
    )
    lines = []
    for k, (name, file) in enumerate(
        (("rig in the loop", "flight-rig.rrd"), ("identified model", "flight-model.rrd"))
    ):
        run = read(result.folder / file)
        place = run["vehicle/position"].values
        across = np.hypot(*(place[:, :2] - place[0, :2]).T)
        error = run["control/error"]
        size = np.degrees(np.hypot(*error.values[:, :2].T))
        lines += [
            Line(name, across, place[:, 2] - place[0, 2], f"run{k}"),
            Line(name, error.time, size, f"run{k}", panel=1),
        ]
    apart = result.stages.apart.flight
    caption = "Height over downrange, and the angle between the nose and the programme."
    if apart is not None:
        caption += (
            f" Under power the paths are at most {apart.path_worst:.2f} m apart, the noses"
            f" {math.degrees(apart.attitude_rms):.2f}° rms."
        )
    return Plot("flights", caption, "time [s]", panels, tuple(lines))
