"""Studies with stand-in physics, and one of the real ones made short."""

import math
from pathlib import Path
from typing import Any

from twin.campaigns.campaign import flying
from twin.campaigns.flying.runs import Runs
from twin.campaigns.flying.store import Store
from twin.campaigns.sampling.study import Study, read
from twin.campaigns.sampling.vary import shown
from twin.campaigns.statistics.figures import FIGURES

HIT = '[measure]\nhit = "end_east_m <= 1"\n'


def study(folder: Path, text: str, name: str = "study") -> Study:
    """A study of this text."""
    file = folder / f"{name}.toml"
    file.write_text(text)
    return read(str(file))


def linear(n: int, *more: str, kind: str = "random", seed: int = 0) -> str:
    """Two independent normal parameters of deviations 3 and 2."""
    normal = '[vary.{}]\ndistribution = "normal"\nmean = {}\nsd = {}\n'
    design = f'[design]\nkind = "{kind}"\nn = {n}\nseed = {seed}\n'
    vary = normal.format("wind_speed", 10, 3), normal.format("wind_azimuth", 0, 2)
    return "\n".join((*vary, design, *more))


def centred(values: dict[str, Any]) -> tuple[float, float]:
    """Place that is linear in the two parameters."""
    return values["wind_speed"] - 10.0, values["wind_azimuth"]


def place(study: Study, runs: Runs, end: Any = centred):
    """Work of a stand-in, from the values to the place where a run ends."""

    def work(run: int) -> dict[str, Any]:
        values = runs.values([run])[0]
        row = dict.fromkeys(FIGURES, 0.0)
        row["end_east_m"], row["end_north_m"] = end(values)
        row["closest_approach_m"] = math.hypot(row["end_east_m"], row["end_north_m"])
        measures = {m.name: m.of({**values, **row}) for m in study.measures}
        return {"run": run, "seed": run, "outcome": "point", "reason": "",
                **{k: shown(v) for k, v in values.items()}, **row,
                **measures}  # fmt: skip

    return work


def flown(study: Study, folder: Path, work: Any = None, workers: int = 2) -> Store:
    """Fly a study of the stand-in into a folder, or go on with it."""
    runs = Runs(study)
    store = Store(
        folder, study, runs.count, {c: str if c == "servo" else float for c in runs.columns}
    )
    if not (folder / "campaign.json").exists():
        store.begin(force=False)
    flying(study, runs, store, work or place(study, runs), workers)
    return store
