"""Two motions or two flights side by side: errors, delay, coherence, distance of the paths."""

from analysis.comparison.compare import (
    AxisComparison,
    Comparison,
    Errors,
    compare,
    errors,
)
from analysis.comparison.flights import (
    FlightPath,
    PathDifference,
    Spread,
    attitude_step,
    flight_path,
    holds_flight,
    path_difference,
    spread,
)
from analysis.comparison.motion import bridged
from analysis.comparison.spectrum import Spectrum

__all__ = [
    "AxisComparison",
    "Comparison",
    "Errors",
    "FlightPath",
    "PathDifference",
    "Spectrum",
    "Spread",
    "attitude_step",
    "bridged",
    "compare",
    "errors",
    "flight_path",
    "holds_flight",
    "path_difference",
    "spread",
]
