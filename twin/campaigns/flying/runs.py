"""The runs of a study by number: their values, and one of them flown to its row."""

import itertools
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from analysis.schema import AnalysisError
from hardware.frames import HardwareError
from twin.campaigns.sampling.design import Streams
from twin.campaigns.sampling.parameters import Binding
from twin.campaigns.sampling.study import Study
from twin.campaigns.sampling.vary import Varied, shown
from twin.campaigns.statistics.figures import FIGURES, figures_of, outcome_of
from twin.errors import CheckError, DivergenceError, TwinError
from twin.experiments.flight.fly import fly

Row = dict[str, Any]
Work = Callable[[int], Row]


class Runs:
    """All runs of a study, in order: every sample in every cell of the grids.

    Run r is sample r // cells in cell r % cells, so that all cells see the same samples. A
    sensitivity study has matrices A, B and A with each column of B (Saltelli et al., Computer
    Physics Communications 181, 2010) in place of cells. In a star each run varies one of the
    parameters with a nominal value, all others of these are nominal.

    Attributes
    ----------
    count : of runs
    columns : parameters of a row
    """

    def __init__(self, study: Study) -> None:
        self._study = study
        self._random = [v for v in study.vary if v.kind != "grid" or study.kind == "sensitivity"]
        self._grids = [v for v in study.vary if v not in self._random]
        cells = itertools.product(*(v.values for v in self._grids))
        self._cells = list(itertools.islice(cells, 1_000_001))
        if len(self._cells) > 1_000_000:
            raise TwinError("[vary]: the grids have more than a million cells")
        names = [s for v in self._random for s in _streams(v)]
        other = [f"{name}/B" for name in names] if study.kind == "sensitivity" else []
        kind = {"grid": "random", "sensitivity": "sobol", "star": "sobol"}.get(
            study.kind, study.kind
        )
        self._streams = Streams(kind, study.n, study.seed, [*names, *other])
        self.matrices = 2 + len(self._random) if other else len(self._cells)
        self._star = tuple(study.nominal) if study.kind == "star" else ()
        self.matrices = len(self._star) or self.matrices
        self.count = study.n * self.matrices
        self.columns = tuple(c for v in study.vary for c in v.columns)

    def sample(self, run: int) -> int:
        """Number of a run's sample."""
        return run // self.matrices

    def values(self, runs: Sequence[int]) -> list[dict[str, Any]]:
        """Values of runs by column."""
        which = np.asarray(runs, np.int64)
        samples, matrix = which // self.matrices, which % self.matrices
        made: dict[str, list[Any]] = {}
        for k, v in enumerate(self._random):
            of_b = (matrix == 1) | (matrix == k + 2)
            swapped = of_b if self._study.kind == "sensitivity" else None
            u = np.stack([self._uniform(s, samples, swapped) for s in _streams(v)])
            made |= dict(zip(v.columns, v.make(u), strict=True))
        for k, name in enumerate(self._star):
            fixed = self._study.nominal[name]
            varied = zip(made[name], (matrix == k).tolist(), strict=True)
            made[name] = [value if varies else fixed for value, varies in varied]
        for k, v in enumerate(self._grids):
            made[v.name] = [self._cells[c][k] for c in matrix.tolist()]
        return [{c: made[c][i] for c in self.columns} for i in range(len(which))]

    def _uniform(self, name: str, samples: Any, swapped: Any) -> Any:  # noqa: ANN401  arrays
        own = self._streams.uniform(name, samples)
        if swapped is None or not swapped.any():
            return own
        return np.where(swapped, self._streams.uniform(f"{name}/B", samples), own)


def _streams(v: Varied) -> list[str]:
    return [v.name] if v.streams == 1 else [f"{v.name}/{k}" for k in range(v.streams)]


def flown(study: Study, runs: Runs, binding: Binding, scratch: Path) -> Work:
    """What makes a row of a run: an ordinary flight without a recording."""

    def work(run: int) -> Row:
        values = runs.values([run])[0]
        row = _row(binding, values, runs.sample(run), scratch)
        return {"run": run, **{c: shown(v) for c, v in values.items()}, **row,
                **{m.name: m.of({**values, **row}) for m in study.measures}}  # fmt: skip

    return work


def _row(binding: Binding, values: Mapping[str, Any], sample: int, scratch: Path) -> Row:
    none = dict.fromkeys(FIGURES)
    seed = binding.seed + sample
    try:
        config = binding.config(values, sample, scratch)
        seed = config.seed
        result = fly(config, recorded=False)
    except DivergenceError as error:
        return {"seed": seed, "outcome": "diverged", "reason": str(error), **none}
    except CheckError as error:
        return {"seed": seed, "outcome": "fault", "reason": str(error), **none}
    except (TwinError, AnalysisError, HardwareError) as error:
        return {"seed": seed, "outcome": "refused", "reason": str(error), **none}
    outcome = outcome_of(result)
    reason = result.fault or "; ".join(result.missed) or result.ended
    return {"seed": seed, "outcome": outcome, "reason": reason, **figures_of(result)}
