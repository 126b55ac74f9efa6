"""Recordings in the formats of other programs, and tables of signals read back."""

from analysis.export.formats import FORMATS, ExportError, Origin, Writer, write
from analysis.export.tables import read

__all__ = ["FORMATS", "ExportError", "Origin", "Writer", "read", "write"]
