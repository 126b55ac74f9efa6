"""A campaign as a page that leads with its answer."""

import shlex
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from analysis.report import Cell, Line, Panel, Plot, Section, Table
from twin.campaigns.flying.store import column, counted
from twin.campaigns.results.answers import ATTITUDE, Answers, about
from twin.campaigns.results.coordinates import coordinates
from twin.campaigns.results.result import CampaignResult
from twin.campaigns.sampling.study import Study
from twin.campaigns.statistics.boundary import FEWEST, SHARE, Frontier, Property, fewest
from twin.campaigns.statistics.statistic import PLACE, Estimate, meaning

SHOWN = 2000  # points of a plot


def sections(study: Study, result: CampaignResult, table: Any) -> tuple[Section, ...]:  # noqa: ANN401
    """Sections of the page.

    Parameters
    ----------
    table : all rows
    """
    a, kept = result.answers, counted(table)
    command = _command(Path(result.folder))
    parts = [_answer(study, result)]
    if a.map:
        parts.append(_map(a))
    elif study.measures:
        parts.append(Section("map", "Map", (_why_none(study, kept),)))
    if a.cells:
        parts.append(_cells(a))
    if a.influences:
        parts.append(_influences(a, kept, command))
    if (lines := coordinates(a, study, kept, command)) is not None:
        parts.append(lines)
    if a.places is not None:
        parts.append(_footprint(a, kept, command))
    return tuple(parts)


def _answer(study: Study, result: CampaignResult) -> Section:
    a = result.answers
    rows: list[tuple[Cell | str, ...]] = [_estimate(n, e) for n, e in a.estimates.items()]
    meanings = [meaning(n, study.measures) for n in a.estimates]
    for v in result.verdicts:
        word = {True: "failed", False: "passed", None: "undecided"}[v.holds]
        rows.append((f"{v.text}: {word}", *_estimate("", v.estimate)[1:]))
        meanings.append("The statistic of this condition")
    rows = [(*row, said) for row, said in zip(rows, meanings, strict=True)]
    head = ("statistic", "value", f"{100 * study.confidence:.0f} % interval", "runs", "meaning")
    ends = ", ".join(f"{name} {n}" for name, n in a.outcomes.items())
    title = study.title if study.title[-1:] in ".?!" else f"{study.title}."
    flown = f"{title} {result.runs} of {result.planned} runs, by their end: {ends}."
    text = (a.text, flown)
    return Section("answer", "Answer", text, (Table(head, tuple(rows)),))


def _estimate(name: str, e: Estimate) -> tuple[Cell | str, ...]:
    interval = "–" if np.isnan(e.low) else e.interval
    value = f"{e.value:.4g}" if np.isfinite(e.value) else "–"
    return name, Cell(value, "number"), interval, Cell(str(e.n), "number")


def _map(a: Answers) -> Section:
    panels, lines, rows = [], [], []
    for k, p in enumerate(a.map):
        panels.append(
            Panel("", "share of hits" if k % 2 == 0 else "", k // 2, k % 2, x_label=p.name)
        )
        lines.append(Line("probability", p.values, p.share, "run0", k, low=p.low, high=p.high))
        ends = np.array([p.values.min(), p.values.max()])
        lines.append(Line(f"{100 * SHARE:.0f} %", ends, np.full(2, SHARE), "run1", k, "dash"))
        margin = "–" if p.margin is None else f"{p.margin:.2g}"
        effect = a.on_attitude.get(p.name)
        of_error = (_short(effect.rank),) if effect else ("–",) if a.on_attitude else ()
        rows.append((p.name, Cell(f"{p.nominal:.3g}", "number"), p.limit, margin, *of_error))
    caption = (
        "Probability that the measure holds over each parameter with all others at their nominal"
        " values, from a quadratic logistic regression over all runs; the band is the interval of"
        " resampled runs."
    )
    plot = Plot("map", caption, "", tuple(panels), tuple(lines), panel_height=200)
    head: tuple[str, ...] = ("parameter", "nominal", f"limit for {100 * SHARE:.0f} %", "margin")
    about = "Margin: the nominal value over its limit, or the inverse where less is better."
    if a.on_attitude:
        head = (*head, "attitude error")
        about += f" Attitude error: partial rank correlation with {ATTITUDE} over all runs."
    parts: list[Plot | Table] = [plot, Table(head, tuple(rows), about)]
    if a.frontier is not None and np.isfinite(a.frontier.value).any():
        parts.append(_frontier(a.frontier, a.map))
    return Section("map", "Map: what the mission needs", (), tuple(parts))


def _why_none(study: Study, kept: Any) -> str:  # noqa: ANN401
    """Why the runs give no region of the parameters."""
    name = study.measures[0].name
    hits = column(kept.filter(about(study, kept)), name)
    numbers = [c for v in study.vary for c in v.columns if kept.schema.field(c).type == "double"]
    if not numbers:
        return "No map: no number varies."
    together = 1 if study.kind == "star" else len(numbers)
    each = " for each parameter" if study.kind == "star" else f" over {together} parameters"
    met, few = int(np.nansum(hits)), fewest(together)
    if len(hits) < few * (len(numbers) if study.kind == "star" else 1):
        do = "Give a larger n in [design]."
    else:
        limit = "wider" if met < FEWEST else "narrower"
        do = f"Give a {limit} limit in [measure], or other ranges in [vary]."
    return (
        f"No map: {met} of the {len(hits)} runs that it would be about meet {name}."
        f" It needs {few} runs{each}, at least {FEWEST} that meet {name} and {FEWEST}"
        f" that do not. {do}"
    )


def _frontier(f: Frontier, properties: Sequence[Property]) -> Plot:
    """Boundary between two parameters, with the nominal values."""
    of = {p.name: p for p in properties}
    y = of[f.y]
    # an open end of the band is drawn to the end of the range
    ends = [np.clip(v, y.values.min(), y.values.max()) for v in (f.low, f.high)]
    lines = (
        Line(f"{100 * SHARE:.0f} %", f.at, f.value, "run0", low=ends[0], high=ends[1]),
        Line("nominal", np.array([of[f.x].nominal]), np.array([y.nominal]), "run1", 0, "dots"),
    )
    side = "above" if y.better > 0 else "below"
    caption = (
        f"Between the two parameters with the smallest margins, all others at their nominal values:"
        f" {side} the line the measure holds in more than {100 * SHARE:.0f} %. Where the line ends,"
        f" {f.y} has no limit in its range, or already its nominal value is beyond it."
    )
    panels = (Panel("", f.y, x_label=f.x),)
    return Plot("frontier", caption, "", panels, lines, panel_height=260)


def _cells(a: Answers) -> Section:
    rows = []
    for c in a.cells:
        rate = ("–", "–") if c.rate is None else (
            f"{100 * c.rate.value:.1f} %", f"{100 * c.rate.low:.1f} % to {100 * c.rate.high:.1f} %",
        )  # fmt: skip
        rows.append(
            (c.parameter, c.value, Cell(rate[0], "number"), Cell(rate[1], "number"),
             Cell(f"{c.figure.value:.3g}", "number"), Cell(str(c.figure.n), "number"))
        )  # fmt: skip
    head = ("parameter", "value", "success", "interval", f"mean {a.figure}", "runs")
    return Section("values", "By value", (), (Table(head, tuple(rows)),))


def _influences(a: Answers, kept: Any, command: Callable[[int], str]) -> Section:  # noqa: ANN401
    order = sorted(a.influences.items(), key=lambda item: -abs(item[1].rank.value))
    of_all = any(i.first is not None for _, i in order)
    rows = [
        (name, *(_short(e) for e in ((i.rank, i.first, i.total) if of_all else (i.rank,))))
        for name, i in order
    ]
    head: tuple[str, ...] = ("parameter", "partial rank correlation")
    if of_all:
        head = (*head, "Sobol index, first order", "Sobol index, total")
    names = [name for name, _ in order[:4]]
    panels = tuple(
        Panel("", a.figure if k % 2 == 0 else "", k // 2, k % 2, x_label=name)
        for k, name in enumerate(names)
    )
    some, labels = _some(kept, command)
    lines = tuple(
        Line("run", column(some, name), column(some, a.figure), "run0", k, "dots", labels=labels)
        for k, name in enumerate(names)
    )
    caption = f"{a.figure} of the runs over the most influential parameters."
    plot = Plot("scatter", caption, "", panels, lines)
    table = Table(head, tuple(rows), f"Influence on {a.figure}, with intervals.")
    return Section("influence", "What decides", (), (plot, table))


def _short(e: Estimate | None) -> str:
    return "–" if e is None else f"{e.value:+.2f} ({e.low:+.2f} to {e.high:+.2f})"


def _footprint(a: Answers, kept: Any, command: Callable[[int], str]) -> Section:  # noqa: ANN401
    assert a.places is not None
    some, labels = _some(kept, command)
    outline = a.places.outline()
    lines = (
        Line("end of a run", column(some, PLACE[0]), column(some, PLACE[1]), "run0", 0, "dots",
             labels=labels),
        Line("normal ellipse of half the ends", outline[:, 0], outline[:, 1], "run1"),
    )  # fmt: skip
    caption = (
        f"Ends of the runs. Deviations along the axes of the ellipse:"
        f" {a.places.major.text(' m')} and {a.places.minor.text(' m')}. A point shows the command"
        " that flies its run again."
    )
    if "point" in a.outcomes:
        caption += (
            " A flight that passes its point ends 1 s later: this is not the scatter at the point,"
            " which closest_approach_m is."
        )
    panels = (Panel("Footprint", "north [m]"),)
    plot = Plot("footprint", caption, "east [m]", panels, lines, panel_height=380)
    return Section("footprint", "Where the runs end", (), (plot,))


def _command(folder: Path) -> Callable[[int], str]:
    """The command that flies a run again; its recording goes beside the rows."""

    def command(run: int) -> str:
        return shlex.join(["twin", "campaign", "refly", str(folder), str(run)])

    return command


def _some(kept: Any, command: Callable[[int], str]) -> tuple[Any, tuple[str, ...]]:  # noqa: ANN401
    """Rows for a plot, evenly spaced, and the command for each."""
    step = max(1, kept.num_rows // SHOWN)
    some = kept.take(list(range(0, kept.num_rows, step)))
    return some, tuple(command(run) for run in some["run"].to_pylist())
