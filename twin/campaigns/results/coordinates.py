"""Parallel coordinates: each run one line over all that varies, from lowest to highest value."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis.report import Line, Panel, Plot, Section
from twin.campaigns.flying.store import column
from twin.campaigns.results.answers import Answers
from twin.campaigns.sampling.study import Study

Array = NDArray[np.float64]
Numbers = NDArray[np.intp]
MOST_LINES = 40  # of runs that hit, and of those that miss
MOST_ROWS = 12


def coordinates(
    a: Answers, study: Study, kept: Any, command: Callable[[int], str]  # noqa: ANN401  a table
) -> Section | None:  # fmt: skip
    """Section with one row for each parameter and the figure; None where only one thing varies.

    Parameters
    ----------
    kept : rows of the runs that count
    command : that flies a run again
    """
    columns = [c for v in study.vary for c in v.columns]
    columns.sort(key=lambda c: -abs(a.influences[c].rank.value) if c in a.influences else 0.0)
    axes = [_axis(kept, c) for c in [*columns[: MOST_ROWS - 1], a.figure]]
    axes = [(label, values) for label, values in axes if label]
    if len(axes) < 3:
        return None
    places = np.stack([values for _, values in axes], axis=1)  # (runs, rows)
    complete = np.asarray(np.isfinite(places).all(axis=1))  # a run that diverged has no figures
    lines = []
    for name, role, runs in _kinds(study, kept):
        shown = _spread(runs[complete[runs]])
        if not shown:
            continue
        numbers = kept["run"].take(shown).to_pylist()
        lines.append(_line(name, role, places[shown], [command(run) for run in numbers]))
    if not lines:
        return None
    caption = (
        "Each line is a run, each row what varies, from its lowest value on the left to its highest"
        f" on the right; the most influential on top, {a.figure} last. Up to {MOST_LINES} runs of"
        " each colour, evenly spaced. A point under the pointer shows the command that flies its"
        " run again."
    )
    panel = Panel("", "", rows=tuple(label for label, _ in axes))
    height = 50 * len(axes)
    plot = Plot("coordinates", caption, "", (panel,), tuple(lines), panel_height=height)
    return Section("coordinates", "Parallel coordinates", (), (plot,))


def _axis(kept: Any, name: str) -> tuple[str, Array]:  # noqa: ANN401  a table
    """Label of a row, and the places 0 to 1 of all runs; no label where nothing varies."""
    if str(kept.schema.field(name).type) == "string":
        given = kept[name].to_pylist()
        names = sorted(set(given))
        values = np.array([names.index(g) for g in given], np.float64)
        ends = (names[0], names[-1]) if names else ("", "")
    else:
        values = column(kept, name)
        if not np.isfinite(values).any():
            return "", values
        ends = (f"{np.nanmin(values):.3g}", f"{np.nanmax(values):.3g}")
    low, high = (np.nanmin(values), np.nanmax(values)) if len(values) else (0.0, 0.0)
    if not high > low:
        return "", values
    return f"{name}\n{ends[0]} to {ends[1]}", (values - low) / (high - low)


def _kinds(study: Study, kept: Any) -> list[tuple[str, str, Numbers]]:  # noqa: ANN401  a table
    """Name, colour and runs: those that meet the first measure, then those that do not."""
    if not study.measures:
        return [("run", "run0", np.arange(kept.num_rows))]
    name = study.measures[0].name
    hits = column(kept, name) > 0.5
    both = [(name, "run0", np.flatnonzero(hits)), (f"not {name}", "run1", np.flatnonzero(~hits))]
    return [kind for kind in both if len(kind[2])]


def _spread(runs: Numbers) -> Sequence[int]:
    few = min(len(runs), MOST_LINES)
    return runs[np.linspace(0, len(runs) - 1, few).round().astype(int)].tolist()  # type: ignore[no-any-return]


def _line(name: str, role: str, places: Array, labels: Sequence[str]) -> Line:
    """All runs of a colour in one line with gaps between them."""
    runs, rows = places.shape
    x = np.hstack([places, np.full((runs, 1), np.nan)]).ravel()
    y = np.tile(np.arange(rows + 1, dtype=np.float64), runs)
    text = tuple(label for label in labels for _ in range(rows + 1))
    return Line(name, x, y, role, style="thin", labels=text)
