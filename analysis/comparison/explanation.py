"""Which effects explain a difference of two motions, and how much of it each."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from math import comb

import numpy as np

from analysis.array import Array
from analysis.estimate import Information, fitted, scatter
from analysis.plain import Plain

# Gain in twice the log likelihood that an effect must bring, absolute and by reading: 3 % of the
# variance of the noise.
CERTAIN, BY_READING = 30.0, 0.03


@dataclass(frozen=True, slots=True)
class Share(Plain):
    """What one effect explains of a difference.

    Attributes
    ----------
    effect : its name
    share : of what is explained, 0 … 1; negative where it counteracts the others
    text : its values in the model and by the measurement
    half : half width of the 95 % interval of its share of the whole, over parts of the run; NaN if
        unknown
    alike : effects that, in its place, leave no more of the difference
    """

    effect: str
    share: float
    text: str
    half: float = math.nan
    alike: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Explanation(Plain):
    """A difference of measured and simulated angle of one axis.

    Attributes
    ----------
    axis : its name
    rms, rest, noise : of the difference, of what no effect explains, of the readings [rad]
    shares : largest first
    """

    axis: str
    rms: float
    rest: float
    noise: float
    shares: tuple[Share, ...]

    @property
    def explained(self) -> float:
        """Part of the mean square that the effects explain, 0 … 1."""
        return 1.0 - (self.rest / self.rms) ** 2 if self.rms > 0.0 else 0.0


def subsets(players: Sequence[str]) -> list[frozenset[str]]:
    """All 2ᵏ sets of players, the empty one first."""
    return [frozenset(c) for n in range(len(players) + 1) for c in combinations(players, n)]


def shapley(worth: Mapping[frozenset[str], float], players: Sequence[str]) -> dict[str, float]:
    """Each player's mean contribution over all orders in which they may join.

    Shapley, A value for n-person games, Contributions to the Theory of Games II (1953) 307.

    Parameters
    ----------
    worth : of every set of players
    """
    count = len(players)
    found = {}
    for player in players:
        others = [p for p in players if p != player]
        found[player] = sum(
            (worth[s | {player}] - worth[s]) / (count * comb(count - 1, len(s)))
            for s in subsets(others)
        )
    return found


def jackknife(left: Mapping[frozenset[str], Array], players: Sequence[str]) -> dict[str, float]:
    """Half widths of the 95 % intervals of shares of the whole, leaving out one block at a time.

    Parameters
    ----------
    left : by set of players, what is left in each block (blocks,)
    """
    from scipy.stats import t

    count = len(left[frozenset()])
    without = {s: (b.sum() - b) / (count - 1) for s, b in left.items()}
    found = []
    for k in range(count):
        worth = {s: -float(b[k]) for s, b in without.items()}
        whole = max(-worth[frozenset()], 1e-300)
        found.append([v / whole for v in shapley(worth, players).values()])
    spread = np.std(found, axis=0) * math.sqrt(count - 1)
    return dict(zip(players, (t.ppf(0.975, count - 1) * spread).tolist(), strict=True))


def candidates(
    info: Information, groups: Mapping[str, Sequence[int]], prior: Array, chosen: Sequence[str]
) -> list[str]:
    """Effects that would explain something beside those chosen, the best first.

    By the likelihood of the readings given deviations (k,) that are plausible, to first order.

    Parameters
    ----------
    groups : columns of each effect
    """
    normal, right = info.normal.sum(axis=0), info.right.sum(axis=0)
    columns = [c for name in chosen for c in groups[name]]
    reached = _gain(normal, right, prior, columns)
    gains = {
        name: _gain(normal, right, prior, [*columns, *own]) - reached
        for name, own in groups.items()
        if name not in chosen
    }
    least = max(CERTAIN, BY_READING * info.count)
    return sorted((n for n, g in gains.items() if g > least), key=lambda n: -gains[n])


def deviations(info: Information, prior: Array) -> Array:
    """Standard deviations of parameters (k,) that hold what their rivals would make of them.

    Those in the presence of all other parameters, and by how far freeing these moves each.

    Parameters
    ----------
    info : about the values found, of all parameters
    """
    shift, own = fitted(info, slice(None), prior)
    return np.asarray(np.hypot(own * scatter(info, prior), shift))


def _gain(normal: Array, right: Array, prior: Array, columns: Sequence[int]) -> float:
    at = list(columns)
    own = normal[np.ix_(at, at)] + np.diag(prior[at] ** -2.0)
    return float(right[at] @ np.linalg.solve(own, right[at]))
