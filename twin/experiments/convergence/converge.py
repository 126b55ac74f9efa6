"""`twin converge`: one flight with every integrator at every time step."""

import math
import time
from collections.abc import Iterator
from contextlib import contextmanager

import mujoco

from analysis.convergence import Flight, Study, distance, richardson, study
from analysis.report import render
from twin.config import Converge, Fly
from twin.config.paths import named, point_latest
from twin.errors import TwinError
from twin.experiments.assembly import make_plant
from twin.experiments.convergence.budget import budget
from twin.experiments.convergence.flights import JITTERED, flight, jittered, load_for
from twin.experiments.convergence.page import sections
from twin.experiments.convergence.result import ConvergenceResult, InUse, RealTime
from twin.plant.compiled import compiled

REFERENCE = "rk4"
# s; the baseline's steps divide 0.2 s, the closed loop's its control period
STEPS = {"baseline": (0.02, 0.01, 0.005, 0.0025), "closed-loop": (0.004, 0.002, 0.001, 0.0005)}
MOST_STEPS = 12
JITTERED_STEPS = (0.004, 0.002, 0.001, 0.0005)  # s; the rocket of the jittered flights swings fast


def converge(config: Converge) -> ConvergenceResult:
    """Fly one flight with every integrator at every step, and write the page.

    Raises
    ------
    TwinError, AnalysisError : something the user asked for cannot be done, in one line
    """
    began = time.perf_counter()
    steps = _steps(config)
    out = named(config.out, "converge", ".html", ".htm", force=config.force)
    names = tuple(dict.fromkeys(config.integrators))
    with compiled(), _quietly():
        fly = flight(config)
        studied = study(fly, names, steps, richardson(fly, REFERENCE, min(steps)))
        uneven = _jitter(config)
        in_use = _in_use(config, fly, studied)
        shown = in_use.integrator if in_use.integrator in names else names[0]
        real_time = tuple(
            _real_time(config, fly, studied, name, shown=name == shown) for name in names
        )
        step = next(r.budget.step for r in real_time if r.budget.integrator == shown)
        at_step = None if math.isnan(step) else fly(shown, step)
    result = ConvergenceResult(
        config.flight, studied, uneven, real_time, in_use, shown, config.tolerance_m,
        str(out), time.perf_counter() - began,
    )  # fmt: skip
    render(sections(result, at_step), "Convergence study", out, result.as_dict())
    point_latest(out)
    return result


@contextmanager
def _quietly() -> Iterator[None]:
    """Keep MuJoCo's warnings of flights that diverge, as coarse ones may, off the terminal."""
    before = mujoco.get_mju_user_warning()
    mujoco.set_mju_user_warning(lambda _: None)
    try:
        yield
    finally:
        mujoco.set_mju_user_warning(before)


def _steps(config: Converge) -> tuple[float, ...]:
    steps = tuple(ms * 1e-3 for ms in config.dt_ms) or STEPS[config.flight]
    if not 2 <= len(set(steps)) <= MOST_STEPS:
        raise TwinError(f"--dt-ms: {len(set(steps))} different steps; must be 2 to {MOST_STEPS}")
    return steps


def _jitter(config: Converge) -> Study | None:
    if config.flight != "baseline":
        return None
    fly, steps = jittered(config), JITTERED_STEPS
    return study(fly, tuple(JITTERED), steps, richardson(fly, REFERENCE, min(steps)))


def _in_use(config: Converge, fly: Flight, studied: Study) -> InUse:
    flight = Fly(
        gimbal=config.gimbal,
        vehicle=config.vehicle,
        mechanism=config.mechanism,
        model=config.model,
        set=tuple(config.overrides.items()),
        control_hz=config.control_hz,
    )
    plant = make_plant(flight, config.motor, recorded=False)
    name, step = plant.integrator, plant.dt_ns * 1e-9
    try:
        flown = fly(name, step)
    except TwinError:  # no whole number of such steps in an interval
        flown = None
    error = math.nan
    if flown is not None:
        error = distance(flown, studied.reference.trajectory).position
    return InUse(name, step, error)


def _real_time(
    config: Converge, fly: Flight, studied: Study, name: str, *, shown: bool
) -> RealTime:
    """Only the figure's integrator is flown at its own step; the others follow their order."""
    afforded = budget(load_for(config), name, config)
    if math.isnan(afforded.step):
        return RealTime(afforded, math.nan, flown=False)
    if shown:
        flown = fly(name, afforded.step)
        if flown is not None:
            return RealTime(afforded, distance(flown, studied.reference.trajectory).position, True)
    # what lies below the reference's own uncertainty is indistinguishable from it
    floor = studied.reference.uncertainty.position
    return RealTime(afforded, max(studied.of(name).error_at(afforded.step), floor), flown=False)
