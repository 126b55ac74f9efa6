"""`twin campaign`: fly a study, continue it, report it, or fly one of its runs again."""

import os
import time
from collections.abc import Sequence
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from analysis.report import render
from twin import status
from twin.campaigns.flying.cluster import Cluster
from twin.campaigns.flying.engine import Engine, Work, lost_row
from twin.campaigns.flying.runs import Runs, flown
from twin.campaigns.flying.store import Store, column, counted, study_of
from twin.campaigns.progress import Progress
from twin.campaigns.results.answers import answers
from twin.campaigns.results.page import sections
from twin.campaigns.results.result import CampaignResult, Verdict
from twin.campaigns.results.reweight import reweighted
from twin.campaigns.sampling.parameters import Binding, binding
from twin.campaigns.sampling.study import Stop, Study, read
from twin.campaigns.sampling.vary import shown
from twin.campaigns.statistics.statistic import FEWEST, REWEIGHTED, Condition, Estimate, condition
from twin.config.campaign import Campaign
from twin.config.paths import dated
from twin.errors import TwinError
from twin.experiments.flight.fly import fly
from twin.experiments.flight.result import FlightResult

WARM_UP_S = 0.05  # of a flight that loads what all others need


def campaign(config: Campaign) -> CampaignResult | FlightResult:
    """Do what `config.action` says with a study.

    Raises
    ------
    TwinError : in one line, what is wrong
    """
    folder = Path(config.study)
    given = None
    # results stand for their study; a place that cannot be looked at is none
    if os.path.exists(folder / "campaign.json"):  # noqa: PTH110
        given = folder
        config = replace(config, study=study_of(folder), out=config.out or folder)
    study = read(config.study)
    if config.action == "refly":
        return _refly(config, study, given)
    began = time.perf_counter()
    conditions = (*study.fail_if, *(condition(t, study.measures) for t in config.fail_if))
    runs = Runs(study)
    store = _store(config, study, runs)
    try:
        new, cpu_s = _flown(config, study, runs, store)
        wall_s = time.perf_counter() - began
        made = result(study, runs, store, conditions, new, wall_s, cpu_s)
    except KeyboardInterrupt as interrupt:
        if done := store.done:
            interrupt.add_note(
                f"{store.folder} has {done} of {runs.count} runs; `twin campaign resume` continues"
            )
        raise
    if config.reweight is not None:
        more = reweighted(study, read(config.reweight), store.table())
        named = {f"{name}{REWEIGHTED}": e for name, e in more.items()}
        estimates = {**made.answers.estimates, **named}
        made = replace(made, answers=replace(made.answers, estimates=estimates))
    return made if not config.paths else _with_paths(config.paths, study, runs, store, made)


def _flown(config: Campaign, study: Study, runs: Runs, store: Store) -> tuple[int, float | None]:
    """Fly what the action asks for; gives the number of runs flown and their processor time [s].

    The time is None where this machine flew nothing.
    """
    if config.action == "report":
        store.check()
        return 0, None
    bound = binding(study.fly, study.vary, study.folder)
    if config.action == "run":
        store.begin(force=config.force)
    else:
        store.check()
    if done := store.done:
        those = f"all {done}" if done == runs.count else f"{done} of {runs.count}"
        again = "; `twin campaign run` with --force flies them again"
        status.note(f"{store.folder}: {those} flights are already there{again}")
    if done == runs.count:
        return 0, None
    with TemporaryDirectory(prefix="tvc-twin-") as scratch:
        work = flown(study, runs, bound, Path(scratch))
        _warm_up(bound)
        before = _of_children()
        new = flying(study, runs, store, work, config.workers, config.ray)
        # Ray's workers are no children of this process
        return new, _of_children() - before if new and config.ray is None else None


def _of_children() -> float:
    """Processor time of the processes that this one has started and waited for [s]."""
    used = os.times()
    return used.children_user + used.children_system


def flying(
    study: Study, runs: Runs, store: Store, work: Work, workers: int | None = None,
    address: str | None = None,
) -> int:  # fmt: skip
    """Fly what is missing, until the study's end or its stop; gives the number of runs flown.

    Parameters
    ----------
    address : of a cluster of Ray, see `Cluster`; processes of this machine if omitted

    Raises
    ------
    TwinError : rows cannot be written
    """
    done = store.done
    progress = Progress(store.count, done)

    def lost(run: int) -> dict[str, Any]:
        return lost_row(run, runs.sample(run), _shown(runs, run))

    engine: Engine | Cluster = Engine(
        work, store, workers or os.cpu_count() or 1, lost, progress.flown, _load_statistics
    )
    if address is not None:
        engine = Cluster(study, store, address, workers, lost, progress.flown)
    enough = None if study.stop is None else _Watch(study.stop, store, progress)
    store.tidy()
    fragments, last = engine.fragments(), store.parts
    try:
        for part in fragments:
            if enough is not None and enough(part):
                last = part
                break
    finally:
        fragments.close()  # ends the processes
        store.tidy()
    store.discard(last + 1)
    return store.done - done


class _Watch:
    """Whether the interval of a statistic is narrow enough, fragment by fragment.

    The rule of Y. S. Chow, H. Robbins, Annals of Mathematical Statistics 36, 1965, whose intervals
    keep their confidence as the width goes to zero. The width of a rate's interval depends on the
    rate, so a campaign ends somewhat sooner where the rate so far is near 0 or 1; the first look is
    after `FEWEST` runs.
    """

    def __init__(self, stop: Stop, store: Store, progress: Progress) -> None:
        self._stop, self._store, self._progress = stop, store, progress
        self._columns: list[list[np.ndarray]] = [[] for _ in stop.statistic.columns]

    def __call__(self, part: int) -> bool:
        rows = counted(self._store.read(part))
        for values, name in zip(self._columns, self._stop.statistic.columns, strict=True):
            values.append(column(rows, name))
        now = self._stop.statistic.of(
            [np.concatenate(values) for values in self._columns], self._stop.confidence
        )
        self._progress.estimate(self._stop.statistic.name, now)
        return now.n >= FEWEST and now.half_width <= self._stop.half_width


def result(
    study: Study,
    runs: Runs,
    store: Store,
    conditions: Sequence[Condition],
    new: int,
    wall_s: float,
    cpu_s: float | None = None,
) -> CampaignResult:
    """The campaign in numbers, and its page.

    Raises
    ------
    TwinError : there are no rows
    """
    table = store.table()
    kept = counted(table)
    verdicts = tuple(
        Verdict(c.text, estimate, c.holds(estimate))
        for c in conditions
        for estimate in [_estimate(c, kept, study.confidence)]
    )
    page = store.folder / "report.html"
    made = CampaignResult(
        answers(study, runs, table), str(store.folder), str(page), "", runs.count,
        table.num_rows, new, verdicts, wall_s, cpu_s,
    )  # fmt: skip
    render(sections(study, made, table), study.title, page, made.as_dict())
    return made


def _with_paths(
    count: int, study: Study, runs: Runs, store: Store, made: CampaignResult
) -> CampaignResult:
    """The result with a recording of some paths."""
    from twin.campaigns.flying.bundle import bundle  # imports Rerun

    bound, out = binding(study.fly, study.vary, study.folder), store.folder / "paths.rrd"
    figure, about = made.answers.figure, f"# {study.title}\n\n{made.answers.text}"
    bundle(out, runs, bound, store.table(), figure, count, about)
    return replace(made, recording=str(out))


def _estimate(c: Condition, kept: Any, confidence: float) -> Estimate:  # noqa: ANN401  a table
    return c.statistic.of([column(kept, name) for name in c.statistic.columns], confidence)


def _store(config: Campaign, study: Study, runs: Runs) -> Store:
    folder = config.out or Path("runs") / study.name
    probe = _shown(runs, 0)
    kinds = {c: str if isinstance(v, str) else float for c, v in probe.items()}
    return Store(folder, study, runs.count, kinds)


def _shown(runs: Runs, run: int) -> dict[str, Any]:
    return {c: shown(v) for c, v in runs.values([run])[0].items()}


def _warm_up(bound: Binding) -> None:
    """Load and compile in this process what the forked ones then share.

    Raises
    ------
    TwinError : the settings cannot be flown at all
    """
    config = bound.config({}, 0, Path())
    fly(replace(config, duration_s=config.at_s + WARM_UP_S), recorded=False)


def _load_statistics() -> None:
    """Load what the answers need, which takes half a second, while the first runs fly."""
    import_module("scipy.stats")


def _refly(config: Campaign, study: Study, given: Path | None) -> FlightResult:
    runs = Runs(study)
    run = config.run
    assert run is not None  # by the settings
    if run >= runs.count:
        raise TwinError(f"run {run}: must be below {runs.count}, the runs of {study.name}")
    folder = Path("runs") / study.name
    out = config.out or folder
    if out.suffix != ".rrd":
        out = dated(out, f"run-{run}", ".rrd")
    for rows in dict.fromkeys((given or out.parent, out.parent, folder)):
        if (rows / "campaign.json").exists():  # another study's run would not be that of the row
            _store(replace(config, out=rows), study, runs).check()
            break
    values = runs.values([run])[0]
    bound = binding(study.fly, study.vary, study.folder)
    with TemporaryDirectory(prefix="tvc-twin-") as scratch:
        flight = bound.config(values, runs.sample(run), Path(scratch))
        return fly(replace(flight, out=out, force=config.force))
