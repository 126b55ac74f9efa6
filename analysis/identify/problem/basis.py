"""Transfer functions of one denominator as weights on its modes, with their derivatives.

A denominator is a product of sections: s² + c₁s + c₀ per pair of poles, and s + c₀ for an odd one.
Its parameters are the logarithms of the c: every section is stable, real and complex pairs are one
smooth family, and a step in the parameter is a relative change.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis.array import Array

Complex = NDArray[np.complex128]

# Two poles closer than this (relative) are pulled apart: their residues would cancel to nothing.
# A pair at distance d from its mean changes c₀ by d², 1e-8 of it: far below any measurement.
_APART = 1e-4


@dataclass(frozen=True, slots=True)
class Denominator:
    """A(s) = Π sections, its modes, and ∂A/∂θ for its parameters θ.

    Attributes
    ----------
    poles : one of every conjugate pair, and the real ones (modes,)
    weight : 2 for a pole that stands for its conjugate too, otherwise 1 (modes,)
    coefficients : A, descending powers of s (n + 1,)
    gradient : ∂A/∂θ, descending powers (n, n + 1)
    """

    poles: Complex
    weight: Array
    coefficients: Array
    gradient: Array

    @property
    def order(self) -> int:
        """Number of poles."""
        return len(self.coefficients) - 1


def denominator(theta: Array) -> Denominator:
    """Denominator with parameters `theta` (n,): ln c₁, ln c₀ of each pair, then ln c₀."""
    sections: list[Array] = []
    poles: list[complex] = []
    weight: list[float] = []
    for i in range(0, len(theta) - 1, 2):
        c1, c0 = np.exp(theta[i : i + 2])
        roots, c0 = _separated_pair(c1, c0, poles)
        sections.append(np.array([1.0, c1, c0]))
        poles += roots
        weight += [2.0] if len(roots) == 1 else [1.0, 1.0]
    if len(theta) % 2:
        c0 = np.exp(theta[-1])
        while _crowded([complex(-c0)], poles):
            c0 *= 1.0 + 2.0 * _APART
        sections.append(np.array([1.0, c0]))
        poles.append(complex(-c0))
        weight.append(1.0)
    whole = _product(sections)
    gradient = np.zeros((len(theta), len(whole)))
    row = 0
    for j, section in enumerate(sections):
        others = _product(sections[:j] + sections[j + 1 :])
        for power in range(len(section) - 2, -1, -1):
            term = section[len(section) - 1 - power] * np.append(others, np.zeros(power))
            gradient[row, len(whole) - len(term) :] = term
            row += 1
    return Denominator(np.array(poles), np.array(weight), whole, gradient)


def parameters_of(poles: NDArray[np.inexact[Any]]) -> Array:
    """Parameters (n,) of the denominator with the given stable poles (n,), pairs complete."""
    real = sorted(-p.real for p in poles if abs(p.imag) <= 1e-9 * abs(p))
    theta = []
    for p in poles:
        if p.imag > 1e-9 * abs(p):
            theta += [np.log(-2.0 * p.real), np.log(abs(p) ** 2)]
    while len(real) > 1:
        slow, fast = real.pop(0), real.pop(0)
        theta += [np.log(slow + fast), np.log(slow * fast)]
    return np.array([*theta, *(np.log(c) for c in real)])


def over_single(numerators: Array, den: Denominator) -> tuple[Complex, Array]:
    """Weights of N(s)/A(s) on the modes (modes, m) and on the input itself (m,).

    Numerators (m, k) in descending powers; derivatives of the input are dropped: they are impulses
    at the instants at which it changes.
    """
    through, rest = _split(numerators, den.coefficients)
    _, slope, _ = _taylor(den.coefficients[None, :], den.poles)
    value, _, _ = _taylor(rest, den.poles)
    return den.weight[:, None] * value / slope, through


def over_square(numerators: Array, den: Denominator) -> tuple[Complex, Complex, Array]:
    """Weights of N(s)/A(s)² on 1/(s−p) and 1/(s−p)² (modes, m) and on the input (m,)."""
    a = den.coefficients
    through, rest = _split(numerators, np.convolve(a, a))
    _, slope, bend = _taylor(a[None, :], den.poles)
    value, tilt, _ = _taylor(rest, den.poles)
    double = value / slope**2
    single = (tilt - value * (bend / slope)) / slope**2
    return den.weight[:, None] * single, den.weight[:, None] * double, through


def _taylor(polynomials: Array, at: Complex) -> tuple[Complex, Complex, Complex]:
    """Values of polynomials (m, k) in descending powers and their first and second derivatives.

    Each (points, m). Horner's scheme over all of them together: `np.polyval` and `np.polyder`, one
    by one, took a fifth of the time of an identification.
    """
    shape = (len(at), len(polynomials))
    value, slope, half_bend = (np.zeros(shape, dtype=np.complex128) for _ in range(3))
    point = at[:, None]
    for coefficients in polynomials.T:
        half_bend = half_bend * point + slope
        slope = slope * point + value
        value = value * point + coefficients
    return value, slope, 2.0 * half_bend


def _split(numerators: Array, den: Array) -> tuple[Array, Array]:
    """Constant part of the quotient of each numerator by the denominator, and the remainders."""
    through, left = np.zeros(len(numerators)), np.array(numerators, dtype=np.float64)
    while left.shape[1] >= len(den):
        through = left[:, 0] / den[0]
        left[:, : len(den)] -= through[:, None] * den
        left = left[:, 1:]
    return through, left


def _separated_pair(c1: float, c0: float, others: list[complex]) -> tuple[list[complex], float]:
    while True:
        spread = c1 * c1 / 4.0 - c0
        least = _APART**2 * c0
        if abs(spread) < least:
            spread = least if spread > 0.0 else -least
            c0 = c1 * c1 / 4.0 - spread
        root = np.sqrt(complex(spread))
        pair = [complex(-c1 / 2.0 + root)]
        if spread > 0.0:
            pair = [complex(-c0 / (c1 / 2.0 + root.real)), complex(-c1 / 2.0 - root)]
        if not _crowded(pair, others):
            return pair, c0
        c0 *= 1.0 + 2.0 * _APART


def _crowded(candidates: list[complex], others: list[complex]) -> bool:
    return any(abs(p - q) < _APART * abs(p) for p in candidates for q in others)


def _product(sections: list[Array]) -> Array:
    whole = np.ones(1)
    for section in sections:
        whole = np.convolve(whole, section)
    return whole
