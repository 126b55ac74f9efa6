"""`twin fly --repeat`: the same flight again and again, with a rig and with its models."""

import math
import sys
import time
from dataclasses import dataclass, replace
from pathlib import Path

from analysis.comparison.flights import (
    FlightPath,
    PathDifference,
    Spread,
    attitude_step,
    flight_path,
    path_difference,
    spread,
)
from analysis.recording import read
from analysis.report import render
from analysis.response.figure import Figure, over_repeats
from analysis.response.metrics import StepMetrics
from analysis.response.steps import up_to_hidden
from twin.config import Fly, with_model
from twin.config.seats import MODELS, is_rig
from twin.errors import TwinError
from twin.experiments.fly import fly
from twin.experiments.summary import FlightResult

MOST = 1000
STEP_FIGURES = (("overshoot", "%"), ("settling_time", "s"), ("rise_time", "s"))


@dataclass(frozen=True)
class SeatFlights:
    """All flights with one gimbal.

    Attributes
    ----------
    gimbal : who had the seat
    results, paths : of each flight; a flight that a fault ended has no path here
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
class RepeatResult:
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

    def text(self) -> str:
        """One screen."""
        rows = []
        for seat in self.seats:
            rows += [(seat.gimbal, _count(seat)), *_spread_rows(seat)]
            rows += [("", f"{f.name.replace('_', ' '):<20}{_told(f)}") for f in seat.figures]
            rows += [("FAULT", r.fault) for r in seat.results if r.fault is not None]
        rows += [(f"against {name}", d.text()) for name, d in self.differences.items()]
        rows += [("computing", f"{self.wall_s:.1f} s"), ("report", self.page)]
        return "\n".join(f"{name:<26}{value}".rstrip() for name, value in rows)


def repeat(config: Fly) -> RepeatResult:
    """Fly again and again, each flight with the next seed, and write a page.

    Raises
    ------
    TwinError, HardwareError, AnalysisError : something asked for cannot be done, in one line
    """
    began = time.perf_counter()
    from twin.experiments.repeat.page import sections

    if not 2 <= config.repeat <= MOST:
        raise TwinError(f"--repeat {config.repeat}: must lie in 1 to {MOST}")
    folder, page = _places(config)
    others = MODELS if is_rig(config.gimbal) else ()
    names = (config.gimbal, *(m for m in others if m != config.gimbal))
    seats = tuple(_seat(config, name, folder) for name in names)
    flown = seats[0].paths
    differences = {s.gimbal: path_difference(flown[0], s.paths[0]) for s in seats[1:] if flown}
    result = RepeatResult(seats, differences, str(page), time.perf_counter() - began)
    render(sections(result), "Repeated flights", page, result.as_dict())
    return result


def _places(config: Fly) -> tuple[Path, Path]:
    out = config.out or Path("runs/repeat")
    if out.suffix.lower() in (".html", ".htm"):
        return out.with_suffix(""), out
    if out.suffix:
        raise TwinError(f"--out {out}: of repeated flights a folder, or the report (.html)")
    return out, out.with_suffix(".html")


def _seat(config: Fly, gimbal: str, folder: Path) -> SeatFlights:
    results: list[FlightResult] = []
    paths: list[FlightPath] = []
    steps: list[StepMetrics] = []
    same = False
    name = gimbal if gimbal in MODELS or not is_rig(gimbal) else _slug(gimbal)
    for k in range(config.repeat):
        _progress(gimbal, k, config.repeat)
        out = folder / f"{name}-{k + 1:02d}.rrd"
        result = fly(_one(config, gimbal, config.seed + k, out))
        results.append(result)
        if not _counts(result, config):
            continue  # it flew to no end that could be compared
        recording = read(out)
        paths.append(flight_path(recording))
        if (found := attitude_step(recording)) is not None:
            steps.append(found)
        same = len(paths) > 1 and all(_equal(path, paths[0]) for path in paths[1:])
        if same and k == 1:  # nothing random in it: more flights would tell nothing
            break
    _progress(gimbal, config.repeat, config.repeat)
    scatter = spread(paths) if len(paths) > 1 else None
    told = slice(1) if same else slice(None)  # a flight repeated to the last bit is one flight
    figures = _figures([r for r in results if _counts(r, config)][told], steps[told])
    return SeatFlights(gimbal, tuple(results), tuple(paths), same, scatter, figures)


def _counts(result: FlightResult, config: Fly) -> bool:
    return result.passed or config.on_fault == "ignore"


def _one(config: Fly, gimbal: str, seed: int, out: Path) -> Fly:
    one = replace(config, seed=seed, out=out, repeat=1, json=False)
    return one if gimbal == config.gimbal else with_model(one, gimbal)


def _equal(a: FlightPath, b: FlightPath) -> bool:
    return a.position.tobytes() == b.position.tobytes() and a.nose.tobytes() == b.nose.tobytes()


def _figures(results: list[FlightResult], steps: list[StepMetrics]) -> tuple[Figure, ...]:
    errors = [math.radians(r.attitude_error_rms_deg) for r in results if r.attitude_error_rms_deg]
    found = [over_repeats("attitude_error_rms", errors, "rad")]
    closest = [r.closest_approach_m for r in results if r.closest_approach_m is not None]
    if closest:
        found.append(over_repeats("closest_approach", closest, "m"))
    if steps:
        size = steps[0].amplitude
        told = [
            over_repeats(name, [getattr(s, name) for s in steps], unit, size)
            for name, unit in STEP_FIGURES
        ]
        found += [up_to_hidden(f, steps) if f.name == "overshoot" else f for f in told]
    return tuple(found)


def _slug(port: str) -> str:
    return "".join(c if c.isalnum() else "-" for c in port).strip("-") or "rig"


def _progress(gimbal: str, k: int, n: int) -> None:
    if sys.stderr.isatty():
        line = f"flying {gimbal} {k + 1} of {n}" if k < n else ""
        print(f"\r{line:<60}\r", end="", file=sys.stderr, flush=True)


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


def _told(f: Figure) -> str:
    scale, unit = (180.0 / math.pi, "°") if f.unit == "rad" else (1.0, f" {f.unit}")
    if not math.isfinite(f.value):
        return "not reached"
    told = f"{scale * f.value:.3g}{unit}"
    low, high = f.interval
    if not math.isfinite(low):
        return told
    return f"{scale * f.value:.3g} ± {0.5 * scale * (high - low):.2g}{unit}, n = {f.n}"
