"""Trajectory, speed, attitude and thrust of every flight, and its figures."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from analysis.array import Array
from analysis.flown import FIGURES, Flown, attack, path
from analysis.recording.measurements import Measurement
from analysis.report.numbers import ReportNumbers
from analysis.report.parts import Cell, Line, Panel, Plot, Section, Table, thinned
from analysis.report.words import number

Drawn = list[Line]
TEXTS = (("end", "ended"), ("wind", "wind"), ("missed because", "missed"))
SIGNALS = (  # title, label, signal, column or all, scale
    ("speed", "speed [m/s]", "vehicle/velocity", None, 1.0),
    ("thrust", "thrust [N]", "vehicle/thrust", 0, 1.0),
    ("attitude error about x", "error [°]", "control/error", 0, np.degrees(1.0)),
    ("attitude error about y", "error [°]", "control/error", 1, np.degrees(1.0)),
)
LOOP = (
    "In flight the commands of the controller depend on the gimbal's response, so step and "
    "frequency figures need a test of the gimbal alone (twin step)."
)


TRACK = 1  # place of the ground track among the panels
THINNEST = 0.1  # of the larger extent of the ground track


def flight(runs: Sequence[Measurement], numbers: ReportNumbers) -> Section | None:
    """Path and signals of every flight with a table of its figures; None without one."""
    flights = [(f"run{k}", run, f) for k, (run, f) in _flights(runs, numbers)]
    if not flights:
        return None
    drawn: list[tuple[Panel, Drawn]] = [
        (Panel("height over distance", "height [m]", x_label="distance from the launch [m]"), []),
        (Panel("ground track", "north [m]", x_label="east [m]"), []),
        (Panel("height", "height [m]"), []),
        (Panel("angle of attack, ascent", "angle [°]"), []),
        *((Panel(title, label), []) for title, label, *_ in SIGNALS),
    ]
    for role, run, f in flights:
        lines = _lines(role, run, f)
        for (_, into), more in zip(drawn, lines, strict=True):
            into += more
    drawn[TRACK] = (_ground(*drawn[TRACK]), drawn[TRACK][1])
    drawn = [pair for pair in drawn if pair[1]]
    panels = tuple(replace(p, row=k // 2, column=k % 2) for k, (p, _) in enumerate(drawn))
    placed = tuple(replace(x, panel=k) for k, (_, lines) in enumerate(drawn) for x in lines)
    caption = (
        "Position of the gimbal pivot, of a vehicle without a gimbal of its origin, relative to the"
        " launch point; times are experiment times. Angle of attack: off the rail, up to the"
        " apogee, from a third of its largest airspeed on."
    )
    height = 210 if len(panels) <= 6 else 180  # four rows with the table on two A4 pages
    plot = Plot("flight", caption, "time [s]", panels, placed, panel_height=height)
    parts: list[Plot | Table] = [plot, _table([(run.name, f) for _, run, f in flights])]
    if notes := tuple((run.name, note) for _, run, f in flights for note in f.notes):
        parts.append(Table(("flight", "note"), notes))
    if not all(run.recording.passive for _, run, _ in flights):
        parts.append(Table((), (), LOOP))
    return Section("flight", "Flight", (), tuple(parts))


def _ground(panel: Panel, lines: Drawn) -> Panel:
    """The ground track with neither axis narrower than a tenth of the other: centimetres would."""
    x, y = (np.concatenate([np.asarray(getattr(line, c)) for line in lines]) for c in "xy")
    spans = [(float(np.nanmin(v)), float(np.nanmax(v))) for v in (x, y)]
    least = THINNEST * max(high - low for low, high in spans)
    wide = [
        (0.5 * (low + high - least), 0.5 * (low + high + least)) if high - low < least else None
        for low, high in spans
    ]
    return replace(panel, x_range=wide[0], y_range=wide[1])


def _flights(
    runs: Sequence[Measurement], numbers: ReportNumbers
) -> Iterator[tuple[int, tuple[Measurement, Flown]]]:
    for k, (run, entry) in enumerate(zip(runs, numbers.runs, strict=True)):
        if entry.flight is not None:
            yield k, (run, entry.flight)


def _lines(role: str, run: Measurement, f: Flown) -> list[Drawn]:
    """Lines of one flight, a list a panel."""
    time, way = path(run.recording)
    way = np.round(way, 2)
    across = np.hypot(way[:, 0], way[:, 1])
    paths = [(across, way[:, 2]), (way[:, 0], way[:, 1])]
    found = [[Line(run.name, *thinned(*path), role)] for path in paths]
    if f.target is not None:
        east, north, up = f.target
        name = f"target of {run.name}"
        for lines, x, y in zip(found, (np.hypot(east, north), east), (up, north), strict=True):
            lines.append(Line(name, np.array([x]), np.array([y]), role, style="rings"))
    found.append([Line(run.name, *thinned(time + run.shift, way[:, 2]), role)])
    found.append(_over_time(run, role, *attack(run.recording, f.numbers)))
    for _, _, signal, column, scale in SIGNALS:
        series = run.recording.series.get(signal)
        if series is None or (signal == "control/error" and run.recording.passive):
            found.append([])
            continue
        values = series.values
        size = np.linalg.norm(values, axis=1) if column is None else values[:, column]
        found.append([Line(run.name, *thinned(series.time + run.shift, size * scale), role)])
    return found


def _over_time(run: Measurement, role: str, time: Array, angle: Array) -> Drawn:
    x, y = thinned(time + run.shift, np.degrees(angle))
    return [Line(run.name, x, y, role)] if len(x) else []


def _table(flights: Sequence[tuple[str, Flown]]) -> Table:
    """One row a figure that any of them has; of two flights their difference too."""
    rows: list[tuple[Cell | str, ...]] = []
    two = len(flights) == 2
    for name, key, unit, scale in FIGURES:
        values = [f.numbers.get(key) for _, f in flights]
        if all(v is None for v in values):
            continue
        cells = ["–" if v is None else f"{number(v * scale, 4)}{unit}" for v in values]
        if two:
            known = [v for v in values if v is not None]
            apart = f"{number((known[1] - known[0]) * scale, 3)}{unit}" if known[1:] else "–"
            cells.append(apart)
        rows.append((name, *(Cell(c, "number") for c in cells)))
    targets = [_place(f.target) for _, f in flights]
    texts = [(name, [f.texts.get(key, "–") for _, f in flights]) for name, key in TEXTS]
    for name, cells in (("target, east, north, up", targets), *texts):
        if any(c != "–" for c in cells):
            rows.append((name, *cells, *([""] if two else [])))
    head = ("figure", *(name for name, _ in flights), *(["difference"] if two else []))
    return Table(head, tuple(rows))


def _place(target: tuple[float, float, float] | None) -> str:
    return "–" if target is None else f"{', '.join(number(c, 4) for c in target)} m"
