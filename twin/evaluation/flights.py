"""`twin compare` of flights without a gimbal: their figures, and how far their paths lie apart."""

import math
from dataclasses import dataclass
from pathlib import Path

from analysis.comparison import PathDifference, flight_path, path_difference
from analysis.flown import FIGURES, GROUND, Flown, flown
from analysis.plain import plain
from analysis.recording import Measurement, rrd
from twin.config import Compare
from twin.config.result import Result, Rows
from twin.errors import TwinError

LEADS = ("apogee", "highest point")  # names of figures that are shown first
APART = 0.05  # s; ends that differ by less are those of one duration at two rates


@dataclass(frozen=True)
class FlightsResult(Result):
    """Two flights in figures.

    Attributes
    ----------
    reference, other : file of each
    flights : figures of each
    path : how far they lie apart while both flew
    ends_apart : level distance between the places where they ended [m]
    file : both flights in one recording
    """

    reference: str
    other: str
    flights: tuple[Flown, Flown]
    path: PathDifference
    ends_apart: float
    file: Path

    def as_dict(self) -> dict[str, object]:
        """JSON values in SI, unless a name gives another unit; differences where both have one."""
        return {
            "reference": {"file": self.reference, **self.flights[0].to_dict()},
            "other": {"file": self.other, **self.flights[1].to_dict()},
            "difference": differences(self.flights),
            "path": self.path.to_dict(),
            "ends_apart_m": plain(self.ends_apart),
            "recording": str(self.file),
        }

    def rows(self) -> Rows:
        """Apogee, ends and paths first, then every other figure that differs."""
        rows = [("reference", self.reference), ("compared", self.other)]
        apart, equal = _differing(self.flights)
        rows += leading(self.flights)
        rows.append((f"paths, {self.path.time:.1f} s", self.path.text()))
        rows += [row for row in apart if not row[0].startswith(LEADS)]
        rows.append(("wind", ", ".join(f.texts.get("wind", "none") for f in self.flights)))
        if equal:
            rows.append(("equal", ", ".join(equal)))
        return [*rows, ("recording", str(self.file)), ("", f"twin view {self.file}")]


def leading(flights: tuple[Flown, Flown]) -> Rows:
    """Apogees that differ, and how far the ends lie apart; before them, that one was cut short."""
    lead = [row for row in _differing(flights)[0] if row[0].startswith(LEADS)]
    cut = cut_short(flights)
    if cut is not None:
        first, second = cut
        text = (
            f"at {first:.2f} s, at {second:.2f} s; both are compared until {min(cut):.2f} s at most"
        )
        lead = [
            ("ended", text),
            ("", "the next rows are of each flight up to its own end"),
            *lead,
        ]
    return [*lead, ("ends apart", f"{ends_apart(flights):.1f} m on the ground plan")]


def cut_short(flights: tuple[Flown, Flown]) -> tuple[float, float] | None:
    """When two flights ended [s]; None where both landed, at one time, or where it is unknown."""
    first, second = (f.numbers.get("flight_time_s", math.nan) for f in flights)
    landed = all(f.texts.get("ended") == GROUND for f in flights)
    return (first, second) if abs(second - first) > APART and not landed else None


def ends_apart(flights: tuple[Flown, Flown]) -> float:
    """Level distance between the places where two flights ended [m]; NaN where one is unknown."""
    east, north = (
        flights[1].numbers.get(k, math.nan) - flights[0].numbers.get(k, math.nan)
        for k in ("end_east_m", "end_north_m")
    )
    return math.hypot(east, north)


def differences(flights: tuple[Flown, Flown]) -> dict[str, float]:
    """Figures of the second minus those of the first, in SI; of those that both have."""
    a, b = (f.numbers for f in flights)
    return {name: b[name] - a[name] for name in a if name in b}


def _differing(flights: tuple[Flown, Flown]) -> tuple[Rows, list[str]]:
    """Figures that differ, each in a row, and the names of those that do not."""
    apart: Rows = []
    equal = []
    for name, key, unit, scale in FIGURES:
        of = [f.numbers for f in flights]
        values = [_rounded(n[key] * scale) if key in n else None for n in of]
        known = [v for v in values if v is not None]
        if not known:
            continue
        places = _decimals(known)
        texts = ["none" if v is None else f"{v:.{places}f}{unit}" for v in values]
        if texts[0] == texts[1]:
            equal.append(name)
        else:
            by = f": {known[1] - known[0]:+.{places}f}{unit}" if known[1:] else ""
            apart.append((name, f"{', '.join(texts)}{by}"))
    return apart, equal


def _decimals(values: list[float]) -> int:
    """Decimals of a row: five digits of its largest value, four decimals at most."""
    largest = max(abs(v) for v in values)
    digits = math.floor(math.log10(largest)) if largest > 0.0 else 0
    return min(max(4 - digits, 0), 4)


def _rounded(value: float) -> float:
    return round(value, 4) + 0.0  # no -0


def compare_flights(config: Compare, runs: list[Measurement], file: Path) -> FlightsResult:
    """Compare two flights of which one has no gimbal, and put both into one recording.

    Raises
    ------
    TwinError : a flag about the gimbal, or a recording in which nothing flew
    """
    for flag, given in (
        ("--fail-below", config.fail_below is not None),
        ("--drift", config.drift),
        ("--explain", config.explain),
        ("--longest-delay-ms", config.longest_delay_ms != Compare.longest_delay_ms),
    ):
        if given:
            passive = next(r.name for r in runs if r.recording.passive)
            raise TwinError(f"{flag}: is about a gimbal, and {passive} is a flight without one")
    if len(runs) < 2:
        raise TwinError(
            f"compare: {runs[0].name} is a flight without a gimbal; give another flight too"
        )
    found = [flown(run.recording) for run in runs]
    if any(f is None for f in found):
        still = runs[found.index(None)].name
        raise TwinError(f"compare: nothing flies in {still}; the other is a flight without gimbal")
    from twin.recorder.layout.together import write

    first, second = (f for f in found if f is not None)
    path = path_difference(*(flight_path(r.recording) for r in runs), whole=True)
    part = file.with_name(f"{file.name}.partial")
    write(config.recordings, part)
    if not rrd.complete(part):
        part.unlink(missing_ok=True)
        raise TwinError(f"cannot finish {file}: its end is missing; is the disk full?")
    part.replace(file)
    before, after = map(str, config.recordings)
    both = (first, second)
    return FlightsResult(before, after, both, path, ends_apart(both), file)
