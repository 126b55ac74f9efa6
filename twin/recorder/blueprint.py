"""Blueprint of a recording: views of the signals that were recorded."""

from collections.abc import Sequence

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from analysis import schema
from twin.recorder.poses import FOCUS_RADII, SIMULATED_COLOR, VEHICLE, Poses, focus_path
from twin.recorder.scene import BodyMesh

SKY = (24, 30, 40)
# Viewing direction, from 1.5 times the radius of the focus, which is also Rerun's default.
LOOK = (0.55, 0.75, -0.25)

COMMAND = (150, 150, 150)
MEASURED = (255, 140, 30)
FOLLOWED = (130, 200, 130)
X, Y, Z, W = (230, 80, 80), (90, 190, 90), (80, 130, 240), (180, 120, 220)

# One colour per meaning: commanded, simulated, measured.
_MEANING = {
    "gimbal/command": COMMAND,
    "gimbal/simulated": SIMULATED_COLOR,
    "gimbal/measured": MEASURED,
    "gimbal/reference": MEASURED,
    "gimbal/other": SIMULATED_COLOR,
    "gimbal/followed": FOLLOWED,
    "gimbal/rate/followed": FOLLOWED,
    "gimbal/rate/simulated": SIMULATED_COLOR,
    "gimbal/rate/measured": MEASURED,
    "turntable/simulated": SIMULATED_COLOR,
    "turntable/measured": MEASURED,
    "control/setpoint": COMMAND,
    "vehicle/tilt": SIMULATED_COLOR,
}
_BY_COMPONENT = {"x": X, "y": Y, "z": Z, "w": W}
_CYCLE = (X, Y, Z, W, (200, 180, 60), (80, 190, 200))

# Overlays, one plot per axis: title, signals.
_PER_AXIS = (
    (
        "Gimbal",
        (
            "gimbal/command",
            "gimbal/simulated",
            "gimbal/measured",
            "gimbal/other",
            "gimbal/reference",
        ),
    ),
    ("Attitude", ("control/setpoint", "vehicle/tilt")),
    ("Gimbal rate", ("gimbal/rate/simulated", "gimbal/rate/measured")),
)
_GROUPS = (
    ("Control error", ("control/error",)),
    ("Difference", ("gimbal/difference",)),
    ("Followed angle", ("gimbal/followed",)),
    ("Followed rate", ("gimbal/rate/followed",)),
    ("Turntable", ("turntable/simulated", "turntable/measured")),
    ("Angle of attack", ("vehicle/angle_of_attack",)),
    ("Airspeed", ("vehicle/airspeed",)),
    ("Position", ("vehicle/position",)),
    ("Velocity", ("vehicle/velocity",)),
    ("Body rate", ("vehicle/rate",)),
    ("Thrust", ("vehicle/thrust",)),
    ("Mass", ("vehicle/mass",)),
    ("Timing", ("timing/lateness", "timing/sensor_age", "timing/round_trip")),
    ("Link", ("link/lost", "link/crc_errors", "link/connected")),
    ("Potentiometers", ("sensors/potentiometer",)),
    ("Gyro", ("sensors/gyro",)),
    ("Accelerometer", ("sensors/accelerometer",)),
    ("Base gyro", ("sensors/base_gyro",)),
    ("Pulse width", ("sensors/pulse",)),
    ("Loop closure", ("linkage/closure",)),
    ("Servo angle", ("linkage/servo",)),
)
_TABS = (
    (
        "Vehicle",
        ("Airspeed", "Angle of attack", "Position", "Velocity", "Body rate", "Thrust", "Mass"),
    ),
    ("Sensors", ("Potentiometers", "Gyro", "Accelerometer", "Base gyro", "Pulse width")),
    ("Linkage", ("Servo angle", "Loop closure")),
    ("Followed", ("Followed angle", "Followed rate")),
    ("Timing", ("Timing", "Link")),
)


def style(name: str) -> rr.SeriesLines:
    """Colours and legend of one signal's lines."""
    signal = schema.SIGNALS[name]
    last = name.rsplit("/", 1)[-1]
    single = len(signal.components) == 1
    if name in _MEANING:
        colors = [_MEANING[name]] * len(signal.components)
    else:
        colors = [
            _BY_COMPONENT.get(c, _CYCLE[k % len(_CYCLE)]) for k, c in enumerate(signal.components)
        ]
    names = [last.replace("_", " ") if single else f"{last} {c}" for c in signal.components]
    return rr.SeriesLines(colors=colors, names=names, widths=[1.5] * len(colors))


def build(names: Sequence[str], poses: Poses | None, *, live: bool = False) -> rrb.Blueprint:
    """Return the blueprint for the recorded signals and, if there is one, the 3D scene.

    It opens paused at the start; with `live` it follows the newest data.
    """
    recorded = set(names)
    plots = {title: _plot(title, members) for title, members in _present(_GROUPS, recorded)}
    main = [
        _axis(title, members, axis)
        for title, members in _present(_PER_AXIS[:1], recorded)
        for axis in (0, 1)
    ]
    main += [plots[title] for title in ("Control error", "Difference") if title in plots]
    tabs = [rrb.Vertical(*main, name="Gimbal")] if main else []
    attitude = [
        _axis(title, members, axis)
        for title, members in _present(_PER_AXIS[1:], recorded)
        for axis in (0, 1)
    ]
    attitude += [plots["Turntable"]] if "Turntable" in plots else []
    if attitude:
        tabs.append(rrb.Vertical(*attitude, name="Attitude"))
    for tab, titles in _TABS:
        if views := [plots[title] for title in titles if title in plots]:
            tabs.append(rrb.Vertical(*views, name=tab))
    body = _left(poses)
    if tabs:  # a run may record signals without plots only
        body = rrb.Horizontal(body, rrb.Tabs(*tabs, active_tab=0), column_shares=[1, 1])
    return rrb.Blueprint(
        body,
        rrb.TimePanel(
            state="collapsed",
            timeline=schema.TIME,
            play_state="following" if live else "paused",
        ),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        auto_views=False,
        auto_layout=False,
    )


def _left(poses: Poses | None) -> rrb.View | rrb.Container:
    if poses is None:
        return _log()
    first, *others = _scenes(poses)
    below = rrb.Horizontal(*others, _log()) if others else _log()
    return rrb.Vertical(first, below, row_shares=[5, 2])


def _present(
    table: Sequence[tuple[str, tuple[str, ...]]], recorded: set[str]
) -> list[tuple[str, list[str]]]:
    present = ((title, [m for m in members if m in recorded]) for title, members in table)
    return [(title, members) for title, members in present if members]


def _plot(title: str, members: Sequence[str]) -> rrb.TimeSeriesView:
    unit = schema.SIGNALS[members[0]].stored_unit
    return rrb.TimeSeriesView(
        name=title if unit == "1" else f"{title} [{unit}]",
        contents=[schema.SIGNALS[m].entity for m in members],
        plot_legend=rrb.PlotLegend(corner=rrb.Corner2D.RightTop),
        axis_x=rrb.TimeAxis(link=rrb.components.LinkAxis.LinkToGlobal),
    )


def _axis(title: str, members: Sequence[str], axis: int) -> rrb.TimeSeriesView:
    """Overlay one component of several signals."""
    visible = [k == axis for k in range(2)]
    unit = schema.SIGNALS[members[0]].stored_unit
    return rrb.TimeSeriesView(
        name=f"{title} {'xy'[axis]} [{unit}]",
        contents=[schema.SIGNALS[m].entity for m in members],
        overrides={
            schema.SIGNALS[m].entity: rr.SeriesLines.from_fields(
                visible_series=visible
            ).visualizer()
            for m in members
        },
        plot_legend=rrb.PlotLegend(corner=rrb.Corner2D.RightTop),
        axis_x=rrb.TimeAxis(link=rrb.components.LinkAxis.LinkToGlobal),
    )


def _scenes(poses: Poses) -> list[rrb.Spatial3DView]:
    focus = {body.name: body for body in poses.focus.values()}
    if VEHICLE not in focus:
        return [_scene("Scene", next(iter(focus.values()), None))]
    views = [_scene("Vehicle", focus.pop(VEHICLE))]
    inner = [body.name for body in poses.moving if body.name.startswith("gimbal_")]
    return views + [_scene("Gimbal", body, inner) for body in focus.values()]


def _scene(
    title: str, follows: BodyMesh | None, only: Sequence[str] | None = None
) -> rrb.Spatial3DView:
    """3D view that follows one body; of everything, or of the named bodies `only`."""
    contents = ["$origin/**"] if only is None else [f"$origin/{name}" for name in only]
    controls = None
    if follows is not None:
        distance = 1.5 * FOCUS_RADII * follows.radius
        back = -distance * np.array(LOOK) / np.linalg.norm(LOOK)
        contents.append(focus_path(follows.name))
        controls = rrb.EyeControls3D(
            kind=rrb.Eye3DKind.Orbital,
            position=back,
            look_target=(0.0, 0.0, 0.0),
            eye_up=(0.0, 0.0, 1.0),
            tracking_entity=focus_path(follows.name),
        )
    history = rrb.VisibleTimeRanges(
        timeline=schema.TIME,
        start=rrb.TimeRangeBoundary.infinite(),
        end=rrb.TimeRangeBoundary.cursor_relative(nanos=0),
    )
    return rrb.Spatial3DView(
        name=title,
        origin=schema.WORLD,
        contents=contents,
        background=SKY,
        line_grid=rrb.LineGrid3D(visible=False),
        eye_controls=controls,
        overrides={f"{schema.WORLD}/trail": history} if only is None else None,
    )


def _log() -> rrb.TextLogView:
    kind = rrb.encodings.TextLogColumnKind
    return rrb.TextLogView(
        name="Events",
        contents=[schema.EVENTS, schema.HEALTH],
        columns=rrb.TextLogColumns(text_log_columns=[kind.LogLevel, kind.Body]),
    )
