"""Several recordings in one, for one view: every signal overlaid, each run from its time zero."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import NDArray

from analysis import schema
from analysis.recording import Recording, read
from twin.recorder import columns, lifetime, style
from twin.recorder.layout import plots

Stamps = NDArray[np.int64]

# Tabs: title, and its plots: title, signals, component.
_GIMBAL = ("gimbal/command", "gimbal/measured", "gimbal/simulated")
_TILT = ("control/setpoint", "vehicle/tilt")
_RATE = ("gimbal/rate/measured", "gimbal/rate/simulated")
_TABS: tuple[tuple[str, tuple[tuple[str, tuple[str, ...], int], ...]], ...] = (
    ("Gimbal", (("Gimbal x", _GIMBAL, 0), ("Gimbal y", _GIMBAL, 1))),
    ("Attitude", (("Attitude x", _TILT, 0), ("Attitude y", _TILT, 1))),
    ("Flight", tuple((n, ("vehicle/position",), k) for k, n in enumerate(("East", "North", "Up")))),
    (
        "Motion",
        (
            ("Airspeed", ("vehicle/airspeed",), 0),
            ("Angle of attack", ("vehicle/angle_of_attack",), 0),
            ("Thrust", ("vehicle/thrust",), 0),
        ),
    ),
    ("Rates", (("Gimbal rate x", _RATE, 0), ("Gimbal rate y", _RATE, 1))),
)
_RUNS: tuple[style.Color, ...] = (
    style.SIMULATED, style.MEASURED, style.BAND, style.RESIDUAL, (200, 180, 60), (180, 120, 220)
)  # fmt: skip
# Colour of what a run has besides its main line: share of the run's colour, the rest of another.
_PALE, _DARK = (0.4, style.COMMAND), (0.55, (20, 20, 20))


def write(paths: Sequence[Path], out: Path) -> None:
    """Write the signals of all recordings into one file.

    Raises
    ------
    AnalysisError : a recording cannot be read
    """
    runs = {_label(paths, k): read(path) for k, path in enumerate(paths)}
    stream = rr.RecordingStream(schema.APPLICATION, recording_id="together", send_properties=False)
    stamps = [run[name].known().time_ns[[0, -1]] for run in runs.values() for name in _shown(run)]
    span = (int(np.min(stamps)), int(np.max(stamps))) if stamps else None
    lifetime.begin(stream, [rr.FileSink(out)], _layout(runs, span))
    stream.send_recording_name(", ".join(runs))
    for label, run in runs.items():
        for name in _shown(run):
            series = run[name].known()
            values = schema.SIGNALS[name].to_stored(series.values)
            stream.send_columns(
                _entity(label, name), _times(series.time_ns), columns.scalars(values)
            )
    if span:
        zeros = columns.scalars(np.zeros((2, 1)))
        stream.send_columns(plots.SPAN, _times(np.array(span)), zeros)
    stream.disconnect()


def _times(stamps: Stamps) -> list[rr.TimeColumn]:
    return [rr.TimeColumn(schema.TIME, duration=stamps.astype("timedelta64[ns]"))]


def _label(paths: Sequence[Path], k: int) -> str:
    """File name, with a number where two are alike."""
    stems = [path.stem for path in paths]
    return stems[k] if stems.count(stems[k]) == 1 else f"{stems[k]} {k + 1}"


def _shown(run: Recording) -> list[str]:
    wanted = {s for _, rows in _TABS for _, names, _ in rows for s in names}
    if run.passive:
        wanted = {name for name in wanted if not name.startswith(("gimbal/", "control/"))}
    return [name for name in sorted(wanted) if name in run.series and run[name].known().time.size]


def _entity(label: str, name: str) -> str:
    return "/" + "/".join(rr.escape_entity_path_part(p) for p in (label, *name.split("/")))


def _layout(runs: dict[str, Recording], span: tuple[int, int] | None) -> rrb.Blueprint:
    tabs = []
    for title, rows in _TABS:
        views = [view for row in rows if (view := _plot(runs, *row)) is not None]
        if views:
            tabs.append(rrb.Vertical(*views, name=title))
    return plots.Layout(
        rrb.Tabs(*tabs, active_tab=0) if tabs else rrb.TextLogView(name="Nothing in common"),
        rrb.TimePanel(state="collapsed", timeline=schema.TIME, play_state="paused"),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        span=span,
    )


def _line(label: str, color: style.Color, name: str, run: Recording, component: int) -> style.Lines:
    """One component in its run's colour, paler for a command, darker for a model beside a rig."""
    what, count, width = style.last(name), len(schema.SIGNALS[name].components), 2.0
    if what in ("command", "setpoint"):
        color, width = _mixed(color, *_PALE), 1.0
    elif what == "simulated" and name.replace("simulated", "measured") in _shown(run):
        color = _mixed(color, *_DARK)
    widths = [width * (c == component) for c in range(count)]
    return style.Lines([f"{label}: {what}"] * count, [color] * count, widths)


def _mixed(color: style.Color, share: float, other: style.Color) -> style.Color:
    r, g, b = (round(share * c + (1.0 - share) * o) for c, o in zip(color, other, strict=True))
    return r, g, b


def _plot(
    runs: dict[str, Recording], title: str, names: Sequence[str], component: int
) -> rrb.TimeSeriesView | None:
    styles, ranges = {}, {}
    for k, (label, run) in enumerate(runs.items()):
        for name in _shown(run):
            if name not in names:
                continue
            entity, signal = _entity(label, name), schema.SIGNALS[name]
            styles[entity] = _line(label, _RUNS[k % len(_RUNS)], name, run, component)
            values = signal.to_stored(run[name].values)
            ranges[entity] = list(zip(np.nanmin(values, 0), np.nanmax(values, 0), strict=True))
    if not styles:
        return None
    unit = schema.SIGNALS[names[0]].stored_unit
    return plots.several(f"{title} [{unit}]", styles, component, plots.Known(ranges))
