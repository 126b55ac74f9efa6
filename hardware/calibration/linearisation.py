"""Nonlinear part of a mechanism: gimbal angle to linearised angle, a polynomial, and back.

Horns and pushrods make the gimbal angle a nonlinear function of the servo shafts. The linearised
angle s is the linear function of the shafts, and with that of the pulse widths, that has the same
value and slope as the gimbal angle at zero. Over the square |x|, |y| ≤ r, with u = x/r and v = y/r,

    s = angle + Σ a_ij uⁱ vʲ,   2 ≤ i + j ≤ degree

for each axis; outside of the square the sum keeps its value at the nearest edge. The slope of s is
strictly diagonally dominant everywhere, which makes the map monotone along each axis and the
inverse unique (contraction in the maximum norm, see `Linearisation.angle`).
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from math import degrees, radians
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from hardware.calibration.errors import CalibrationError
from hardware.frames import Pair

Rows = tuple[tuple[float, ...], ...]
Matrix = tuple[Pair, Pair]
Number = TypeVar("Number", float, NDArray[np.float64])

HIGHEST_DEGREE = 8
SMALLEST_EXTENT, LARGEST_EXTENT = radians(1.0), radians(45.0)
LARGEST_SIGMA = radians(1.0)
FLATTEST, STEEPEST = 0.2, 5.0  # slope along the own axis, minus and plus that across it
GRID = 41  # places per axis at which slopes are checked
NEWTON, FIXED_POINT = 8, 400  # most iterations; 4 of Newton are usual
SOLVED = 1e-12  # rad
# |s − h(θ)| shrinks by (STEEPEST − FLATTEST) / (STEEPEST + FLATTEST) with each fixed-point step.
STEP = 2.0 / (STEEPEST + FLATTEST)


@dataclass(frozen=True, slots=True)
class Linearisation:
    """Polynomial from gimbal angles to linearised angles.

    Parameters
    ----------
    x, y : coefficients per axis [rad], a row for each degree from 2 on, of which row d has the
        d + 1 factors of uᵈ, uᵈ⁻¹v, …, vᵈ; no rows for a straight line
    extent : half width r of the square it was fitted to [rad]
    sigma : standard deviation of what the polynomial leaves open [rad]

    Raises
    ------
    CalibrationError : another shape, values that are not finite, or not monotone over the square
    """

    x: Rows = ()
    y: Rows = ()
    extent: float = radians(10.0)
    sigma: float = 0.0
    _value: tuple[Rows, Rows] = field(init=False, repr=False, compare=False)
    _slope: tuple[Rows, Rows, Rows, Rows] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        _check_numbers(self)
        x, y, r = _columns(self.x), _columns(self.y), self.extent
        slope = _along(x, r), _across(x, r), _along(y, r), _across(y, r)
        object.__setattr__(self, "_value", (x, y))
        object.__setattr__(self, "_slope", slope)
        _check_slopes(self)

    @property
    def straight(self) -> bool:
        """Whether the map is the identity."""
        return not self.x

    def linearised(self, angle: Pair) -> Pair:
        """Return the linearised angle of a gimbal angle [rad]; any finite angle has one."""
        x, y = angle
        if not self.x:
            return x, y
        u, v = self._unit(x, y)
        return x + _sum(self._value[0], u, v), y + _sum(self._value[1], u, v)

    def slope(self, angle: Pair) -> Matrix:
        """Return the derivative of the linearised angle, rows x and y [1]."""
        if not self.x:
            return (1.0, 0.0), (0.0, 1.0)
        x, y = angle
        u, v = self._unit(x, y)
        xu, xv, yu, yv = self._slope
        # Beyond the edge the sum does not change any more.
        p = 1.0 if abs(x) <= self.extent else 0.0
        q = 1.0 if abs(y) <= self.extent else 0.0
        return (
            (1.0 + p * _sum(xu, u, v), q * _sum(xv, u, v)),
            (p * _sum(yu, u, v), 1.0 + q * _sum(yv, u, v)),
        )

    def angle(self, linearised: Pair) -> Pair:
        """Return the gimbal angle of a linearised angle [rad].

        Newton's method; should it not arrive, a fixed-point iteration that always does, because
        the slopes were checked: θ ← θ + λ (s − h(θ)) is a contraction in the maximum norm for a
        slope matrix whose diagonal exceeds the rest of its row.
        """
        s, t = linearised
        if not self.x:
            return s, t
        x, y = s, t
        for _ in range(NEWTON):
            a, b = self.linearised((x, y))
            e, f = s - a, t - b
            if abs(e) + abs(f) < SOLVED:
                return x, y
            (p, q), (r, w) = self.slope((x, y))
            scale = 1.0 / (p * w - q * r)
            x, y = x + (w * e - q * f) * scale, y + (p * f - r * e) * scale
        x, y = s, t
        for _ in range(FIXED_POINT):
            a, b = self.linearised((x, y))
            e, f = s - a, t - b
            x, y = x + STEP * e, y + STEP * f
            if abs(e) + abs(f) < SOLVED:
                break
        return x, y

    def _unit(self, x: float, y: float) -> Pair:
        """Place in the square, −1…1."""
        u, v = x / self.extent, y / self.extent
        return min(max(u, -1.0), 1.0), min(max(v, -1.0), 1.0)


def _sum(columns: Rows, u: Number, v: Number) -> Number:
    """Horner's rule in v over columns that are polynomials in u, highest powers first."""
    total = zero = 0.0 * u
    for column in columns:
        part = zero
        for factor in column:
            part = part * u + factor
        total = total * v + part
    return total


def _columns(rows: Rows) -> Rows:
    """Coefficients by falling power of v, and in each by falling power of u."""
    degree = len(rows) + 1 if rows else 0
    powers: list[list[float]] = [[0.0] * (degree - j + 1) for j in range(degree + 1)]
    for total, row in enumerate(rows, 2):
        for j, factor in enumerate(row):
            powers[j][degree - total] = factor
    return tuple(tuple(p) for p in reversed(powers))


def _along(columns: Rows, extent: float) -> Rows:
    """Derivative over x."""
    return tuple(
        tuple(a * (len(c) - 1 - k) / extent for k, a in enumerate(c[:-1])) for c in columns
    )


def _across(columns: Rows, extent: float) -> Rows:
    """Derivative over y."""
    last = len(columns) - 1
    return tuple(
        tuple(a * (last - k) / extent for a in column) for k, column in enumerate(columns[:-1])
    )


def _check_numbers(map_: Linearisation) -> None:
    if len(map_.x) != len(map_.y) or len(map_.x) > HIGHEST_DEGREE - 1:
        raise CalibrationError(
            f"linearisation has {len(map_.x)} and {len(map_.y)} rows, must be as many for x as for"
            f" y and at most {HIGHEST_DEGREE - 1}"
        )
    for rows in (map_.x, map_.y):
        for total, row in enumerate(rows, 2):
            if len(row) != total + 1:
                raise CalibrationError(
                    f"linearisation row of degree {total} has {len(row)} numbers, must have"
                    f" {total + 1}"
                )
    numbers = [*_flat(map_), map_.extent, map_.sigma]
    if not all(math.isfinite(v) and abs(v) <= LARGEST_EXTENT for v in numbers):
        raise CalibrationError("linearisation must hold finite angles of at most 45°")
    if not SMALLEST_EXTENT <= map_.extent <= LARGEST_EXTENT:
        raise CalibrationError(
            f"linearisation extent is {degrees(map_.extent):.3g}°, must be 1…45°"
        )
    if not 0.0 <= map_.sigma <= LARGEST_SIGMA:
        raise CalibrationError(f"linearisation sigma is {degrees(map_.sigma):.3g}°, must be 0…1°")


def _flat(map_: Linearisation) -> Iterator[float]:
    return (a for rows in (map_.x, map_.y) for row in rows for a in row)


def _check_slopes(map_: Linearisation) -> None:
    """Refuse a map whose slope is not diagonally dominant somewhere, between grid places too."""
    if map_.straight:
        return
    u, v = np.meshgrid(*(np.linspace(-1.0, 1.0, GRID),) * 2, indexing="ij")
    xu, xv, yu, yv = (_sum(c, u, v) for c in map_._slope)
    for name, rows, own, other in (("x", map_.x, 1.0 + xu, xv), ("y", map_.y, 1.0 + yv, yu)):
        # Second derivatives of uⁱvʲ in the square sum to at most d (d − 1).
        bend = sum(abs(a) * d * (d - 1) for d, row in enumerate(rows, 2) for a in row)
        between = bend / map_.extent / (GRID - 1)
        # Beyond the edge along its own axis the slope is 1, and the one across is still there.
        least = float((np.minimum(own, 1.0) - np.abs(other)).min()) - between
        most = float((np.maximum(own, 1.0) + np.abs(other)).max()) + between
        if not (least >= FLATTEST and most <= STEEPEST):
            raise CalibrationError(
                f"linearisation of {name} is not monotone: its slope, with that across it, reaches"
                f" {least:.2f}…{most:.2f}, must stay within {FLATTEST:g}…{STEEPEST:g}"
            )
