"""Blueprint of a recording: views of the signals that were recorded."""

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import rerun.blueprint as rrb
from rerun.encodings import EntityPathLike

from analysis import schema
from twin.recorder import style
from twin.recorder.layout import display, plots, states
from twin.recorder.scene import ghost
from twin.recorder.scene.poses import GIMBAL_PREFIX, VEHICLE, Focus, Poses, focus_path

SKY = (58, 68, 84)  # the black motor must stand out
# Viewing direction, from 1.5 times the radius of the focus, which is also Rerun's default.
LOOK = (0.55, 0.75, -0.25)
MOST_PLOTS = 4  # in a tab

_ANGLES = (
    "gimbal/command",
    "gimbal/measured",
    "gimbal/reference",
    "gimbal/simulated",
    "gimbal/other",
)
_ATTITUDE = ("control/setpoint", "vehicle/tilt")
_RATES = ("gimbal/rate/measured", "gimbal/rate/simulated")
# Further tabs: title, and its plots with their title and signals.
_TABS: tuple[tuple[str, tuple[tuple[str, tuple[str, ...]], ...]], ...] = (
    (
        "Flight",
        (
            ("Position", ("vehicle/position",)),
            ("Velocity", ("vehicle/velocity",)),
            ("Wind", ("vehicle/wind",)),
        ),
    ),
    (
        "Motion",
        (
            ("Body rate", ("vehicle/rate",)),
            ("Angle of attack", ("vehicle/angle_of_attack",)),
            ("Airspeed", ("vehicle/airspeed",)),
            ("Thrust", ("vehicle/thrust",)),
        ),
    ),
    (
        "Sensors",
        (
            ("Potentiometers", ("sensors/potentiometer",)),
            ("Gyro", ("sensors/gyro",)),
            ("Accelerometer", ("sensors/accelerometer",)),
            ("Turntable", ("turntable/simulated", "turntable/measured")),
        ),
    ),
    (
        "Rig",
        (
            ("Timing", ("timing/lateness", "timing/sensor_age", "timing/round_trip")),
            ("Link", ("link/lost", "link/crc_errors")),
            ("Pulse width", ("sensors/pulse",)),
            ("Base gyro", ("sensors/base_gyro",)),
        ),
    ),
    (
        "Rates",
        (("Servo angle", ("linkage/servo",)), ("Loop closure", ("linkage/closure",))),
    ),
)


@dataclass(frozen=True)
class Content:
    """What a recording holds.

    Attributes
    ----------
    signals : names of the recorded signals
    poses : of the 3D scene, None without one
    residual : entity of measured minus simulated angle, None without one
    lanes : whether there are states besides the health
    known : ranges of the values, once they are known
    profile : altitude over downrange, None where nothing flies
    live : open at the newest data instead of paused at the start
    """

    signals: Sequence[str]
    poses: Poses | None = None
    residual: str | None = None
    lanes: bool = False
    known: plots.Known = field(default_factory=plots.Known)
    profile: rrb.Spatial2DView | None = None
    live: bool = False


def build(content: Content, *, brief: bool = False) -> rrb.Blueprint:
    """Return the blueprint of a recording; a brief one has the first tab only.

    A layout of all tabs takes 0.5 MB of the file.
    """
    body: rrb.View | rrb.Container = _left(content)
    # there may be signals without plots only
    if tabs := list(itertools.islice(_tabs(content), 1 if brief else None)):
        body = rrb.Horizontal(body, rrb.Tabs(*tabs, active_tab=0), column_shares=[9, 11])
    return plots.Layout(
        body,
        rrb.TimePanel(
            state="collapsed",
            timeline=schema.TIME,
            play_state="following" if content.live else "paused",
        ),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        span=content.known.span,
    )


def _tabs(content: Content) -> Iterator[rrb.View | rrb.Container]:
    for title, views in _titled(content):
        if views:
            yield rrb.Vertical(*views, name=title, row_shares=[_share(v) for v in views])


def _titled(content: Content) -> Iterator[tuple[str, list[rrb.View]]]:
    has = set(content.signals)
    main, attitude = _main(content), ("Attitude", _overlays("Attitude", _ATTITUDE, content))
    yield main
    if main[1]:  # the flight itself comes first where nothing is steered
        yield attitude
    for title, rows in _TABS:
        views: list[rrb.View] = []
        if title == "Flight" and content.profile is not None:
            views.append(content.profile)
        elif title == "Rates":
            views += _overlays("Gimbal rate", _RATES, content)
        for name, members in rows:
            there = [m for m in members if m in has]
            if any(content.known.moved(schema.SIGNALS[m].entity) for m in there):
                views.append(plots.all_components(name, there, content.known))
        yield title, views
        if title == "Flight" and not main[1]:
            yield attitude
    estimates = [s for s in content.signals if s.startswith("shadow/estimate/")]
    for first in range(0, len(estimates), MOST_PLOTS):
        some = estimates[first : first + MOST_PLOTS]
        number = f" {first // MOST_PLOTS + 1}" if len(estimates) > MOST_PLOTS else ""
        yield (
            f"Estimates{number}",
            [plots.all_components(style.last(s), [s], content.known) for s in some],
        )


def _share(view: rrb.View) -> float:
    """Height of a plot in its tab; a path, and angles above a residual, need more."""
    return 1.6 if isinstance(view, rrb.Spatial2DView) else 1.0 if view.titlebar else 0.55


def _main(content: Content) -> tuple[str, list[rrb.View]]:
    """The angles with what they differ by: residual, control error or difference."""
    views: list[rrb.View] = list(_overlays("Gimbal", _ANGLES, content))
    if views and content.residual:
        beneath = [plots.residual(content.residual, axis, content.known) for axis in (0, 1)]
        views = [v for axis in (0, 1) for v in (*views[axis : axis + 1], beneath[axis])]
        return "Gimbal", views
    for title, name in (("Control error", "control/error"), ("Difference", "gimbal/difference")):
        if name in content.signals:
            views.append(plots.all_components(title, [name], content.known))
    return "Gimbal", views


def _overlays(title: str, members: Sequence[str], content: Content) -> list[rrb.View]:
    there = [m for m in members if m in content.signals]
    return [plots.overlay(title, there, axis, content.known) for axis in (0, 1)] if there else []


def _left(content: Content) -> rrb.Container:
    parts: list[rrb.View | rrb.Container] = []
    if content.poses is not None:
        parts.append(_scenes(content.poses))
    if content.lanes:
        parts.append(rrb.StateTimelineView(name="States", contents=[f"{states.STATES}/**"]))
    events = rrb.TextDocumentView(name="Events", contents=[display.EVENTS])
    parts.append(rrb.Tabs(events, _log(), active_tab=0))
    shares = {1: [1], 2: [5, 2], 3: [8, 6, 5]}[len(parts)]
    return rrb.Vertical(*parts, row_shares=shares)


def _scenes(poses: Poses) -> rrb.View | rrb.Container:
    focus = {body.name: body for body in poses.focus.values()}
    vehicle = focus.pop(VEHICLE, None)
    near = [_gimbal(poses, body) for body in focus.values()]
    if vehicle is not None:
        return rrb.Horizontal(_scene("Vehicle", vehicle), *near)
    whole = _scene("Scene", next(iter(focus.values()), None))
    return rrb.Tabs(*near, whole, active_tab=0) if near else whole


def _gimbal(poses: Poses, follows: Focus) -> rrb.Spatial3DView:
    """The gimbal from near, without tube and rig, with the commanded attitude and the axes."""
    inner = [b.name for b in (*poses.moving, *poses.fixed) if b.name.startswith(GIMBAL_PREFIX)]
    contents = [f"{schema.WORLD}/{name}" for name in inner]
    contents += [ghost.GHOST, f"{ghost.AXES}/**", f"{schema.WORLD}/thrust"]
    return _view("Gimbal", contents, follows)


def _scene(title: str, follows: Focus | None) -> rrb.Spatial3DView:
    """All bodies, with the trail up to the present time."""
    contents = ["$origin/**", f"- {ghost.GHOST}", f"- {ghost.AXES}/**"]
    history = rrb.VisibleTimeRanges(
        timeline=schema.TIME,
        start=rrb.TimeRangeBoundary.infinite(),
        end=rrb.TimeRangeBoundary.cursor_relative(nanos=0),
    )
    return _view(title, contents, follows, {f"{schema.WORLD}/trail": history})


def _view(
    title: str,
    contents: Sequence[str],
    follows: Focus | None,
    overrides: Mapping[EntityPathLike, rrb.VisibleTimeRanges] | None = None,
) -> rrb.Spatial3DView:
    """3D view that follows one body."""
    controls = None
    if follows is not None:
        distance = 1.5 * follows.size
        controls = rrb.EyeControls3D(
            kind=rrb.Eye3DKind.Orbital,
            position=-distance * np.array(LOOK) / np.linalg.norm(LOOK),
            look_target=(0.0, 0.0, 0.0),
            eye_up=(0.0, 0.0, 1.0),
            tracking_entity=focus_path(follows.name),
        )
        contents = [*contents, focus_path(follows.name)]
    return rrb.Spatial3DView(
        name=title,
        origin=schema.WORLD,
        contents=contents,
        background=SKY,
        line_grid=rrb.LineGrid3D(visible=False),
        eye_controls=controls,
        overrides=overrides,
    )


def _log() -> rrb.TextLogView:
    kind = rrb.encodings.TextLogColumnKind
    return rrb.TextLogView(
        name="Log",
        contents=[schema.EVENTS, schema.HEALTH],
        columns=rrb.TextLogColumns(text_log_columns=[kind.LogLevel, kind.Body]),
    )
