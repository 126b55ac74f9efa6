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
PULSE = "/sensors/pulse"  # of x, y and, where there is one, the turntable
NEAR_STOP = 0.3  # of the stop: motion from here on is shown between both stops
# Rerun 0.41's own id of what linked time axes share, as a zoom stores it in the layout.
SHARED = "view/5c0dca6a-e63f-9cf7-f657-2602590474cc/TimeAxis"
LEGEND = 0.25  # of the run, to the right of its end, for the legends
MARGIN = 0.08  # of the range of the values, above and below
MOST_LABELS = 7.0  # steps between labels that fit into a plot of 140 pixels
LABEL_ROOM, LEAST_USED = 0.02, 0.6  # of a step; of the height of a plot

Range = tuple[float, float]


@dataclass(frozen=True)
class Known:
    """What has been recorded so far; it scales the plots.

    Attributes
    ----------
    ranges : lowest and highest value of every component, by entity, in stored units
    stops : of the gimbal's axes [deg]
    span : start and end of the run [ns]
    middle : signal in the middle of the band around the angle; empty without
    """

    ranges: Mapping[str, Sequence[Range]] = field(default_factory=dict)
    stops: Sequence[Range] = ()
    span: tuple[int, int] | None = None
    middle: str = ""

    def moved(self, entity: str) -> bool:
        """Whether an entity has other values than zero, or may yet have them."""
        ranges = self.ranges.get(entity)
        return ranges is None or any(low != 0.0 or high != 0.0 for low, high in ranges)


class Layout(rrb.Blueprint):
    """Layout whose plots begin with room for their legends after the end of the run.

    Parameters
    ----------
    span : start and end of the run [ns]; None leaves the range to Rerun
    """

    def __init__(self, *parts: rrb.api.BlueprintPart, span: tuple[int, int] | None = None) -> None:
        super().__init__(*parts, auto_views=False, auto_layout=False)
        self._span = span

    def _log_to_stream(self, stream: rr.RecordingStream) -> None:
        super()._log_to_stream(stream)
        if self._span is not None:
            start, end = self._span
            ends = (start, end + round(LEGEND * (end - start)))
            low, high = (rr.TimeRangeBoundary.absolute(seconds=e * 1e-9) for e in ends)
            stream.log(SHARED, rrb.TimeAxis(view_range=rr.TimeRange(start=low, end=high)))


def all_components(title: str, members: Sequence[str], known: Known) -> rrb.TimeSeriesView:
    """Plot of every component of some signals of one unit."""
    unit = schema.SIGNALS[members[0]].stored_unit
    styles: dict[str, style.Lines] = {}
    for m in members:
        styles[schema.SIGNALS[m].entity] = style.lines(m, first=len(styles))
    if known.ranges and "/turntable/measured" not in known.ranges and PULSE in styles:
        styles[PULSE] = style.without_last(styles[PULSE])
    name = title if unit == "1" else f"{title} [{unit}]"
    return _view(name, styles, _range(known, list(styles)))


def overlay(title: str, members: Sequence[str], axis: int, known: Known) -> rrb.TimeSeriesView:
    """One component of several signals, with the stops if the motion comes near them."""
    unit = schema.SIGNALS[members[0]].stored_unit
    entities = [schema.SIGNALS[m].entity for m in members]
    styles = {e: style.one_axis(m, axis) for e, m in zip(entities, members, strict=True)}
    limits = _range(known, entities, axis)
    bands = {}
    if members[0].startswith("gimbal/") and unit == "deg":
        around = styles.get(schema.SIGNALS[known.middle].entity) if known.middle else None
        bands = {band("angle", axis): band_style(around)}
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
    low, high = known.ranges[entity][axis] if entity in known.ranges else (0.0, 0.0)
    most = max(-low, high)
    shown = style.one_axis("gimbal/difference", axis)
    largest = f", at most {most:.2g}°" if most > 0.0 else " [deg]"  # not known during a run
    line = replace(shown, names=[f"residual {'xy'[axis]}{largest}"] * 2)
    edge = (1.0 + MARGIN) * most
    limits = readable(-edge, edge) if most > 0.0 else None
    name = f"Residual {'xy'[axis]} [deg]"
    bands = {band("residual", axis): band_style()}
    return _view(name, {entity: line}, limits, bands, titled=False)


def band(kind: str, axis: int) -> str:
    """Entity of the band around the angle or around a residual of zero."""
    return f"{VIEW}/band/{kind}/{'xy'[axis]}"


def band_style(around: style.Lines | None = None) -> rr.Measurements:
    """Colour and legend of a band, those of its middle if given, without a line of its own."""
    name, color = (around.names[0], around.colors[0]) if around else ("95 % band", style.BAND)
    return rr.Measurements.from_fields(colors=[color], names=[name], widths=[0.0])


def _range(known: Known, entities: Sequence[str], axis: int | None = None) -> Range | None:
    """Values of one component or all components of some entities, with a margin."""
    rows = [known.ranges[e] for e in entities if e in known.ranges]
    chosen = [r for row in rows for r in (row if axis is None else row[axis : axis + 1])]
    all_of = [r for r in chosen if all(map(math.isfinite, r))]
    if not all_of:
        return None
    low, high = min(r[0] for r in all_of), max(r[1] for r in all_of)
    margin = MARGIN * max(high - low, 1e-3)
    return readable(low - margin, high + margin)


def readable(low: float, high: float) -> Range:
    """Range widened until Rerun labels two values on its axis, even in a low plot.

    It labels multiples of a power of ten, at least about 20 pixels apart.
    """
    step = 10.0 ** math.floor(math.log10((high - low) / MOST_LABELS) + 1.0)
    first, last = math.ceil(low / step), math.floor(high / step)
    if first < last:
        return low, high
    # where none is labelled, to the multiples around, else to the nearer one
    below, above = (first - 1 - LABEL_ROOM) * step, (last + 1 + LABEL_ROOM) * step
    if last < first:
        wide = below, above
    else:
        wide = (below, high) if low - below < above - high else (low, above)
    return wide if high - low > LEAST_USED * (wide[1] - wide[0]) else (low, high)


def _is_near(limits: Range, stops: Range) -> bool:
    return limits[1] > NEAR_STOP * stops[1] or limits[0] < NEAR_STOP * stops[0]


def _view(
    name: str,
    styles: Mapping[str, style.Lines],
    limits: Range | None = None,
    bands: Mapping[str, rr.Measurements] | None = None,
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
        contents=[*given, *(bands or {})],
        overrides={
            **{entity: lines.archetype().visualizer() for entity, lines in given.items()},
            **{entity: look.visualizer() for entity, look in (bands or {}).items()},
        },
        plot_legend=rrb.PlotLegend(corner=rrb.Corner2D.RightTop),
        axis_x=rrb.TimeAxis(link=rrb.components.LinkAxis.LinkToGlobal),
        axis_y=None if limits is None else rrb.ScalarAxis(range=limits),
    )
