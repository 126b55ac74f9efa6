"""Online estimation: properties of a gimbal beside its model, and their drift."""

from analysis.estimate.drift import AxisDrift, Change, Model, drift
from analysis.estimate.recursive import (
    Information,
    Property,
    Track,
    fitted,
    information,
    scatter,
    track,
)

__all__ = [
    "AxisDrift",
    "Change",
    "Information",
    "Model",
    "Property",
    "Track",
    "drift",
    "fitted",
    "information",
    "scatter",
    "track",
]
