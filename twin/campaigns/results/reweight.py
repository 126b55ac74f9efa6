"""A finished campaign as if its inputs had had other distributions, without flying again."""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri

from twin.campaigns.flying.store import column, counted
from twin.campaigns.sampling.study import Study
from twin.campaigns.statistics.statistic import Estimate
from twin.errors import TwinError

Array = NDArray[np.float64]
FEWEST = 30.0  # effective runs


def reweighted(study: Study, other: Study, table: Any) -> dict[str, Estimate]:  # noqa: ANN401
    """Rates and means of a campaign under the distributions of another study.

    Importance weights, normalised; the interval is that of the ratio estimator (A. Owen, Monte
    Carlo theory, methods and examples, 2013, ch. 9). `n` is Kish's effective number of runs.

    Parameters
    ----------
    other : varies the same parameters, with other distributions

    Raises
    ------
    TwinError : parameters differ, have no density, reach beyond those flown, or too few runs
        remain effective
    """
    kept = counted(table)
    weights = np.exp(_log_weights(study, other, kept))
    effective = float(weights.sum() ** 2 / np.maximum((weights**2).sum(), 1e-300))
    if not effective >= FEWEST:
        raise TwinError(
            f"--reweight {other.name}: only {effective:.0f} of {len(weights)} runs are effective;"
            f" its distributions must lie within those flown, and {FEWEST:.0f} are needed"
        )
    names = {f"{m.name}_rate": m.name for m in study.measures}
    names["closest_approach_m_mean"] = "closest_approach_m"
    made = {}
    for name, figure in names.items():
        values = column(kept, figure)
        good = np.isfinite(values)
        if good.any():
            made[name] = _ratio(values[good], weights[good], study.confidence)
    return made


def _ratio(values: Array, weights: Array, confidence: float) -> Estimate:
    share = weights / weights.sum()
    value = float(share @ values)
    deviation = math.sqrt(float(share**2 @ (values - value) ** 2))
    half = float(ndtri(0.5 + 0.5 * confidence)) * deviation
    return Estimate(value, value - half, value + half, int(1.0 / (share @ share)))


def _log_weights(study: Study, other: Study, kept: Any) -> Array:  # noqa: ANN401
    ours, theirs = ({v.name: v for v in s.vary} for s in (study, other))
    if set(ours) != set(theirs):
        odd = sorted(set(ours) ^ set(theirs))[0]
        raise TwinError(f"--reweight {other.name}: both studies must vary {odd}")
    total = np.zeros(kept.num_rows)
    for name, was in ours.items():
        new = theirs[name]
        if was.spec == new.spec:
            continue
        if was.density is None or new.density is None:
            raise TwinError(
                f"--reweight {other.name}: {name} must be normal, uniform or lognormal in both"
            )
        if was.relative != new.relative:
            raise TwinError(f"--reweight {other.name}: {name} must be relative in both or in none")
        (low, high), (least, most) = was.support, new.support
        if least < low or most > high:
            raise TwinError(
                f"--reweight {other.name}: {name} from {least:g} to {most:g}: must lie within"
                f" {low:g} to {high:g}, the values that were flown"
            )
        x = column(kept, name)
        total += new.density(x) - was.density(x)
    greatest = total.max(initial=-np.inf)
    return np.asarray(total - greatest) if np.isfinite(greatest) else total
