"""Trajectory, speed, attitude and thrust of every flight, and its numbers."""

from collections.abc import Sequence

import numpy as np

from analysis.array import Array
from analysis.recording.measurements import Measurement
from analysis.report.numbers import ReportNumbers
from analysis.report.parts import Cell, Line, Panel, Plot, Section, Table, thinned
from analysis.report.sections.flown import Flown, downrange, flown
from analysis.report.words import number


def flight(runs: Sequence[Measurement], numbers: ReportNumbers) -> Section | None:  # noqa: ARG001
    """Trajectory and signals of every flight with a table of its numbers; None without one."""
    flights = [(k, run, f) for k, run in enumerate(runs) if (f := flown(run)) is not None]
    if not flights:
        return None
    panels = [Panel("trajectory", "height [m]", 0, 0, x_label="downrange [m]")]
    lines = [Line(run.name, *thinned(*downrange(run)), f"run{k}") for k, run, _ in flights]
    for title, label, signal, component, scale in SHOWN:
        drawn = [(k, run) for k, run, _ in flights if signal in run.recording.series]
        if not drawn:
            continue
        row, column = divmod(len(panels), 2)
        panels.append(Panel(title, label, row, column))
        for k, run in drawn:
            series = run.recording[signal]
            values = _size(series.values) if component is None else series.column(component)
            t, y = thinned(series.time + run.shift, values * scale)
            lines.append(Line(run.name, t, y, f"run{k}", len(panels) - 1))
    text = (
        "In flight the commands of the controller depend on the gimbal's response, so step and "
        "frequency figures need a test of the gimbal alone (twin step)."
    )
    caption = "Position of the gimbal pivot relative to the start; times are experiment times."
    plot = Plot("flight", caption, "time [s]", tuple(panels), tuple(lines), panel_height=210)
    table = _table([f for *_, f in flights])
    return Section("flight", "Flight", (), (plot, table, Table((), (), text)))


def _table(flights: Sequence[Flown]) -> Table:
    rows: tuple[tuple[Cell | str, ...], ...] = tuple(
        (name, *(Cell(f"{number(getattr(f, field), 3)}{unit}", "number") for f in flights))
        for name, field, unit in ROWS
    )
    return Table(("figure", *(f.name for f in flights)), rows)


def _size(values: Array) -> Array:
    return np.array(np.linalg.norm(values, axis=1))


SHOWN: tuple[tuple[str, str, str, str | None, float], ...] = (
    ("speed", "speed [m/s]", "vehicle/velocity", None, 1.0),
    ("attitude error about x", "error [°]", "control/error", "x", 180.0 / np.pi),
    ("attitude error about y", "error [°]", "control/error", "y", 180.0 / np.pi),
    ("angle of attack", "angle [°]", "vehicle/angle_of_attack", "angle", 180.0 / np.pi),
    ("thrust", "thrust [N]", "vehicle/thrust", "thrust", 1.0),
)
ROWS = (
    ("apogee", "apogee", " m"),
    ("time of the apogee", "apogee_time", " s"),
    ("largest speed up to the apogee", "speed", " m/s"),
    ("burnout", "burnout", " s"),
    ("attitude error under power, rms", "error_deg", "°"),
    ("largest angle of attack above 10 m/s", "attack_deg", "°"),
    ("gimbal command at its limit, of the powered time", "saturation", " %"),
    ("end of the flight", "duration", " s"),
    ("downrange of the end", "downrange", " m"),
)
