"""What the runs noted about themselves."""

from collections.abc import Sequence

from analysis.recording.measurements import Measurement
from analysis.report.numbers import ReportNumbers
from analysis.report.parts import Cell, Section, Table
from analysis.report.words import number

MOST = 200  # lines


def events(runs: Sequence[Measurement], numbers: ReportNumbers) -> Section | None:  # noqa: ARG001
    """Events and health of each run by time; nothing if nothing was noted."""
    found = [
        (run.name, e)
        for run in runs
        for e in sorted((*run.recording.events, *run.recording.health), key=lambda e: e.time)
    ]
    if not found:
        return None
    rows = [
        (
            label,
            f"{number(e.time, 6)} s",
            Cell(e.level, "" if e.level == "INFO" else "warn"),
            e.text,
        )
        for label, e in found[:MOST]
    ]
    more = f"The first {MOST} of {len(found)}." if len(found) > MOST else ""
    table = Table(("run", "time", "level", "what"), tuple(rows), more)
    return Section("events", "Events", (), (table,))
