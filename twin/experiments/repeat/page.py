"""Repeated flights as a page: their spread, and how the models differ from the rig."""

import math
from typing import TYPE_CHECKING

import numpy as np

from analysis.report import Cell, Line, Panel, Plot, Section, Table
from analysis.report.parts import Style

if TYPE_CHECKING:
    from analysis.timing import Verdict
    from twin.experiments.repeat.result import RepeatResult

_SHOWN = 30  # flights plotted per gimbal; more cannot be distinguished


def sections(result: "RepeatResult") -> tuple[Section, ...]:
    """Sections of the page."""
    parts = [_paths(result), _numbers(result)]
    if any(r.fault for seat in result.seats for r in seat.results):
        parts.append(_faults(result))
    if result.differences:
        parts.append(_differences(result))
    return tuple(parts)


def _paths(result: "RepeatResult") -> Section:
    lines: list[Line] = []
    for k, seat in enumerate(result.seats):
        for j, path in enumerate(seat.paths[:_SHOWN]):
            n, role = path.steered, f"run{k}"
            style: Style = "thin" if j else "line"  # the legend takes the line
            tilt = np.degrees(np.arccos(np.clip(path.nose[:n, 2], -1.0, 1.0)))
            lines.append(Line(seat.gimbal, path.time[:n], path.position[:n, 2], role, 0, style))
            lines.append(Line(seat.gimbal, path.time[:n], tilt, role, 1, style))
        if seat.spread is not None and not seat.repeats:
            s = seat.spread
            lines.append(Line(seat.gimbal, s.time, np.maximum(s.distance, 1e-6), f"run{k}", 2))
    panels = (
        Panel("Height", "m", 0),
        Panel("Nose from the vertical", "°", 1),
        Panel("Distance from the mean path, standard deviation of the flights", "m", 2, y_log=True),
    )
    caption = (
        "Every flight under power, a colour for each gimbal. Where a gimbal's flights are equal to"
        " the last bit, two were flown and they have no distance."
    )
    return Section(
        "paths", "Flights", (), (Plot("paths", caption, "time [s]", panels, tuple(lines)),)
    )


def _numbers(result: "RepeatResult") -> Section:
    rows = []
    for seat in result.seats:
        if (s := seat.spread) is not None and not seat.repeats:
            scatter = (
                ("path from the mean, deviation at the end", float(s.distance[-1]), "m"),
                ("path from the mean, worst", s.worst, "m"),
                ("nose from the mean, deviation", math.degrees(s.attitude), "°"),
            )
            rows += [_row(seat.gimbal, name, value, unit, s.n) for name, value, unit in scatter]
        for f in seat.figures:
            scale, unit = (180.0 / math.pi, "°") if f.unit == "rad" else (1.0, f.unit)
            low, high = (scale * v for v in f.interval)
            name = f.name.replace("_", " ")
            rows.append(_row(seat.gimbal, name, scale * f.value, unit, f.n, low, high))
    head = ("gimbal", "figure", "value", "unit", "n", "95 % interval")
    caption = (
        "Over the flights of each gimbal, each with the next seed. Overshoot, settling (2 %) and"
        " rise are those of the nose after one step of the setpoint."
    )
    return Section("numbers", "Repeatability", (), (Table(head, tuple(rows), caption),))


def _row(
    gimbal: str, name: str, value: float, unit: str, n: int,
    low: float = math.nan, high: float = math.nan,
) -> tuple[Cell | str, ...]:  # fmt: skip
    interval = f"{low:.3g} to {high:.3g}" if math.isfinite(low) else "–"
    shown = f"{value:.3g}" if math.isfinite(value) else "not reached"
    return (gimbal, name, Cell(shown, "number"), unit, Cell(str(n), "number"), interval)


def _faults(result: "RepeatResult") -> Section:
    rows = tuple(
        (seat.gimbal, Cell(str(k + 1), "number"), r.fault)
        for seat in result.seats
        for k, r in enumerate(seat.results)
        if r.fault is not None
    )
    caption = "First fault of each of these flights; they are not part of the figures above."
    table = Table(("gimbal", "flight", "fault"), rows, caption)
    return Section("faults", "Flights with a fault", (), (table,))


def _differences(result: "RepeatResult") -> Section:
    rows = tuple(
        (
            name,
            Cell(f"{math.degrees(d.attitude_rms):.2f}", "number"),
            Cell(f"{math.degrees(d.attitude_worst):.2f}", "number"),
            Cell(f"{d.path_worst:.2f}", "number"),
            Cell(f"{100.0 * d.share:.2f}", "number"),
        )
        for name, d in result.differences.items()
    )
    first = result.seats[0].gimbal
    head = ("model", "nose, rms [°]", "worst [°]", "path, worst [m]", "of the way [%]")
    caption = f"First flight with {first} against that with each model, under power."
    made_of = (
        "The difference is due to what the models leave out: a transfer function has the mean"
        " effect of dead band, backlash and the wait for a pulse frame only; the linkage has"
        " nominal servos, not those of this rig."
    )
    texts = (made_of, *_timing(result.seats[0].results[0].timing))
    return Section("differences", "Rig against models", texts, (Table(head, rows, caption),))


def _timing(timing: "Verdict | None") -> tuple[str, ...]:
    """The share of real time in the difference."""
    if timing is None or timing.moved is None:
        return ()
    by = timing.moved
    text = (
        f"In the rig's first flight real time moved the path by {by.timing.position:.2f} m and the"
        f" time step by {by.step.position:.2f} m: {timing.text()}."
    )
    return (text,)
