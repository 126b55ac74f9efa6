"""Result of repeated flights: numbers for machines, rows for people."""

import math
from dataclasses import dataclass

from analysis.comparison.flights import FlightPath, PathDifference, Spread
from analysis.response.figure import Figure
from twin.config.result import Result, Rows
from twin.experiments.flight.result import FlightResult


@dataclass(frozen=True)
class SeatFlights:
    """All flights with one gimbal.

    Attributes
    ----------
    gimbal : component in the gimbal seat
    results, paths : of each flight; a flight that a fault ended has no path
    repeats : whether all flights are equal to the last bit; then only two were flown
    spread : of the paths; None for a single flight
    figures : over the flights, with their intervals
    """

    gimbal: str
    results: tuple[FlightResult, ...]
    paths: tuple[FlightPath, ...]
    repeats: bool
    spread: Spread | None
    figures: tuple[Figure, ...]

    def as_dict(self) -> dict[str, object]:
        """JSON values in SI."""
        return {
            "gimbal": self.gimbal,
            "flights": len(self.results),
            "identical": self.repeats,
            "spread": None if self.spread is None else self.spread.to_dict(),
            "figures": [f.to_dict() for f in self.figures],
            "faults": [r.fault for r in self.results if r.fault is not None],
            "recordings": [r.recording for r in self.results],
        }


@dataclass(frozen=True)
class RepeatResult(Result):
    """Repeated flights, seat by seat.

    Attributes
    ----------
    seats : the gimbal asked for first, then the models beside it
    differences : first flight of the first seat against that of each other seat
    page : report written
    """

    seats: tuple[SeatFlights, ...]
    differences: dict[str, PathDifference]
    page: str
    wall_s: float

    @property
    def passed(self) -> bool:
        """Whether nothing was wrong with the rig in any flight."""
        return all(r.passed for seat in self.seats for r in seat.results)

    def as_dict(self) -> dict[str, object]:
        """JSON values in SI."""
        return {
            "seats": [seat.as_dict() for seat in self.seats],
            "differences": {name: d.to_dict() for name, d in self.differences.items()},
            "page": self.page,
            "wall_s": self.wall_s,
        }

    def rows(self) -> Rows:
        """The flights as a table."""
        rows: Rows = []
        for seat in self.seats:
            rows += [(seat.gimbal, _count(seat)), *_spread_rows(seat)]
            rows += [("", f"{f.name.replace('_', ' '):<20}{_text(f)}") for f in seat.figures]
            rows += [("FAULT", r.fault) for r in seat.results if r.fault is not None]
        rows += [(f"against {name}", d.text()) for name, d in self.differences.items()]
        return [*rows, ("computing", f"{self.wall_s:.1f} s"), ("report", self.page)]


def _count(seat: SeatFlights) -> str:
    if seat.repeats:
        return f"{len(seat.paths)} flights, equal to the last bit"
    return f"{len(seat.results)} flights"


def _spread_rows(seat: SeatFlights) -> list[tuple[str, str]]:
    s = seat.spread
    if s is None or seat.repeats:
        return []
    scatter = f"{s.distance[-1]:.2f} m deviation at {s.time[-1]:.1f} s"
    return [
        ("", f"{'path':<20}{scatter}, {s.worst:.2f} m worst"),
        ("", f"{'attitude':<20}{math.degrees(s.attitude):.2f}° deviation from the mean"),
    ]


def _text(f: Figure) -> str:
    scale, unit = (180.0 / math.pi, "°") if f.unit == "rad" else (1.0, f" {f.unit}")
    if not math.isfinite(f.value):
        return "not reached"
    shown = f"{scale * f.value:.3g}{unit}"
    low, high = f.interval
    if not math.isfinite(low):
        return shown
    return f"{scale * f.value:.3g} ± {0.5 * scale * (high - low):.2g}{unit}, n = {f.n}"
