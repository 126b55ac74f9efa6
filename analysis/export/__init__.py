"""Recordings in the formats of other programs."""

from analysis.export.formats import FORMATS, ExportError, Origin, Writer, write

__all__ = ["FORMATS", "ExportError", "Origin", "Writer", "write"]
