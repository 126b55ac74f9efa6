"""The answers of a campaign from its rows."""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pyarrow.compute as pc
from numpy.typing import NDArray

from twin.campaigns.flying.runs import Runs
from twin.campaigns.flying.store import column, counted
from twin.campaigns.sampling.study import Study
from twin.campaigns.statistics.boundary import SHARE, Frontier, Property, Region, region
from twin.campaigns.statistics.dispersion import Ellipse, ellipse
from twin.campaigns.statistics.sensitivity import Influence, rank_influences, sobol_influences
from twin.campaigns.statistics.statistic import (
    FEWEST,
    MEANINGS,
    PLACE,
    Estimate,
    mean,
    statistic,
    wilson,
)

Array = NDArray[np.float64]
Rows = Any  # a table of pyarrow
MISS = "closest_approach_m"
MEANS = (MISS, "attitude_error_rms_deg", "apogee_m", "downrange_m")
ATTITUDE = "attitude_error_rms_deg"
FIGURES = (MISS, ATTITUDE)  # whose influences are of interest
CELL_KINDS = ("string",)


@dataclass(frozen=True)
class Cell:
    """Runs of one value of a parameter with names, such as one servo.

    Attributes
    ----------
    parameter, value : which
    rate : of the first measure; None without one
    figure : mean of the first figure of interest
    """

    parameter: str
    value: str
    rate: Estimate | None
    figure: Estimate


@dataclass(frozen=True)
class Answers:
    """What a campaign says.

    Attributes
    ----------
    outcomes : how many runs ended how
    estimates : statistics by name
    figure : whose influences these are
    influences : of the parameters
    on_attitude : influences on the attitude error; empty where they are `influences` already
    cells : runs by named value
    places : dispersion of the ends; None where there are too few
    map : region in which the first measure holds
    frontier : between the two parameters with the smallest margins; None without them
    text : the answer in a sentence
    """

    outcomes: Mapping[str, int]
    estimates: Mapping[str, Estimate]
    figure: str
    influences: Mapping[str, Influence]
    on_attitude: Mapping[str, Influence]
    cells: tuple[Cell, ...]
    places: Ellipse | None
    map: tuple[Property, ...]
    frontier: Frontier | None
    text: str


def answers(study: Study, runs: Runs, table: Rows) -> Answers:
    """All answers that the rows allow."""
    kept = counted(table)
    p = study.confidence
    numbers = {
        c: column(kept, c) for c in runs.columns if str(kept.schema.field(c).type) == "double"
    }
    figure = _figure(kept)
    values = column(kept, figure)
    influences = rank_influences(numbers, values, p)
    if study.kind == "sensitivity":
        of_all = sobol_influences(runs.columns, table["run"].to_numpy(), column(table, figure), p)
        influences = {
            name: Influence(i.rank, *of_all.get(name, ())) for name, i in influences.items()
        }
    on_attitude = {} if figure == ATTITUDE else rank_influences(numbers, column(kept, ATTITUDE), p)
    hits = column(kept, study.measures[0].name) if study.measures else None
    inside = about(study, kept)
    of_map = {n: v[inside] for n, v in numbers.items()}
    found, properties = _region(study, of_map, None if hits is None else hits[inside])
    first = limiting(properties)
    pair = None
    if found is not None and len(first) > 1:
        pair = found.frontier(first[1].name, first[0].name)
    places = np.stack([column(kept, c) for c in PLACE], axis=1)
    estimates = _estimates(study, kept)
    cells = _cells(study, kept, runs, inside, p)
    return Answers(
        dict(Counter(table["outcome"].to_pylist()).most_common()), estimates, figure, influences,
        on_attitude, cells, ellipse(places, p), properties, pair,
        _sentence(study, estimates, cells, first),
    )  # fmt: skip


def about(study: Study, kept: Rows) -> NDArray[np.bool_]:
    """Runs (n,) with the names that the map is about."""
    inside = np.ones(kept.num_rows, bool)
    for name, names in study.about.items():
        inside &= np.isin(np.array(kept[name].to_pylist()), names)
    return inside


def _region(
    study: Study, numbers: Mapping[str, Array], hits: Array | None
) -> tuple[Region | None, tuple[Property, ...]]:
    """Region of the first measure; of a star each ray alone."""
    if hits is None:
        return None, ()
    if study.kind != "star":
        found = region(numbers, hits, study.nominal, study.confidence)
        return found, () if found is None else found.properties
    rays: list[Property] = []
    for name, fixed in study.nominal.items():
        here = numbers[name] != fixed
        alone = {name: numbers[name][here]}
        if (ray := region(alone, hits[here], {name: fixed}, study.confidence)) is not None:
            rays += ray.properties
        elif here.sum() >= FEWEST and hits[here].all():
            rate = wilson(hits[here], study.confidence)
            ends = np.array([alone[name].min(), alone[name].max()])
            low, high = np.full(2, rate.low), np.full(2, rate.high)
            rays.append(Property(name, fixed, ends, np.ones(2), low, high, None, -1))
    return None, tuple(rays)


def limiting(properties: tuple[Property, ...]) -> list[Property]:
    """Parameters with a margin, the smallest first."""
    return sorted((p for p in properties if p.margin is not None), key=lambda p: p.margin or 0.0)


def _estimates(study: Study, kept: Rows) -> dict[str, Estimate]:
    """Statistics of the study: rates, the watched one, and those that every flight has."""
    names = [f"{m.name}_rate" for m in study.measures]
    if study.stop is not None:
        names.append(study.stop.statistic.name)
    to_point = bool(np.isfinite(column(kept, MISS)).any())
    names += [f"{MISS}_{q}" for q in ("median", "p90", "p95")] if to_point else ["cep_m"]
    names += [f"{f}_mean" for f in MEANS]
    made = {}
    for name in dict.fromkeys(names):
        s = statistic(name, study.measures)
        value = s.of([column(kept, c) for c in s.columns], study.confidence)
        if value.n:
            made[name] = value
    return made


def _cells(
    study: Study, kept: Rows, runs: Runs, inside: NDArray[np.bool_], confidence: float
) -> tuple[Cell, ...]:
    """Runs by named value; of a grid only those that the map is about."""
    grids = {v.name for v in study.vary if v.kind == "grid"}
    figure = column(kept, _figure(kept))
    hits = column(kept, study.measures[0].name) if study.measures else None
    made = []
    for name in runs.columns:
        if str(kept.schema.field(name).type) not in CELL_KINDS:
            continue
        for value in pc.unique(kept[name]).to_pylist():
            here = pc.equal(kept[name], value).to_numpy(zero_copy_only=False)
            if name in grids:
                here = here & inside
            rate = None if hits is None else wilson(hits[here], confidence)
            made.append(Cell(name, value, rate, mean(figure[here], confidence)))
    return tuple(made)


def _figure(kept: Rows) -> str:
    return next((f for f in FIGURES if np.isfinite(column(kept, f)).any()), FIGURES[-1])


def _sentence(
    study: Study,
    estimates: Mapping[str, Estimate],
    cells: tuple[Cell, ...],
    first: list[Property],
) -> str:
    if not study.measures:
        name = next((n for n in MEANINGS if n in estimates), None)
        if name is None or not np.isfinite(estimates[name].low):
            return "Too few runs for an interval."
        return f"{MEANINGS[name]}: {estimates[name].text(' m')}."
    name = study.measures[0].name
    e = estimates.get(f"{name}_rate")
    if e is None:
        return "No run counts."
    value, low, high = (100 * x for x in (e.value, e.low, e.high))
    text = f"{name} holds in {value:.1f} % of {e.n} runs ({low:.1f} % to {high:.1f} %)"
    grids = [v.name for v in study.vary if v.kind == "grid"]
    for grid in grids:
        named = [c for c in cells if c.parameter == grid and c.rate is not None]
        good = [c.value for c in named if c.rate is not None and c.rate.low >= SHARE]
        if named:
            text += (
                f"; in at least {100 * SHARE:.0f} % with {len(good)} of {len(named)} {grid} values"
            )
            text += f": {', '.join(good)}" if good else ""
    if first:
        least = first[0]
        text += (
            f"; {least.name} limits it first: {least.limit} for {100 * SHARE:.0f} %, a margin of"
            f" {least.margin:.2g} at the nominal value"
        )
    return text + "."
