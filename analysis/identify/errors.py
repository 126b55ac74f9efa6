"""The error a user sees when a measurement cannot be identified from."""

from analysis.schema import AnalysisError


class IdentificationError(AnalysisError):
    """A record, option or order that cannot lead to a model, reported in one line."""
