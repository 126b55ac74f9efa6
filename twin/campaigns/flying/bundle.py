"""Some runs of a campaign flown again for one recording of their paths."""

import itertools
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis.recording import read
from twin.campaigns.flying.runs import Runs
from twin.campaigns.flying.store import column, counted
from twin.campaigns.sampling.parameters import Binding
from twin.experiments.flight.fly import fly
from twin.recorder.paths import FlownPath, write_paths

Colour = tuple[int, int, int]
WORST, MEDIAN = (220, 50, 47), (38, 139, 210)  # colours
POINTS = 500  # of one path


def bundle(
    out: Path, runs: Runs, bound: Binding, table: Any, figure: str, count: int, about: str  # noqa: ANN401
) -> Path:  # fmt: skip
    """Write a recording with the paths of `count` runs, among them the worst and the median one.

    Parameters
    ----------
    table : rows of the campaign
    figure : by which runs are better or worse

    Raises
    ------
    TwinError : the recording cannot be written
    """
    chosen = _chosen(table, figure, count)
    paths = []
    with TemporaryDirectory(prefix="tvc-twin-") as folder:
        for run, (which, colour) in chosen.items():
            points = _path(runs, bound, run, Path(folder))
            paths.append(FlownPath(f"{which} run {run}".strip(), points, colour))
    return write_paths(out, paths, about)


def _chosen(table: Any, figure: str, count: int) -> dict[int, tuple[str, Colour | None]]:  # noqa: ANN401
    """Runs with their words and colours: worst, median, others evenly spaced from the best on."""
    kept = counted(table)
    values = column(kept, figure)
    order = np.argsort(values)[: int(np.isfinite(values).sum())]
    if not len(order):
        return {}
    places = [len(order) - 1, len(order) // 2, *np.linspace(0, len(order) - 1, count).astype(int)]
    about = [("worst", WORST), ("median", MEDIAN), *[("", None)] * count]
    runs = kept["run"].to_pylist()
    chosen: dict[int, tuple[str, Colour | None]] = {}
    for place, what in zip(places, about, strict=True):
        chosen.setdefault(runs[order[place]], what)
    return dict(itertools.islice(chosen.items(), count))


def _path(runs: Runs, bound: Binding, run: int, folder: Path) -> NDArray[np.float64]:
    config = bound.config(runs.values([run])[0], runs.sample(run), folder)
    result = fly(replace(config, out=folder / f"{run}.rrd"))
    points = read(Path(result.recording))["vehicle/position"].values
    return np.asarray(points[:: max(1, len(points) // POINTS)])
