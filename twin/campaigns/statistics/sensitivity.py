"""Which parameters decide a figure: rank correlations, and Sobol indices if the design allows."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
import scipy  # its part `stats` takes half a second and is loaded where it is used
from numpy.typing import NDArray

from twin.campaigns.statistics.statistic import Estimate

Array = NDArray[np.float64]
RESAMPLES = 200


@dataclass(frozen=True)
class Influence:
    """Influence of one parameter on one figure, with intervals; None where it is not estimated.

    Attributes
    ----------
    rank : partial rank correlation, the other parameters' linear effect on the ranks removed
    first, total : Sobol indices of first and of all orders
    """

    rank: Estimate
    first: Estimate | None = None
    total: Estimate | None = None


def rank_influences(
    parameters: Mapping[str, Array], figure: Array, confidence: float
) -> dict[str, Influence]:
    """Partial rank correlations with bootstrap intervals.

    Source: R. L. Iman, W. J. Conover, Technometrics 21 (1979).
    """
    kept = np.isfinite(figure)
    names = [n for n, v in parameters.items() if np.ptp(v[kept]) > 0.0] if kept.any() else []
    n = int(kept.sum())
    if not names or n < 3 * len(names) + 10 or not np.ptp(figure[kept]) > 0.0:
        return {}
    table = np.stack([*(parameters[name][kept] for name in names), figure[kept]], axis=1)
    rng = np.random.default_rng(n)
    value = _partial(table)
    many = np.array([_partial(table[rng.integers(0, n, n)]) for _ in range(RESAMPLES)])
    tail = 0.5 - 0.5 * confidence
    low, high = np.quantile(many, [tail, 1.0 - tail], axis=0)
    return {
        name: Influence(Estimate(float(value[k]), float(low[k]), float(high[k]), n))
        for k, name in enumerate(names)
    }


def _partial(table: Array) -> Array:
    """Partial correlation of each column's ranks with those of the last one."""
    ranks = scipy.stats.rankdata(table, axis=0)
    inverse = np.linalg.pinv(np.corrcoef(ranks, rowvar=False))
    scale = np.sqrt(np.abs(np.diag(inverse)))
    return np.asarray(-inverse[:-1, -1] / (scale[:-1] * scale[-1]))


def sobol_influences(
    names: Sequence[str], runs: NDArray[np.int64], figure: Array, confidence: float
) -> dict[str, tuple[Estimate, Estimate]]:
    """Sobol indices of first and total order from rows of a sensitivity design.

    Samples that lack a run, or the figure in one, are left out (A. Saltelli et al., Computer
    Physics Communications 181, 2010, by `scipy.stats.sobol_indices`).

    Parameters
    ----------
    runs : numbers of the runs (n,)
    figure : of the runs (n,)
    """
    matrices = 2 + len(names)
    samples = int(runs.max(initial=-1)) // matrices + 1
    values = np.full((samples, matrices), np.nan)
    values[runs // matrices, runs % matrices] = figure
    values = values[np.isfinite(values).all(axis=1)]
    n = 1 << (len(values).bit_length() - 1) if len(values) else 0  # scipy asks for a power of two
    values = values[:n] - values[:n].mean() if n else values
    if n < 16 or not np.ptp(values[:, 0]) > 0.0:
        return {}
    parts: dict[Literal["f_A", "f_B", "f_AB"], Array] = {
        "f_A": values[None, :, 0],
        "f_B": values[None, :, 1],
        "f_AB": values.T[2:, None, :],
    }
    indices = scipy.stats.sobol_indices(func=parts, n=n)
    spread = indices.bootstrap(confidence_level=confidence, n_resamples=RESAMPLES)
    estimates = [
        [
            Estimate(float(v), float(low), float(high), n)
            for v, low, high in zip(
                np.ravel(value), np.ravel(of.confidence_interval.low),
                np.ravel(of.confidence_interval.high), strict=True,
            )
        ]
        for value, of in (
            (indices.first_order, spread.first_order), (indices.total_order, spread.total_order),
        )
    ]  # fmt: skip
    return dict(zip(names, zip(*estimates, strict=True), strict=True))
