"""Exact response of first-order modes to stepped inputs, at any times.

Between two changes of a held input every mode of a linear system moves in closed form, so the
response at irregular stamps and after a delay of any fraction of a sample costs no discretisation
error (C. F. Van Loan, "Computing integrals involving the matrix exponential", 1978, here for the
scalar and the double mode).
"""

import numpy as np
from numpy.typing import NDArray

from analysis.array import Array
from analysis.compiled import njit

Complex = NDArray[np.complex128]
Pick = tuple[NDArray[np.intp], Array, int]

_SERIES = 0.05  # below |p h| of this the closed form loses more digits than six terms of the series


@njit(nogil=True)  # pragma: no cover - compiled
def _held_for(p: complex, h: float) -> tuple[complex, complex]:
    """e^(ph), and what a unit input held for h adds to 1/(s−p)."""
    x = p * h
    e = np.exp(x)
    if abs(x) < _SERIES:
        return e, h * (1 + x / 2 * (1 + x / 3 * (1 + x / 4 * (1 + x / 5 * (1 + x / 6)))))
    return e, (e - 1) / p


@njit(nogil=True)  # pragma: no cover - compiled
def _twice_held_for(p: complex, h: float, e: complex, first: complex) -> complex:
    """What the input adds to 1/(s−p)² in the same time; the others of `_held_for`."""
    x = p * h
    if abs(x) < _SERIES:
        return h * h * (0.5 + x * (1 / 3 + x * (1 / 8 + x * (1 / 30 + x * (1 / 144 + x / 840)))))
    return (h * e - first) / p


@njit(nogil=True)  # pragma: no cover - compiled
def modal_response(
    time: Array, input_time: Array, values: Array, poles: Complex, delay: float, twice: bool = True
) -> tuple[Complex, Complex, Array]:
    """States of 1/(s−p) and 1/(s−p)² (n, modes) and the delayed input (n,) at the given times.

    The input starts at zero and takes `values` (k,) at `input_time` (k,) + `delay`. Without
    `twice` there are none of 1/(s−p)² (0, modes), and the others take half the time.
    """
    n, modes, k = len(time), len(poles), len(input_time)
    single = np.zeros((n, modes), dtype=np.complex128)
    double = np.zeros((n if twice else 0, modes), dtype=np.complex128)
    held = np.zeros(n)
    for m in range(modes):
        p = poles[m]
        z1, z2 = 0j, 0j
        e, f1, f2 = 1 + 0j, 0j, 0j
        last_h = -1.0
        u, now, event = 0.0, 0.0, 0
        if k:
            now = input_time[0] + delay
        for row in range(n):
            t = time[row]
            while event < k and input_time[event] + delay <= t:
                change = input_time[event] + delay
                h = change - now
                if h > 0.0:
                    e, f1 = _held_for(p, h)
                    if twice:
                        f2 = _twice_held_for(p, h, e, f1)
                        z2 = e * z2 + h * e * z1 + f2 * u
                    last_h = h
                    z1 = e * z1 + f1 * u
                now = change
                u = values[event]
                event += 1
            h = t - now
            if event > 0 and h > 0.0:
                if h != last_h:
                    e, f1 = _held_for(p, h)
                    if twice:
                        f2 = _twice_held_for(p, h, e, f1)
                    last_h = h
                if twice:
                    z2 = e * z2 + h * e * z1 + f2 * u
                z1 = e * z1 + f1 * u
                now = t
            single[row, m] = z1
            if twice:
                double[row, m] = z2
            held[row] = u
    return single, double, held


@njit(nogil=True)  # pragma: no cover - compiled
def write_columns(
    time: Array,
    input_time: Array,
    values: Array,
    poles: Complex,
    delay: float,
    picks: tuple[Pick, Pick],
    columns: Array,
    column: int,
) -> None:
    """Write weighted sums of the states of 1/(s−p) and of the delayed input into `columns`.

    Parameters
    ----------
    picks : rows of the times, what their states weigh (4·modes + 1, m), and the first row of
        `columns` that is written; the weights as in `weights.py`, those of 1/(s−p)² unused
    column : first column that is written
    """
    single, _, held = modal_response(time, input_time, values, poles, delay, False)
    modes = len(poles)
    for rows, weights, first in picks:
        for c in range(weights.shape[1]):
            for i in range(len(rows)):
                total = weights[4 * modes, c] * held[rows[i]]
                for m in range(modes):
                    z = single[rows[i], m]
                    total += weights[m, c] * z.real - weights[modes + m, c] * z.imag
                columns[first + i, column + c] = total


def impulse_response(time: Array, poles: Complex) -> tuple[Complex, Complex]:
    """Free motion of 1/(s−p) and 1/(s−p)² (n, modes) after an impulse at time zero."""
    single: Complex = np.exp(time[:, None] * poles)
    double: Complex = time[:, None] * single
    return single, double
