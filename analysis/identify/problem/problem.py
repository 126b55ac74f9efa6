"""The fit of one axis: which samples, which parameters, and the projected least-squares problem.

Poles and delays are searched; numerators, offsets, biases and initial motion enter linearly and are
solved for in every step (variable projection: G. H. Golub, V. Pereyra, SIAM J. Numer. Anal. 10,
1973; the Jacobian in the form of L. Kaufman, BIT 15, 1975, whose Gauss–Newton step on the searched
parameters is that of the whole problem).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from analysis.array import Array
from analysis.identify.problem.basis import Denominator, denominator
from analysis.identify.problem.layout import Layout
from analysis.identify.problem.modal import write_columns
from analysis.identify.problem.states import Part, command_changes, free_states, part_states
from analysis.identify.problem.weights import (
    channel_weights,
    free_gradient,
    free_weights,
    gradient_weights,
)

_ILL = 1e-6  # pivot of unit columns: below, squaring the condition costs too many digits


@dataclass(frozen=True, slots=True)
class Solution:
    """Everything known at one θ.

    Rows: angles of all records, then rates. `jacobian` is weighted and complete: searched, then
    linear parameters.
    """

    theta: Array
    linear: Array
    residual: Array  # unweighted, measured − model (rows,)
    weighted: Array  # (rows,)
    projected: Array  # ∂weighted/∂θ with the linear parameters following (rows, θ)
    basis: Array  # weighted columns of the linear parameters (rows, linear)
    slope: Array  # weighted ∂model/∂θ at fixed linear parameters (rows, θ)


@dataclass(frozen=True, slots=True)
class Problem:
    """Weighted least squares of one axis over all records; offsets as `assemble` has them."""

    layout: Layout
    parts: tuple[Part, ...]
    measured: Array  # (rows,)
    is_rate: NDArray[np.bool_]  # (rows,)
    owner: NDArray[np.intp]  # record of each row (rows,)
    time: Array  # (rows,)
    weight: Array  # 1/sigma of each row, 0 where it does not count (rows,)
    offsets: Array  # columns of angle offset(s) and of the gyro bias of each record (rows, …)
    cache: dict[bytes, Solution] = field(default_factory=dict, compare=False, repr=False)

    def weighed(self, weight: Array) -> "Problem":
        """The same problem with other weights."""
        return replace(self, weight=weight, cache={})

    def with_layout(self, layout: Layout) -> "Problem":
        """The same samples for another structure."""
        return replace(self, layout=layout, cache={})

    @property
    def doubt(self) -> float:
        """How far the stamps of all commands may be off together [s], root mean square."""
        # the wait for frames is one rig's: the record that shows most of it counts
        late = min((p.late for p in self.parts if p.late > 0.0), default=0.0)
        return math.hypot(max(p.doubt for p in self.parts), late)

    def channels(self, columns: tuple[int, ...], zeros: tuple[int, ...]) -> "Problem":
        """The same samples, for the channels of some commands only, with these numbers of zeros."""
        parts = tuple(replace(p, input=p.input[:, list(columns)]) for p in self.parts)
        return replace(self, parts=parts, layout=self.layout.of(columns, zeros), cache={})

    def solve(self, theta: Array) -> Solution:
        """Best linear parameters and derivatives at θ."""
        key = theta.tobytes()
        if key not in self.cache:
            self.cache.clear()
            self.cache[key] = self._solve(theta)
        return self.cache[key]

    def _solve(self, theta: Array) -> Solution:
        signals = [self._signals(theta, part) for part in self.parts]
        phi = self._columns([s.values for s in signals])
        basis = phi * self.weight[:, None]
        scale = np.linalg.norm(basis, axis=0)
        scale[scale == 0.0] = 1.0
        q, r = _orthonormal(basis / scale)
        solved = np.linalg.lstsq(r, q.T @ (self.measured * self.weight), rcond=1e-12)[0]
        linear = solved / scale
        residual = self.measured - phi @ linear
        slope = self._slope(signals, linear) * self.weight[:, None]
        projected = -(slope - q @ (q.T @ slope))
        return Solution(theta, linear, residual, residual * self.weight, projected, basis, slope)

    def loss(self, theta: Array) -> float:
        """Sum of weighted squares at θ, without derivatives; infinite where it is none."""
        phi = self._basis(theta)
        basis, target = phi * self.weight[:, None], self.measured * self.weight
        # half the digits of an orthogonal solution, which is enough to rank starts
        gram = basis.T @ basis
        scale = np.sqrt(np.diag(gram))
        scale[scale == 0.0] = 1.0
        found = np.linalg.lstsq(
            gram / np.outer(scale, scale), basis.T @ target / scale, rcond=1e-10
        )[0]
        left = target - basis @ (found / scale)
        power = float(left @ left)
        return power if np.isfinite(power) else np.inf

    def predict(self, theta: Array, linear: Array) -> Array:
        """Model output of every row at given parameters (rows,)."""
        return self._basis(theta) @ linear

    def driven(self, theta: Array, linear: Array) -> Array:
        """What the commands alone make of every row, sensors' offsets and free motion left out."""
        columns = self._basis(theta)
        count = self.layout.numerators
        return np.asarray(columns[:, :count] @ linear[:count])

    def _basis(self, theta: Array) -> Array:
        """Columns of the linear parameters alone, without what a derivative needs."""
        if any(part.free for part in self.parts):
            return self._columns([self._signals(theta, part).values for part in self.parts])
        layout, count = self.layout, self.layout.numerators
        phi = np.empty((len(self.measured), count + self.offsets.shape[1]), order="F")
        phi[:, count:] = self.offsets
        first_angle, first_rate = 0, sum(len(part.angle_rows) for part in self.parts)
        for part in self.parts:
            last_angle = first_angle + len(part.angle_rows)
            for j in range(layout.inputs):
                section = theta[layout.group(j)].tobytes()
                den, angle, rate = _channel(section, layout, layout.zeros_of(j))
                write_columns(
                    part.time,
                    *command_changes(part.input_time, part.input[:, j]),
                    den.poles,
                    layout.delay(theta, j),
                    ((part.angle_rows, angle, first_angle), (part.rate_rows, rate, first_rate)),
                    phi,
                    layout.numerator(j).start,
                )
                phi[first_angle:last_angle, layout.numerator(j).start] += part.input[0, j]
            first_angle, first_rate = last_angle, first_rate + len(part.rate_rows)
        return phi

    # The layout of the linear parameters: numerators of each command, angle offset(s), gyro bias of
    # each record, then the initial motion of each record that has one.
    def _columns(self, values: Sequence["_Values"]) -> Array:
        count = self.layout.numerators
        free = [v.free_angle.shape[1] for v in values if v.free_angle is not None]
        width = count + self.offsets.shape[1]
        columns = np.zeros((len(self.measured), width + sum(free)), order="F")
        np.concatenate(
            [*(v.angle for v in values), *(v.rate for v in values)], out=columns[:, :count]
        )
        columns[:, count:width] = self.offsets
        for index, value in enumerate(values):
            if value.free_angle is not None and value.free_rate is not None:
                mine = self.owner == index
                after = width + value.free_angle.shape[1]
                columns[mine & ~self.is_rate, width:after] = value.free_angle
                columns[mine & self.is_rate, width:after] = value.free_rate
                width = after
        return columns

    def _signals(self, theta: Array, part: Part) -> "_Signals":
        layout = self.layout
        dens: list[Denominator] = []
        states, angle, rate = [], [], []
        for j in range(layout.inputs):
            section = theta[layout.group(j)].tobytes()
            den, weights_a, weights_r = _channel(section, layout, layout.zeros_of(j))
            if len(dens) < layout.groups:
                dens.append(den)
            state = part_states(part, den, j, layout.delay(theta, j))
            columns = state[part.angle_rows] @ weights_a
            columns[:, 0] += part.input[0, j]
            angle.append(columns)
            rate.append(state[part.rate_rows] @ weights_r)
            states.append(state)
        values = _Values(np.hstack(angle), np.hstack(rate))
        motions: list[Array] = []
        if part.free:
            motions = [free_states(part, den) for den in dens]
            pairs = [free_weights(den, layout) for den in dens]
            values.free_angle = np.hstack(
                [m[part.angle_rows] @ a for m, (a, _) in zip(motions, pairs, strict=True)]
            )
            values.free_rate = np.hstack(
                [m[part.rate_rows] @ r for m, (_, r) in zip(motions, pairs, strict=True)]
            )
        return _Signals(values, dens, states, motions)

    def _slope(self, signals: Sequence["_Signals"], linear: Array) -> Array:
        layout = self.layout
        slope = np.zeros((len(self.measured), layout.size), order="F")
        free_at = len(linear) - sum(layout.groups * layout.poles for p in self.parts if p.free)
        first_rate = sum(len(part.angle_rows) for part in self.parts)
        first_angle = 0
        for part, signal in zip(self.parts, signals, strict=True):
            last_angle = first_angle + len(part.angle_rows)
            last_rate = first_rate + len(part.rate_rows)
            a, r = slope[first_angle:last_angle], slope[first_rate:last_rate]
            for j in range(layout.inputs):
                den, state = signal.dens[j if layout.own else 0], signal.states[j]
                wa, wr = gradient_weights(den, layout, linear[layout.numerator(j)])
                where = np.arange(layout.size)[layout.group(j)]
                if j in layout.free_delays:
                    where = np.append(where, layout.delay_place(j))
                else:
                    wa, wr = wa[:, : layout.poles], wr[:, : layout.poles]
                a[:, where] += state[part.angle_rows] @ wa
                r[:, where] += state[part.rate_rows] @ wr
            for g, motion in enumerate(signal.motions):
                part_linear = linear[free_at : free_at + layout.poles]
                wa, wr = free_gradient(signal.dens[g], layout, part_linear)
                a[:, layout.group(g)] += motion[part.angle_rows] @ wa
                r[:, layout.group(g)] += motion[part.rate_rows] @ wr
                free_at += layout.poles
            first_angle, first_rate = last_angle, last_rate
        return slope


@dataclass(slots=True)
class _Values:
    angle: Array
    rate: Array
    free_angle: Array | None = None
    free_rate: Array | None = None


@dataclass(slots=True)
class _Signals:
    values: _Values
    dens: list[Denominator]
    states: list[Array]
    motions: list[Array]


@lru_cache(maxsize=64)
def _channel(section: bytes, layout: Layout, zeros: int) -> tuple[Denominator, Array, Array]:
    """Denominator of some parameters, and the numerator's weights; delays are searched without."""
    den = denominator(np.frombuffer(section))
    return den, *channel_weights(den, layout, zeros)


def _orthonormal(basis: Array) -> tuple[Array, Array]:
    """Orthonormal columns Q and R of a tall basis of unit columns, or zero ones.

    Cholesky twice over: a tenth of Householder's time on tall matrices, and as orthogonal up to a
    condition of 1e8 (Y. Yamamoto et al., ETNA 44, 2015); beyond, Householder.
    """
    q, r = basis, np.eye(basis.shape[1])
    for _ in range(2):
        gram = q.T @ q
        # a column the weights have emptied (its record held out) stays empty
        gram[np.diag_indices_from(gram)] += np.diag(gram) == 0.0
        try:
            upper = np.linalg.cholesky(gram).T
        except np.linalg.LinAlgError:
            upper = np.zeros_like(gram)
        if np.diag(upper).min(initial=1.0) < _ILL:
            return np.linalg.qr(basis)
        q, r = q @ np.linalg.inv(upper), upper @ r
    return q, r
