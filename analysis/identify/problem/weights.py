"""Linear weights that turn the modes' states into the columns of a fit, for angle and for rate.

States are [Re z, −Im z, Re w, −Im w, u]: z of 1/(s−p), w of 1/(s−p)², u the delayed input.
"""

import numpy as np
from numpy.typing import NDArray

from analysis.array import Array
from analysis.identify.problem.basis import Denominator, over_single, over_square
from analysis.identify.problem.layout import Layout


def _stack(
    single: NDArray[np.complex128], double: NDArray[np.complex128] | None, through: Array
) -> Array:
    if double is None:
        double = np.zeros_like(single)
    return np.vstack([single.real, single.imag, double.real, double.imag, through[None, :]])


def _powers(den: Denominator, layout: Layout, highest: int, extra: int) -> Array:
    """Rows a₀ (s/ω)ᵏ sᵉˣᵗʳᵃ, k = 0…highest, descending powers."""
    width = highest + extra + 1
    rows = np.zeros((highest + 1, width))
    for k in range(highest + 1):
        rows[k, width - 1 - k - extra] = den.coefficients[-1] / layout.frequency**k
    return rows


def channel_weights(den: Denominator, layout: Layout, zeros: int) -> tuple[Array, Array]:
    """Weights of the numerator columns on the states: φₖ = a₀ (s/ω)ᵏ/A for angle, sφₖ for rate."""
    pair = []
    for extra in (0, 1):
        single, through = over_single(_powers(den, layout, zeros, extra), den)
        pair.append(_stack(single, None, through))
    return pair[0], pair[1]


def gradient_weights(den: Denominator, layout: Layout, b: Array) -> tuple[Array, Array]:
    """Weights of ∂(Σ bₖφₖ)/∂θ of the channel and, in the last column, ∂/∂delay = −s·."""
    pair = []
    for extra in (0, 1):
        powers = _powers(den, layout, len(b) - 1, extra)
        numerator = b @ powers  # includes a₀
        a0 = den.coefficients[-1]
        rows = []
        for change in den.gradient:
            relative = change[-1] / a0  # ∂a₀/a₀
            rows.append(np.convolve(numerator, relative * den.coefficients - change))
        single, double, through = over_square(np.array(rows), den)
        late, late_through = over_single(np.append(-numerator, 0.0)[None, :], den)
        pair.append(np.hstack([_stack(single, double, through), _stack(late, None, late_through)]))
    return pair[0], pair[1]


def free_weights(den: Denominator, layout: Layout) -> tuple[Array, Array]:
    """Weights of the n free motions sᵏ/A and of their rates."""
    pair = []
    for extra in (0, 1):
        powers = _powers(den, layout, den.order - 1, extra) / den.coefficients[-1]
        single, through = over_single(powers, den)
        pair.append(_stack(single, None, through))
    return pair[0], pair[1]


def free_gradient(den: Denominator, layout: Layout, c: Array) -> tuple[Array, Array]:
    """Weights of ∂(Σ cₖsᵏ/A)/∂θ."""
    pair = []
    for extra in (0, 1):
        numerator = c @ (_powers(den, layout, den.order - 1, extra) / den.coefficients[-1])
        rows = np.array([-np.convolve(numerator, change) for change in den.gradient])
        single, double, through = over_square(rows, den)
        pair.append(_stack(single, double, through))
    return pair[0], pair[1]
