"""How far the estimates may be off: Jacobian covariance, and bootstrap over whole steps."""

import itertools
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from analysis.array import Array
from analysis.identify.problem import Solution

_DRAWS = 400
_FEWEST_STEPS = 6  # below, drawing steps says nothing


def whole_jacobian(solution: Solution) -> Array:
    """Weighted ∂model/∂(θ, linear) (rows, all)."""
    return np.hstack([solution.slope, solution.basis])


def covariance(jacobian: Array) -> Array:
    """Covariance of the parameters of a weighted fit (all, all): (JᵀJ)⁻¹.

    With the weights of the true noise this is the Cramér–Rao bound for Gaussian noise.
    """
    scale = np.linalg.norm(jacobian, axis=0)
    scale[scale == 0.0] = 1.0
    normal = (jacobian / scale).T @ (jacobian / scale)
    return np.asarray(np.linalg.pinv(normal, rcond=1e-13, hermitian=True) / np.outer(scale, scale))


def bootstrap(
    jacobian: Array, weighted: Array, steps: NDArray[np.intp], seed: int = 0
) -> Array | None:
    """Covariance of the parameters over steps drawn with replacement (all, all).

    Each draw takes one Gauss–Newton step from the estimate, so hundreds cost as much as one fit; no
    assumption on the noise is made but that one step does not know of another. None with fewer than
    six steps.

    Parameters
    ----------
    jacobian : weighted (rows, all)
    weighted : residual (rows,)
    steps : number of the step of each row (rows,)
    """
    _, steps = np.unique(steps, return_inverse=True)
    count = int(steps.max()) + 1
    if count < _FEWEST_STEPS:
        return None
    scale = np.linalg.norm(jacobian, axis=0)
    scale[scale == 0.0] = 1.0
    order = np.argsort(steps, kind="stable")
    edges = np.searchsorted(steps[order], np.arange(count + 1))
    j, r = jacobian[order] / scale, weighted[order]
    blocks = [slice(a, b) for a, b in itertools.pairwise(edges)]
    normal = np.array([j[b].T @ j[b] for b in blocks])  # (steps, all, all)
    pull = np.array([j[b].T @ r[b] for b in blocks])  # (steps, all)
    rng = np.random.default_rng(seed)
    drawn = rng.multinomial(count, np.full(count, 1.0 / count), size=_DRAWS).astype(float)
    # an offset whose record was not drawn has no equation: a trace of the whole keeps it in place
    anchor = 1e-6 * normal.sum(axis=0)
    anchor[np.diag_indices_from(anchor)] += np.where(np.diag(anchor) == 0.0, 1.0, 1e-12)
    moves = np.linalg.solve(
        np.tensordot(drawn, normal, axes=1) + anchor, (drawn @ pull)[:, :, None]
    )[:, :, 0]
    return np.asarray(np.cov(moves / scale, rowvar=False))


def propagated(function: Callable[[Array], Array], at: Array, cov: Array) -> Array:
    """Covariance of a function of the parameters (m, m), by central differences."""
    spread = np.sqrt(np.clip(np.diag(cov), 0.0, None))
    columns = []
    for i, step in enumerate(spread):
        shift = np.zeros(len(at))
        shift[i] = max(1e-3 * step, 1e-9 * abs(at[i]), 1e-12)
        columns.append((function(at + shift) - function(at - shift)) / (2.0 * shift[i]))
    slope = np.stack(columns, axis=1)
    return np.asarray(slope @ cov @ slope.T)
