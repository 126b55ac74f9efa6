"""What is recorded for the viewer only: events as text, residual and bands, stops, gaps, time span.

None of it is read back: `analysis.recording` reads the signals.
"""

import math
from collections.abc import Mapping, Sequence

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from analysis import schema
from twin.recorder import columns
from twin.recorder.layout import plots

Floats = NDArray[np.float64]
Stamps = NDArray[np.int64]

RESIDUAL_NS, BAND_NS = 10_000_000, 40_000_000  # between two values
TWO_SIGMA = 2.0  # 95 % of a normal distribution
GAP_NS, GAP_INTERVALS = 100_000_000, 10.0  # longer than both is a gap in a sampled signal
MOST_EVENTS = 300
EVENTS = f"{plots.VIEW}/events"
_LEVELS = {"INFO": "", "WARN": "⚠ ", "ERROR": "✖ "}
_AT_CHANGES = frozenset((*schema.RARE, *schema.TICK))


class Display:
    """Writes the viewer's additions to a recording as its rows come.

    Parameters
    ----------
    signals : that are recorded
    stops : lowest and highest angle of each axis [deg]; empty without

    Attributes
    ----------
    residual : entity of measured minus simulated angle; None where one of them is missing
    """

    def __init__(self, signals: Sequence[str], stops: Sequence[plots.Range]) -> None:
        has = set(signals)
        self._stops = stops
        self._sampled = [
            s for s in signals if schema.SIGNALS[s].kind == "sampled" and s not in _AT_CHANGES
        ]
        self.residual = _residual(has)
        self._half, self._middle = _band(has)
        self._last: dict[str, int] = {}
        self._usual: dict[str, float] = {}  # interval of a signal [ns]
        self._before: tuple[Stamps, Floats] | None = None
        self._ranges: dict[str, Floats] = {}
        self._sent = 0
        self._lines: list[tuple[int, str]] = []
        self._end = self._start = -1

    def start(self, stream: rr.RecordingStream) -> None:
        """Write styles that do not change."""
        if self._half:
            for kind in ("angle", "residual"):
                for axis in (0, 1):
                    stream.log(plots.band(kind, axis), plots.band_style(), static=True)

    def drain(
        self, stream: columns.Columns, time: Stamps, wall: Stamps, rows: Mapping[str, Floats]
    ) -> None:
        """Take rows (n, k) of signals by name, in stored units."""
        self._start = int(time[0]) if self._start < 0 else self._start
        self._end = int(time[-1])
        for name, values in rows.items():
            self._stretch(schema.SIGNALS[name].entity, values)
        for name in self._sampled:
            self._mark_gaps(stream, name, time, wall, rows[name])
        if self.residual == plots.RESIDUAL:
            self._send_residual(stream, time, wall, rows)
        if self._half:
            self._send_band(stream, time, wall, rows)

    def _stretch(self, entity: str, values: Floats) -> None:
        new = np.stack([np.fmin.reduce(values), np.fmax.reduce(values)], axis=1)
        old = self._ranges.get(entity, new)
        self._ranges[entity] = np.stack(
            [np.fmin(old[:, 0], new[:, 0]), np.fmax(old[:, 1], new[:, 1])], axis=1
        )

    def _mark_gaps(
        self, stream: columns.Columns, name: str, time: Stamps, wall: Stamps, values: Floats
    ) -> None:
        there = np.isfinite(values).any(axis=1)
        if not there.any():
            return
        stamps = time[there]
        if name in self._last:
            stamps = np.insert(stamps, 0, self._last[name])
        self._last[name] = int(stamps[-1])
        if stamps.size < 2:
            return
        apart = np.diff(stamps)
        usual = min(self._usual.get(name, math.inf), float(np.median(apart)))
        self._usual[name] = usual
        longest = max(GAP_NS, GAP_INTERVALS * usual)
        gaps = np.flatnonzero(apart > longest)
        if gaps.size:
            at = stamps[gaps] + 1
            when = columns.times(at, at - time[0] + wall[0])
            stream.send_columns(schema.SIGNALS[name].entity, when, columns.ends(len(at)))

    def _send_residual(
        self, stream: columns.Columns, time: Stamps, wall: Stamps, rows: Mapping[str, Floats]
    ) -> None:
        simulated, measured = rows["gimbal/simulated"], rows["gimbal/measured"]
        known = np.isfinite(simulated).all(axis=1)
        at, values = time[known], simulated[known]
        if self._before is not None:
            at, values = np.append(self._before[0], at), np.append(self._before[1], values, axis=0)
        if not at.size:
            return
        self._before = at[-1:].copy(), values[-1:].copy()
        there = np.isfinite(measured).all(axis=1) & (time >= at[0]) & (time <= at[-1])
        chosen = _thinned(np.flatnonzero(there), time, RESIDUAL_NS)
        if chosen.size:
            difference = measured[chosen] - _interpolated(time[chosen], at, values)
            self._stretch(plots.RESIDUAL, difference)
            stamps = columns.times(time[chosen], wall[chosen])
            stream.send_columns(plots.RESIDUAL, stamps, columns.scalars(difference))

    def _send_band(
        self, stream: columns.Columns, time: Stamps, wall: Stamps, rows: Mapping[str, Floats]
    ) -> None:
        half, middle = rows[self._half], rows[self._middle]
        known = np.isfinite(middle).all(axis=1)
        chosen = _thinned(np.flatnonzero(np.isfinite(half).all(axis=1)), time, BAND_NS)
        if not chosen.size or not known.any():
            return
        width = half[chosen] * (TWO_SIGMA if self._half == "gimbal/sigma" else 1.0)
        at = _interpolated(time[chosen], time[known], middle[known])
        stamps = columns.times(time[chosen], wall[chosen])
        self._stretch(self.residual or plots.RESIDUAL, width)
        for axis in (0, 1):
            around = columns.bands(at[:, axis], width[:, axis])
            stream.send_columns(plots.band("angle", axis), stamps, around)
            zero = columns.bands(np.zeros(len(width)), width[:, axis])
            stream.send_columns(plots.band("residual", axis), stamps, zero)

    def text(self, time_ns: int, text: str, level: str) -> None:
        """Take an event."""
        bold = "" if level == "INFO" else "**"
        mark = _LEVELS.get(level, "")
        self._lines.append((time_ns, f"`{time_ns * 1e-9:8.3f} s`  {bold}{mark}{text}{bold}"))

    def send_events(self, stream: rr.RecordingStream) -> None:
        """Write the list of events anew if there are more."""
        if len(self._lines) == self._sent:
            return
        self._sent = len(self._lines)
        lines = [line for _, line in sorted(self._lines, key=lambda e: e[0])[-MOST_EVENTS:]]
        page = rr.TextDocument("\n\n".join(lines), media_type="text/markdown")
        stream.log(EVENTS, page, static=True)

    def finish(self, stream: rr.RecordingStream) -> plots.Known:
        """Write the time span and the stops; returns what scales the plots."""
        known = {
            entity: [(float(low), float(high)) for low, high in ranges]
            for entity, ranges in self._ranges.items()
            if np.isfinite(ranges).any()
        }
        if self._end > self._start >= 0:
            ends = np.array([self._start, self._end])
            stamps = [rr.TimeColumn(schema.TIME, duration=ends.astype("timedelta64[ns]"))]
            stream.send_columns(plots.SPAN, stamps, columns.scalars(np.zeros((2, 1))))
            if self._stops:
                lines = columns.scalars(np.tile(np.ravel(self._stops), (2, 1)))
                stream.send_columns(plots.STOPS, stamps, lines)
        span = (self._start, self._end) if self._end > self._start >= 0 else None
        return plots.Known(known, self._stops, span, self._middle)


def _residual(has: set[str]) -> str | None:
    if "shadow/residual" in has:
        return "/shadow/residual"
    return plots.RESIDUAL if {"gimbal/measured", "gimbal/simulated"} <= has else None


def _band(has: set[str]) -> tuple[str, str]:
    """Signals with half the width of the band and with its middle; empty without."""
    for half, middle in (("shadow/band", "gimbal/simulated"), ("gimbal/sigma", "gimbal/measured")):
        if {half, middle} <= has:
            return half, middle
    return "", ""


def _thinned(rows: NDArray[np.intp], time: Stamps, period_ns: int) -> NDArray[np.intp]:
    """The first of the rows in every period."""
    _, first = np.unique(time[rows] // period_ns, return_index=True)
    return rows[first]


def _interpolated(at: Stamps, time: Stamps, values: Floats) -> Floats:
    return np.stack([np.interp(at, time, column) for column in values.T], axis=1)
