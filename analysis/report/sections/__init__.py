"""One file a section, each from runs and numbers to plain parts, or to nothing."""

from collections.abc import Callable, Sequence

from analysis.recording.measurements import Measurement
from analysis.report.numbers import ReportNumbers
from analysis.report.parts import Section
from analysis.report.sections.comparison import comparison
from analysis.report.sections.events import events
from analysis.report.sections.figures import figures
from analysis.report.sections.flight import flight
from analysis.report.sections.frequency import frequency
from analysis.report.sections.histories import histories
from analysis.report.sections.hysteresis import hysteresis
from analysis.report.sections.key_figures import key_figures
from analysis.report.sections.margins import margins
from analysis.report.sections.provenance import provenance, settings
from analysis.report.sections.slew import slew
from analysis.report.sections.staircase import staircase
from analysis.report.sections.steps import steps
from analysis.report.sections.summary import summary
from analysis.report.sections.three_way import three_way

Compose = Callable[[Sequence[Measurement], ReportNumbers], Section | None]

SECTIONS: tuple[Compose, ...] = (
    summary,
    flight,
    histories,
    key_figures,
    three_way,
    comparison,
    steps,
    staircase,
    slew,
    frequency,
    hysteresis,
    margins,
    figures,
    events,
    provenance,
    settings,
)

__all__ = ["SECTIONS", "Compose"]
