"""Recursive estimate of a model's properties from the difference of measured and simulated motion.

The difference is linear in small changes of the properties: residual = J θ + noise. The noise of a
fused angle is that of a first-order low-pass; differences r(t) − φ r(t − T) are white. Information
of blocks of a quarter of a second adds up with exponential forgetting (Ljung, System
Identification, 2nd ed., 11.2), and the model's own interval enters as one observation of zero.
"""

import math
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from analysis.array import Array
from analysis.schema import AnalysisError

BLOCK = 0.25  # s
MEMORY = 6.0  # s; time constant of forgetting
FEWEST = 40  # blocks of motion
LONG = 20  # blocks; shorter fits would take the slow part of the noise for motion
WINDOW = 8  # blocks of one estimate of the scatter
INVISIBLE = 1e-9  # of the best known direction's variance: nothing was seen of it
LARGEST_MEMORY = 0.995  # of the noise, from sample to sample


@dataclass(frozen=True, slots=True)
class Property:
    """Something about a gimbal that may change.

    Attributes
    ----------
    name : as in the recording
    unit : of its value as people read it: °, ms or ×
    scale : units to one of the value inside (rad, s or 1)
    value : of the model
    sigma : standard deviation of the model's value; a difference within is none
    lowest : value that is physically possible
    bias : standard deviation that what the model cannot follow adds to an estimate, constant over a
        run and so without effect on its changes
    """

    name: str
    unit: str
    scale: float
    value: float
    sigma: float
    lowest: float = -math.inf
    bias: float = 0.0

    def text(self, value: float) -> str:
        """A value with its unit."""
        return f"{value * self.scale:.2f}{' ' if self.unit == 'ms' else ''}{self.unit}"


@dataclass(frozen=True, slots=True)
class Information:
    """Sums over blocks of one axis, in units of the noise.

    Attributes
    ----------
    time : ends of the blocks (b,) [s]
    normal : JᵀJ (b, k, k)
    right : Jᵀr (b, k)
    noise : standard deviation of the angle's noise [rad]
    count : of readings
    """

    time: Array
    normal: Array
    right: Array
    noise: float
    count: int

    def widened(self, by: float) -> "Information":
        """The same with standard deviations as many times as large."""
        return replace(self, normal=self.normal / by**2, right=self.right / by**2)


@dataclass(frozen=True, slots=True)
class Track:
    """Estimate over time.

    Attributes
    ----------
    time : (b,) [s]
    value : differences from the model (b, k)
    sigma : their standard deviations (b, k)
    """

    time: Array
    value: Array
    sigma: Array


def information(time: Array, residual: Array, sensitivity: Array) -> Information:
    """Sum up what readings (n,) show of k properties with sensitivities (n, k).

    Readings that are NaN are left out. The noise is the median over the blocks of what remains
    of each after a fit of its own, so that a change in the record does not raise it.

    Raises
    ------
    AnalysisError : a record shorter than ten seconds
    """
    block = np.floor((time - time[0]) / BLOCK).astype(int)
    count = int(block[-1])  # the last one is incomplete
    if count < FEWEST:
        raise AnalysisError(
            f"{time[-1] - time[0]:.1f} s of motion; an estimate needs {FEWEST * BLOCK:.0f} s: "
            "record more steps (twin step --repeats)"
        )
    edges = np.searchsorted(block, np.arange(count + 1))
    memory = _memory(residual, sensitivity, edges)
    r, J = _white(residual, memory), _white(sensitivity, memory)
    valid = np.isfinite(r)
    r, J = np.where(valid, r, 0.0), np.where(valid[:, None], J, 0.0)
    sums = [slice(a, b) for a, b in pairwise(edges)]
    normal = np.array([J[s].T @ J[s] for s in sums])
    right = np.array([J[s].T @ r[s] for s in sums])
    rest = np.array([_rest(r[s], J[s], valid[s]) for s in sums])
    variance = max(float(np.nanmedian(rest)), 1e-18)
    noise = float(np.sqrt(variance / (1.0 - memory**2)))
    return Information(time[0] + BLOCK * (np.arange(count) + 1.0), normal / variance,
                       right / variance, noise, int(np.count_nonzero(valid)))  # fmt: skip


def track(info: Information, prior: Array) -> Track:
    """Estimate with forgetting after each block, given the model's own deviations (k,).

    Blocks are weighed by e^(−age/memory), their noise by the square of that.
    """
    keep = np.exp(-BLOCK / MEMORY)
    own = np.diag(prior**-2.0)
    k = len(prior)
    normal, spread, right = np.zeros((k, k)), np.zeros((k, k)), np.zeros(k)
    values, sigmas = np.empty((2, len(info.time), k))
    for b in range(len(info.time)):
        normal = keep * normal + info.normal[b]
        spread = keep**2 * spread + info.normal[b]
        right = keep * right + info.right[b]
        inverse = np.linalg.inv(normal + own)
        values[b] = inverse @ right
        sigmas[b] = np.sqrt(np.diag(inverse @ (spread + own) @ inverse))
    return Track(info.time, values, sigmas)


def fitted(info: Information, rows: slice, prior: Array) -> tuple[Array, Array]:
    """Estimate of some blocks without forgetting, and its standard deviations, (k,) each."""
    inverse = np.linalg.inv(info.normal[rows].sum(axis=0) + np.diag(prior**-2.0))
    return inverse @ info.right[rows].sum(axis=0), np.sqrt(np.diag(inverse))


def scatter(info: Information, prior: Array) -> float:
    """How many times as much estimates of short windows scatter as the noise alone would make them.

    What the model cannot follow scatters them more. By the median of the differences of successive
    windows, as the moving range of a control chart, which one change does not raise; 1 at least.
    Properties that a window shows nothing of do not count.
    """
    count = len(info.time) // WINDOW
    if count < 2:
        return 1.0
    # over the model's own deviations, so that the rank does not depend on units
    shape = (count, WINDOW, len(prior))
    right = (info.right[: count * WINDOW].reshape(shape) * prior).sum(axis=1)
    normal = info.normal[: count * WINDOW].reshape(*shape, len(prior)).sum(axis=1)
    normal = normal * np.outer(prior, prior)
    inverse = np.linalg.inv(normal + np.eye(len(prior)))
    step = np.diff(np.einsum("wij,wj->wi", inverse, right), axis=0)
    spread = inverse @ normal @ inverse
    both = spread[1:] + spread[:-1]
    shown = np.linalg.matrix_rank(both, rtol=INVISIBLE, hermitian=True)
    own = np.linalg.pinv(both, rcond=INVISIBLE, hermitian=True)
    square = np.einsum("wi,wij,wj->w", step, own, step)[shown > 0]
    if not len(square):
        return 1.0
    return max(1.0, math.sqrt(float(np.median(square / chi2.median(shown[shown > 0])))))


def _white(values: Array, memory: float) -> Array:
    out = np.full_like(values, np.nan)
    out[1:] = values[1:] - memory * values[:-1]
    return out


def _memory(residual: Array, sensitivity: Array, edges: NDArray[np.int64]) -> float:
    """Correlation of the noise from one sample to the next, without what blocks can explain."""
    above = below = 0.0
    for a, b in zip(edges[::LONG], edges[LONG::LONG], strict=False):
        r, J = residual[a:b], sensitivity[a:b]
        if len(r) < 4 or not np.isfinite(r).all():
            continue
        rest = r - J @ np.linalg.lstsq(J, r, rcond=None)[0]
        above += float(rest[1:] @ rest[:-1])
        below += float(rest @ rest)
    return min(max(above / below, 0.0), LARGEST_MEMORY) if below > 0.0 else 0.0


def _rest(r: Array, J: Array, valid: NDArray[np.bool_]) -> float:
    """Variance that a fit of one block leaves; NaN where it has too few readings."""
    best, _, seen, _ = np.linalg.lstsq(J, r, rcond=None)
    free = int(np.count_nonzero(valid)) - int(seen)
    if free < J.shape[1]:
        return np.nan
    rest = r - J @ best
    return float(rest @ rest) / float(free)
