"""`twin fly --repeat`: one flight a seed, for a rig also with its models."""

import math
import time
from dataclasses import replace
from pathlib import Path

from analysis.comparison.flights import (
    FlightPath,
    attitude_step,
    flight_path,
    path_difference,
    spread,
)
from analysis.recording import read
from analysis.report import render
from analysis.response.figure import Figure, over_repeats
from analysis.response.metrics import StepMetrics
from analysis.response.steps import up_to_hidden
from twin import status
from twin.config import Fly, with_model
from twin.config.paths import RUNS, dated, point_latest, writable
from twin.config.seats import MODELS, is_rig
from twin.errors import TwinError
from twin.experiments.flight.fly import fly
from twin.experiments.flight.result import FlightResult
from twin.experiments.repeat.page import sections
from twin.experiments.repeat.result import RepeatResult, SeatFlights

STEP_FIGURES = (("overshoot", "%"), ("settling_time", "s"), ("rise_time", "s"))


def repeat(config: Fly) -> RepeatResult:
    """Fly repeatedly, each flight with the next seed, and write a page.

    Raises
    ------
    TwinError, HardwareError, AnalysisError : something asked for cannot be done, in one line
    """
    began = time.perf_counter()
    folder, page = _places(config)
    others = MODELS if is_rig(config.gimbal) else ()
    names = (config.gimbal, *(m for m in others if m != config.gimbal))
    seats = tuple(_seat(config, name, folder) for name in names)
    flown = seats[0].paths
    differences = {s.gimbal: path_difference(flown[0], s.paths[0]) for s in seats[1:] if flown}
    result = RepeatResult(seats, differences, str(page), time.perf_counter() - began)
    render(sections(result), "Repeated flights", page, result.as_dict())
    point_latest(page)
    return result


def _places(config: Fly) -> tuple[Path, Path]:
    out = config.out or dated(RUNS, "repeat", ".html")
    if out.suffix.lower() in (".html", ".htm"):
        return out.with_suffix(""), writable(out, force=config.force)
    if out.suffix:
        raise TwinError(f"--out {out}: must be a folder or a page (.html) with --repeat")
    return out, writable(out.with_suffix(".html"), force=config.force)


def _seat(config: Fly, gimbal: str, folder: Path) -> SeatFlights:
    results: list[FlightResult] = []
    paths: list[FlightPath] = []
    steps: list[StepMetrics] = []
    same = False
    name = gimbal if gimbal in MODELS or not is_rig(gimbal) else _slug(gimbal)
    for k in range(config.repeat):
        out = folder / f"{name}-{k + 1:02d}.rrd"
        with status.stage(f"{gimbal}, flight {k + 1} of {config.repeat}: "):
            result = fly(_one(config, gimbal, config.seed + k, out))
        results.append(result)
        if not _counts(result, config):
            continue  # it has no end that could be compared
        recording = read(out)
        paths.append(flight_path(recording))
        if (metrics := attitude_step(recording)) is not None:
            steps.append(metrics)
        same = len(paths) > 1 and all(_equal(path, paths[0]) for path in paths[1:])
        if same and k == 1:  # nothing random in it: more flights would be equal
            break
    scatter = spread(paths) if len(paths) > 1 else None
    different = slice(1) if same else slice(None)  # equal flights count as one
    figures = _figures([r for r in results if _counts(r, config)][different], steps[different])
    return SeatFlights(gimbal, tuple(results), tuple(paths), same, scatter, figures)


def _counts(result: FlightResult, config: Fly) -> bool:
    return result.passed or config.on_fault == "ignore"


def _one(config: Fly, gimbal: str, seed: int, out: Path) -> Fly:
    one = replace(config, seed=seed, out=out, repeat=1, json=False)
    return one if gimbal == config.gimbal else with_model(one, gimbal)


def _equal(a: FlightPath, b: FlightPath) -> bool:
    return a.position.tobytes() == b.position.tobytes() and a.nose.tobytes() == b.nose.tobytes()


def _figures(results: list[FlightResult], steps: list[StepMetrics]) -> tuple[Figure, ...]:
    errors = [math.radians(r.attitude_error_rms_deg) for r in results if r.attitude_error_rms_deg]
    figures = [over_repeats("attitude_error_rms", errors, "rad")]
    closest = [r.closest_approach_m for r in results if r.closest_approach_m is not None]
    if closest:
        figures.append(over_repeats("closest_approach", closest, "m"))
    if steps:
        size = steps[0].amplitude
        of_steps = [
            over_repeats(name, [getattr(s, name) for s in steps], unit, size)
            for name, unit in STEP_FIGURES
        ]
        figures += [up_to_hidden(f, steps) if f.name == "overshoot" else f for f in of_steps]
    return tuple(figures)


def _slug(port: str) -> str:
    return "".join(c if c.isalnum() else "-" for c in port).strip("-") or "rig"
