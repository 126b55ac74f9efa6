"""Plots of a recording: signals over time, one component of several signals, and their ranges."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import rerun as rr
import rerun.blueprint as rrb

from analysis import schema
from twin.recorder import style

VIEW = "/view"  # what is recorded for the viewer only
SPAN = f"{VIEW}/span"
STOPS = f"{VIEW}/stops"
RESIDUAL = f"{VIEW}/residual"
NEAR_STOP = 0.3  # of the stop: motion from here on is shown between both stops
MARGIN = 0.08  # of the range of the values, above and below

Range = tuple[float, float]


@dataclass(frozen=True)
class Known:
    """What has been recorded so far; it scales the plots.

    Attributes
    ----------
    ranges : lowest and highest value of every component, by entity, in stored units
    stops : of the gimbal's axes [deg]
    """

    ranges: Mapping[str, Sequence[Range]] = field(default_factory=dict)
    stops: Sequence[Range] = ()


def all_components(title: str, members: Sequence[str], known: Known) -> rrb.TimeSeriesView:
    """Plot of every component of some signals of one unit."""
    unit = schema.SIGNALS[members[0]].stored_unit
    styles = {schema.SIGNALS[m].entity: style.lines(m) for m in members}
    name = title if unit == "1" else f"{title} [{unit}]"
    return _view(name, styles, _range(known, list(styles)))


def overlay(title: str, members: Sequence[str], axis: int, known: Known) -> rrb.TimeSeriesView:
    """One component of several signals, with the stops if the motion comes near them."""
    unit = schema.SIGNALS[members[0]].stored_unit
    entities = [schema.SIGNALS[m].entity for m in members]
    styles = {e: style.one_axis(m, axis) for e, m in zip(entities, members, strict=True)}
    limits = _range(known, entities, axis)
    bands = []
    if members[0].startswith("gimbal/") and unit == "deg":
        bands = [band("angle", axis)]
        if known.stops and (limits is None or _is_near(limits, known.stops[axis])):
            shown = [float(k // 2 == axis) for k in range(4)]
            styles[STOPS] = style.Lines(["stop"] * 4, [style.STOP] * 4, shown)
            low, high = known.stops[axis]
            limits = limits and (1.08 * low, 1.08 * high)
    return _view(f"{title} {'xy'[axis]} [{unit}]", styles, limits, bands)


def several(
    name: str, styles: Mapping[str, style.Lines], component: int, known: Known
) -> rrb.TimeSeriesView:
    """One component of any entities with given styles."""
    return _view(name, styles, _range(known, list(styles), component))


def residual(entity: str, axis: int, known: Known) -> rrb.TimeSeriesView:
    """Measured minus simulated angle of one axis with its band, under the angles."""
    low, high = _range(known, [entity], axis) or (0.0, 0.0)
    most = max(-low, high)
    shown = style.one_axis("gimbal/difference", axis)
    line = replace(shown, names=[f"measured − simulated {'xy'[axis]} [deg]"] * 2)
    limits = (-most, most) if most > 0.0 else None
    name = f"Residual {'xy'[axis]} [deg]"
    return _view(name, {entity: line}, limits, [band("residual", axis)], titled=False)


def band(kind: str, axis: int) -> str:
    """Entity of the band around the angle or around a residual of zero."""
    return f"{VIEW}/band/{kind}/{'xy'[axis]}"


def band_style() -> rr.Measurements:
    """Colour and legend of a band, without a line in its middle."""
    return rr.Measurements.from_fields(colors=[style.BAND], names=["95 % band"], widths=[0.0])


def _range(known: Known, entities: Sequence[str], axis: int | None = None) -> Range | None:
    """Values of one component or all components of some entities, with a margin."""
    rows = [known.ranges[e] for e in entities if e in known.ranges]
    chosen = [r for row in rows for r in (row if axis is None else row[axis : axis + 1])]
    all_of = [r for r in chosen if all(map(math.isfinite, r))]
    if not all_of:
        return None
    low, high = min(r[0] for r in all_of), max(r[1] for r in all_of)
    margin = MARGIN * max(high - low, 1e-3)
    return low - margin, high + margin


def _is_near(limits: Range, stops: Range) -> bool:
    return limits[1] > NEAR_STOP * stops[1] or limits[0] < NEAR_STOP * stops[0]


def _view(
    name: str,
    styles: Mapping[str, style.Lines],
    limits: Range | None = None,
    bands: Sequence[str] = (),
    *,
    titled: bool = True,
) -> rrb.TimeSeriesView:
    """Plot on the whole time span of the run, which an invisible line at zero gives every plot."""
    first = next(iter(styles.values()))
    span = {SPAN: style.Lines(first.names[:1], first.colors[:1], [0.0])}
    given = {**(span if limits else {}), **styles}  # its value would stretch an unscaled plot
    return rrb.TimeSeriesView(
        name=name,
        titlebar=titled,
        contents=[*given, *bands],
        overrides={
            **{entity: lines.archetype().visualizer() for entity, lines in given.items()},
            **{entity: band_style().visualizer() for entity in bands},
        },
        plot_legend=rrb.PlotLegend(corner=rrb.Corner2D.RightTop),
        axis_x=rrb.TimeAxis(link=rrb.components.LinkAxis.LinkToGlobal),
        axis_y=None if limits is None else rrb.ScalarAxis(range=limits),
    )
