"""Start values: simplified refined instrumental variables over a grid of delays and cut-offs.

P. C. Young, "Recursive Estimation and Time-Series Analysis", 2nd ed., 2011, ch. 8 (SRIVC); the
first pass is the least-squares state-variable filter. The readings are filtered as they stand, on
their own stamps, held from the middle of one interval to the middle of the next: good to second
order in the sampling period, which start values can afford.
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from analysis.array import Array
from analysis.identify.problem.basis import (
    Denominator,
    denominator,
    over_single,
    over_square,
    parameters_of,
)
from analysis.identify.problem.modal import modal_response
from analysis.identify.problem.problem import Problem
from analysis.identify.problem.states import Part

_REFINEMENTS = 3


def candidates(problem: Problem, delays: Array, cutoffs: Array) -> Iterator[Array]:
    """Yield denominators' parameters and delays θ worth a search, from each sensor there is."""
    for is_rate in (False, True):
        rows = problem.is_rate == is_rate
        if not rows.any():
            continue
        signals = list(_per_record(problem, is_rate))
        if not signals:
            continue
        for cutoff in cutoffs:
            start = _butterworth(problem.layout.poles, float(cutoff))
            for delay in delays:
                theta = _refine(problem, signals, start, float(delay), is_rate)
                if theta is not None:
                    yield whole_theta(problem, theta, float(delay))


def whole_theta(problem: Problem, poles: Array, delay: float) -> Array:
    """θ with the same denominator in every group and the same delay for every command."""
    layout = problem.layout
    return np.concatenate([np.tile(poles, layout.groups), np.full(len(layout.free_delays), delay)])


def _per_record(problem: Problem, is_rate: bool) -> Iterator[tuple[Part, Array, Array]]:
    for index, part in enumerate(problem.parts):
        mine = (problem.owner == index) & (problem.is_rate == is_rate) & (problem.weight > 0.0)
        if mine.sum() > 3:
            yield part, problem.time[mine], problem.measured[mine]


def _refine(
    problem: Problem,
    signals: list[tuple[Part, Array, Array]],
    start: Array,
    delay: float,
    is_rate: bool,
) -> Array | None:
    layout = problem.layout
    theta, numerator = start, None
    for _ in range(1 + _REFINEMENTS):
        den = denominator(theta)
        blocks = [_regressors(problem, den, s, delay, is_rate, numerator) for s in signals]
        target, regressors, instruments = (np.concatenate(b) for b in zip(*blocks, strict=True))
        try:
            found = np.linalg.lstsq(instruments.T @ regressors, instruments.T @ target, rcond=None)
        except np.linalg.LinAlgError:
            return None
        poles = np.roots(np.concatenate([[1.0], found[0][: layout.poles]]))
        if not np.isfinite(poles).all() or (np.abs(poles) < 1e-9).any():
            return None
        poles = -np.abs(poles.real) - 1e-3 * np.abs(poles) + 1j * poles.imag
        theta = parameters_of(poles)
        numerator = found[0][layout.poles :].reshape(-1)
    return theta if len(theta) == layout.poles else None


def _regressors(
    problem: Problem,
    den: Denominator,
    signal: tuple[Part, Array, Array],
    delay: float,
    is_rate: bool,
    numerator: Array | None,
) -> tuple[Array, Array, Array]:
    """Filtered derivatives: target (n,), regressors and instruments (n, poles + numerators + 1)."""
    part, time, measured = signal
    layout = problem.layout
    extra = int(is_rate)
    middle = time - np.diff(time, prepend=2.0 * time[0] - time[1]) / 2.0
    output = measured - measured[0]
    y = _filtered(den, middle, output, 0.0, time, np.arange(den.order, -1, -1))
    powers = np.arange(layout.zeros + extra, extra - 1, -1)
    u, x = [], np.zeros((len(time), den.order))
    for j in range(layout.inputs):
        moved = part.input[:, j] - part.input[0, j]
        own = layout.delays[j]
        late = delay if np.isnan(own) else own
        u.append(_filtered(den, part.input_time, moved, late, time, powers))
        if numerator is not None:
            b = numerator[j * len(powers) : (j + 1) * len(powers)]
            shifted = np.append(b, np.zeros(extra))
            x += _twice_filtered(den, part.input_time, moved, late, time, shifted)
    constant = _filtered(den, middle[:1], np.ones(1), 0.0, time, np.zeros(1, dtype=int))
    known = np.hstack([*u, constant])
    regressors = np.hstack([-y[:, 1:], known])
    instruments = regressors if numerator is None else np.hstack([-x, known])
    return y[:, 0], regressors, instruments


def _filtered(
    den: Denominator, at: Array, values: Array, delay: float, time: Array, powers: NDArray[np.intp]
) -> Array:
    """Signals sᵏ/A applied to a held input (n, len(powers))."""
    single, _, held = modal_response(time, at, values, den.poles, delay)
    rows = np.zeros((len(powers), den.order + 2))
    rows[np.arange(len(powers)), den.order + 1 - powers] = 1.0
    weights, through = over_single(rows, den)
    return np.asarray((single @ weights).real + held[:, None] * through)


def _twice_filtered(
    den: Denominator, at: Array, values: Array, delay: float, time: Array, numerator: Array
) -> Array:
    """Signals sᵏB/A², k = n−1…0: the noise-free output, filtered as the readings were."""
    single, double, held = modal_response(time, at, values, den.poles, delay)
    width = len(numerator) + den.order
    rows = np.zeros((den.order, width))
    for i in range(den.order):
        rows[i, i + 1 : i + 1 + len(numerator)] = numerator
    one, two, through = over_square(rows, den)
    return np.asarray((single @ one + double @ two).real + held[:, None] * through)


def _butterworth(order: int, cutoff: float) -> Array:
    angles = np.pi * (2.0 * np.arange(1, order + 1) + order - 1.0) / (2.0 * order)
    poles = cutoff * np.exp(1j * angles)
    poles[np.abs(poles.imag) < 1e-9 * cutoff] = -cutoff
    return parameters_of(poles)
