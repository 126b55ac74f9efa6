"""The study as a page: the thesis's figure, errors over steps, and the numbers."""

import math

import numpy as np

from analysis.convergence import Study, Trajectory
from analysis.report import Cell, Line, Panel, Plot, Section, Table
from twin.experiments.convergence.result import ConvergenceResult

COARSE, FINE, REAL_TIME = (31, 90, 220), (30, 170, 60), "#d62728"  # blue to green, and red


def sections(result: ConvergenceResult, at_step: Trajectory | None) -> tuple[Section, ...]:
    """Sections of the page; `at_step` is the flight at the step real time allows."""
    return (_verdict(result), _paths(result, at_step), _errors(result), _numbers(result))


def shade(share: float) -> str:
    """Colour from coarse (0, blue) to fine (1, green), as `#rrggbb`."""
    mixed = (round(a + share * (b - a)) for a, b in zip(COARSE, FINE, strict=True))
    return "#" + "".join(f"{c:02x}" for c in mixed)


def _verdict(result: ConvergenceResult) -> Section:
    chosen = result.chosen
    state = "has converged" if result.converged else "has not converged"
    text = (
        f"In real time, with {result.integrator}, the flight {state}: at the finest step this"
        f" machine keeps up with, {chosen.budget.step * 1e3:.4g} ms, the path error is"
        f" {chosen.error:.1e} m; the tolerance is {result.tolerance:g} m."
    )
    return Section(
        "verdict",
        "Is the solution accurate enough?",
        (
            f"Default of twin fly: {result.judged_in_use()}.",
            text,
            "Flight: " + _FLIGHTS[result.flight],
        ),
    )


_FLIGHTS = {
    "baseline": "free flight under power from the middle of a steered one, disturbed, its gimbal"
    " at rest; no hardware, no transfer function, everything smooth.",
    "closed-loop": "from the launch on, steered by the sampled attitude loop. Commands that jump"
    " at every tick and a thrust curve with corners limit the order that can be observed.",
}


def _paths(result: ConvergenceResult, at_step: Trajectory | None) -> Section:
    series, reference = result.study.of(result.integrator), result.study.reference
    lines: list[Line] = []
    last = max(1, len(series.steps) - 1)
    flown = [
        (f"{h * 1e3:g} ms", shade(k / last), t)
        for k, (h, t) in enumerate(zip(series.steps, series.trajectories, strict=True))
    ]
    step = result.chosen.budget.step
    flown.append((f"{step * 1e3:.4g} ms, real time", REAL_TIME, at_step))
    for name, colour, track in flown:
        if track is None:
            continue
        gap = np.linalg.norm(track.position - reference.trajectory.position, axis=1)
        lines.append(Line(name, track.time, track.position[:, 2].copy(), colour, 0))
        lines.append(Line(name, track.time, _tilt(track), colour, 1))
        lines.append(Line(name, track.time, np.maximum(gap, 1e-16), colour, 2))
    panels = (
        Panel("Height", "m", 0),
        Panel("Nose from the vertical", "°", 1),
        Panel("Distance from the reference", "m", 2, y_log=True),
    )
    caption = (
        f"{result.integrator}, from the largest time step (blue) to the smallest (green); red is"
        " the step that real time allows here. Converged: the red line lies on the green ones."
    )
    plot = Plot("paths", caption, "time [s]", panels, tuple(lines))
    return Section("paths", "The same flight at every step", (), (plot,))


def _tilt(track: Trajectory) -> np.ndarray:
    """Angle between nose and vertical (n,) [°]."""
    x, y = track.attitude[:, 1], track.attitude[:, 2]
    return np.asarray(np.degrees(np.arccos(np.clip(1.0 - 2.0 * (x * x + y * y), -1.0, 1.0))))


def _errors(result: ConvergenceResult) -> Section:
    lines: list[Line] = []
    for k, series in enumerate(result.study.series):
        for panel, quantity in enumerate(("position", "attitude")):
            errors = np.array([getattr(e, quantity) for e in series.errors])
            line = Line(series.integrator, series.steps * 1e3, errors, f"run{k}", panel)
            lines.append(line)
    step, error = result.chosen.budget.step, result.chosen.error
    if math.isfinite(step) and error > 0.0:
        at = np.array([step * 1e3])
        lines.append(Line("real time", at, np.array([error]), REAL_TIME, 0, "rings"))
    panels = (Panel("Position", "m", 0, y_log=True), Panel("Attitude", "rad", 1, y_log=True))
    reference = result.study.reference
    caption = (
        f"Largest error over the flight against {reference.integrator} at"
        f" {reference.step * 1e3:g} ms, Richardson-extrapolated"
        f" (± {reference.uncertainty.position:.1e} m). Slopes are the orders of the table."
    )
    plot = Plot("errors", caption, "time step [ms]", panels, tuple(lines), x_log=True)
    return Section("errors", "Error over time step", (), (plot,))


def _numbers(result: ConvergenceResult) -> Section:
    tables = [_table(result.study, "Position error and observed orders.")]
    if result.jitter is not None:
        tables.append(
            _table(
                result.jitter,
                "Steps jittered by ± 80 %, on a vehicle without gimbal: coefficients that follow"
                " the actual steps keep the order, fixed ones fall to the first.",
            )
        )
    rows = tuple(
        (
            r.budget.integrator,
            _cell(r.budget.step * 1e3, "{:.4g}"),
            _cell(r.budget.step_cost * 1e6, "{:.1f}"),
            _cell(r.error, "{:.1e}"),
            "flown" if r.flown else "expected from its order",
        )
        for r in result.real_time
    )
    head = ("integrator", "finest step [ms]", "one step [µs]", "error there [m]", "")
    caption = "Finest step at which 99 of 100 ticks, with the controller, were done in time."
    tables.append(Table(head, rows, caption))
    return Section("numbers", "Numbers", (), tuple(tables))


def _table(study: Study, caption: str) -> Table:
    head = ("integrator", *(f"{h * 1e3:g} ms" for h in study.series[0].steps), "order", "attitude")
    rows: tuple[tuple[Cell | str, ...], ...] = tuple(
        (
            s.integrator,
            *(_cell(e.position, "{:.1e}") for e in s.errors),
            _cell(s.order["position"], "{:.2f}"),
            _cell(s.order["attitude"], "{:.2f}"),
        )
        for s in study.series
    )
    return Table(head, rows, caption)


def _cell(value: float, form: str) -> Cell:
    return Cell(form.format(value) if math.isfinite(value) else "–", "number")
