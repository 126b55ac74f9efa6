"""The answers of a campaign from its rows."""

from collections import Counter
from typing import Any

from twin.campaigns.result import CampaignResult, Verdict
from twin.campaigns.runs import Runs
from twin.campaigns.statistic import Estimate, cep, mean, statistic
from twin.campaigns.store import Store, column, counted
from twin.campaigns.study import Study

MEANS = ("closest_approach_m", "attitude_error_rms_deg", "apogee_m", "downrange_m")


def answers(
    study: Study,
    runs: Runs,
    store: Store,
    table: Any,  # noqa: ANN401  a table of rows
    verdicts: tuple[Verdict, ...],
    new: int,
    wall_s: float,
) -> CampaignResult:
    """The campaign in numbers, and its page."""
    estimates = _estimates(study, counted(table))
    outcomes = Counter(table["outcome"].to_pylist())
    return CampaignResult(
        "", str(store.folder), "", runs.count, table.num_rows, new,
        dict(outcomes.most_common()), estimates, verdicts, wall_s,
    )  # fmt: skip


def _estimates(study: Study, kept: Any) -> dict[str, Estimate]:  # noqa: ANN401  a table of rows
    """Statistics of the study: rates, the watched one, and those that every flight has."""
    names = [f"{m.name}_rate" for m in study.measures]
    if study.stop is not None:
        names.append(study.stop.statistic.name)
    names += ["cep_m", *(f"{f}_mean" for f in MEANS)]
    made = {}
    for name in dict.fromkeys(names):
        s = statistic(name, study.measures)
        value = s.of([column(kept, c) for c in s.columns], study.confidence)
        if value.n:
            made[name] = value
    return made


__all__ = ["answers", "cep", "mean"]
