"""One self-contained HTML page per result: sections of plain parts, rendered in one place."""

from analysis.report.build import report
from analysis.report.numbers import ReportNumbers
from analysis.report.page import render
from analysis.report.parts import Cell, Line, Panel, Plot, Section, Table

__all__ = [
    "Cell",
    "Line",
    "Panel",
    "Plot",
    "ReportNumbers",
    "Section",
    "Table",
    "render",
    "report",
]
