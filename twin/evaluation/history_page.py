"""The page of a board's history: verdict, recordings, control charts."""

import math
from collections.abc import Sequence

import numpy as np

from analysis.report import Cell, Line, Panel, Plot, Section, Table
from twin.evaluation.history_result import DAY, LIMIT, Entry, HistoryResult, last_of, outside


def sections(result: HistoryResult) -> tuple[Section, ...]:
    """The verdict, the table of the recordings, and control charts of all properties."""
    entries, model = result.entries, result.model
    head = ("recording", "date", "fit x [%]", "fit y [%]", "outside the interval")
    rows: tuple[tuple[Cell | str, ...], ...] = tuple(
        (
            e.file.name,
            Cell(e.day, "number"),
            *(f"{e.fit[a]:.1f}" if a in e.fit else "–" for a in "xy"),
            "; ".join(outside(e)) or "–",
        )
        for e in entries
    )
    table = Table(head, rows, f"Fit of the measured angle to the model {model}.")
    return (
        Section("verdict", "Verdict", _verdict(result)),
        Section("recordings", "Recordings", (), (table,)),
        Section("chart", "Control charts", (), (_chart(entries, model),)),
    )


def _verdict(result: HistoryResult) -> tuple[str, ...]:
    """Whether the calibration is due, and what the last recording shows."""
    last, n = result.entries[-1], len(result.entries)
    found = len(outside(last)) or "none"
    due = (
        f"The calibration is due: {'; '.join(result.due)}."
        if result.due
        else "The calibration is not due: gain and zero are as at first, within their intervals."
    )
    what = (
        f"{n} recording{'s' if n > 1 else ''} from {result.entries[0].day} to {last.day} UTC."
        f" In the last one {found} of {_count(last)} properties differ from the model by more than"
        " their interval."
    )
    return due, what, *(f"Left out: {text}" for text in result.left_out)


def _count(entry: Entry) -> int:
    return len(entry.drift.axes) * len(entry.drift.properties)


def _chart(entries: Sequence[Entry], model: str) -> Plot:
    properties = entries[0].drift.properties
    start, length = entries[0].date, entries[-1].date - entries[0].date
    unit, name = (DAY, "days") if length > 2.0 * DAY else (3600.0, "hours")
    lines, panels = [], []
    for row, p in enumerate(properties):
        panels.append(Panel("", f"{p.name} [{p.unit}]" if p.unit else p.name, row))
        for j, axis in enumerate("xy"):
            runs = [e for e in entries if axis in e.drift.axes]
            if not runs:
                continue
            at = np.array([(e.date - start) / unit for e in runs])
            value, sigma = np.array([last_of(e.drift.axes[axis], row) for e in runs]).T * p.scale
            labels = tuple(f"{e.day} {e.file.name}" for e in runs)
            low, high = value - 1.96 * sigma, value + 1.96 * sigma
            lines.append(Line(axis, at, value, f"run{j}", row, "dots", labels=labels))
            lines += [
                Line(axis, np.full(2, t), np.array(ends), f"run{j}", row)
                for t, *ends in zip(at, low, high, strict=True)
            ]
        span = np.array([-0.02, 1.02]) * max(length / unit, 1.0)
        allowed = math.hypot(p.sigma, p.bias)
        for side in (-LIMIT, LIMIT):
            limit = np.full(2, (p.value + side * allowed) * p.scale)
            lines.append(Line("limit of the model", span, limit, "command", row, "dash"))
    caption = (
        f"Estimates of each recording with 95 % intervals, against the model {model}; dashed: three"
        " standard deviations of the model, of the speed with its bias. Gain, speed and friction"
        " are relative to the model."
    )
    about = f"{name} since the first recording"
    return Plot("properties", caption, about, tuple(panels), tuple(lines), panel_height=110)
