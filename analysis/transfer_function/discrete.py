"""Exact discretisation of delayed transfer functions under a held input, and its simulation."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from analysis.array import Array
from analysis.transfer_function.servo import Servo, play, shaped_commands

# A delay this close to a whole number of steps is that number: writing 0.012 s as a decimal
# fraction costs up to 1e-16, a clock never resolves a billionth of a step.
_WHOLE = 1e-9


@dataclass(frozen=True)
class DiscreteChannel:
    """x⁺ = A x + now·u[k−shift] + before·u[k−shift−1],  y = C x + D·u[k−shift−late].

    Attributes
    ----------
    A : (n, n); now, before, C : (n,); D : scalar feedthrough
    shift : whole steps of delay
    late : 1 where the delay has a fraction of a step left over, else 0
    """

    A: Array  # (n, n)
    now: Array  # (n,)
    before: Array  # (n,)
    C: Array  # (n,)
    D: float
    shift: int
    late: int

    def __post_init__(self) -> None:
        for array in (self.A, self.now, self.before, self.C):
            array.setflags(write=False)

    @property
    def zero(self) -> bool:
        """Whether nothing passes through."""
        return self.D == 0.0 and not self.C.any()

    @property
    def memory(self) -> int:
        """How many past commands it needs."""
        return 0 if self.zero else self.shift + self.late


def realise(num: Sequence[float], den: Sequence[float]) -> tuple[Array, Array, Array, float]:
    """State space (A, B, C, D) of num(s)/den(s) in controllable canonical form.

    Time is scaled by the poles' geometric mean first, so that the entries of A stay within a few
    decades whatever the bandwidth (T. Kailath, Linear Systems, 1980, §2.1 for the form).
    """
    a = np.asarray(den, dtype=np.float64) / den[0]
    n = len(a) - 1
    b = np.zeros(n + 1)
    b[n + 1 - len(num) :] = np.asarray(num, dtype=np.float64) / den[0]
    nonzero = np.flatnonzero(a)[-1]
    rate = float(np.abs(a[nonzero]) ** (1.0 / nonzero)) if nonzero else 1.0
    scale = rate ** -np.arange(n + 1.0)
    a, b = a * scale, b * scale
    A = np.zeros((n, n))
    if n:
        A[0] = -a[1:]
        A[np.arange(1, n), np.arange(n - 1)] = 1.0
    B = np.zeros(n)
    B[:1] = 1.0
    return A * rate, B * rate, b[1:] - b[0] * a[1:], float(b[0])


def _hold(A: Array, B: Array, time: float) -> tuple[Array, Array]:
    """e^(A·time) and the state a unit input held for `time` leaves behind.

    One exponential of the augmented matrix (C. F. Van Loan, IEEE Trans. AC 23(3), 1978).
    """
    from scipy.linalg import expm

    n = len(B)
    joined = np.zeros((n + 1, n + 1))
    joined[:n, :n], joined[:n, n] = A * time, B * time
    exponential = np.asarray(expm(joined), dtype=np.float64)
    return exponential[:n, :n].copy(), exponential[:n, n].copy()


def whole_steps(delay: float, dt: float) -> tuple[int, float]:
    """Whole steps of a delay, and what is left of it [s], zero where that is rounding."""
    if dt <= 0.0:
        return 0, 0.0
    steps = delay / dt
    shift = int(np.floor(steps + _WHOLE))
    fraction = steps - shift
    return shift, fraction * dt if fraction > _WHOLE else 0.0


def discretise_channel(
    num: Sequence[float], den: Sequence[float], delay: float, dt: float
) -> DiscreteChannel:
    """Exact equivalent of one delayed channel for an input held over steps of `dt` [s].

    A delay of `shift` steps and a rest switches from the older to the newer command `rest` after
    the start of a step; the input matrix is split there.
    """
    A, B, C, D = realise(num, den)
    shift, rest = whole_steps(delay, dt)
    Ad, whole = _hold(A, B, dt)
    if rest == 0.0:
        return DiscreteChannel(Ad, whole, np.zeros_like(whole), C, D, shift, 0)
    advance, now = _hold(A, B, dt - rest)
    _, first = _hold(A, B, rest)
    return DiscreteChannel(Ad, now, advance @ first, C, D, shift, 1)


@dataclass(frozen=True)
class Discrete:
    """Every channel of a model at one step.

    Attributes
    ----------
    dt : step [s]
    channels : rows are outputs, columns inputs
    """

    dt: float
    channels: tuple[tuple[DiscreteChannel, ...], ...]

    @cached_property
    def state_space(self) -> tuple[Array, Array, Array, Array]:
        """One (A, B, C, D) of the whole, the shift registers of past commands included.

        States are the channels' in row order, then per input u[k−1], u[k−2], …
        """
        inputs = len(self.channels[0])
        flat = [(i, j, c) for i, row in enumerate(self.channels) for j, c in enumerate(row)]
        memory = [max(row[j].memory for row in self.channels) for j in range(inputs)]
        starts = np.cumsum([0, *(len(c.now) for _, _, c in flat), *memory])
        registers = starts[len(flat) :]
        n = int(starts[-1])
        A, B = np.zeros((n, n)), np.zeros((n, inputs))
        C, D = np.zeros((len(self.channels), n)), np.zeros((len(self.channels), inputs))

        def feed(rows: slice | int, j: int, age: int, gain: Array | float, state: bool) -> None:
            matrices = (A, B) if state else (C, D)
            if age == 0:
                matrices[1][rows, j] += gain
            else:
                matrices[0][rows, registers[j] + age - 1] += gain

        for k, (i, j, c) in enumerate(flat):
            if c.zero:
                continue
            here = slice(starts[k], starts[k + 1])
            A[here, here] = c.A
            C[i, here] = c.C
            feed(here, j, c.shift, c.now, state=True)
            if c.late:
                feed(here, j, c.shift + 1, c.before, state=True)
            feed(i, j, c.shift + c.late, c.D, state=False)
        for j in range(inputs):
            for age in range(memory[j]):
                feed(int(registers[j]) + age, j, age, 1.0, state=True)
        return A, B, C, D

    def simulate(self, commands: ArrayLike, servo: Servo | None = None) -> Array:
        """Return outputs (n, outputs) [rad] for the commands (n, inputs) [rad] of n steps.

        Row k is the output at the instant command k is set; all was at rest before. `servo`, of
        structure `command`, bounds commands and output.
        """
        u = np.asarray(commands, dtype=np.float64)
        if servo is not None:
            u = shaped_commands(u, self.dt, servo.rate_limit, servo.dead_band)
        A, B, C, D = self.state_space
        x = np.zeros(len(A))
        y = np.empty((len(u), len(C)))
        for k in range(len(u)):
            y[k] = C @ x + D @ u[k]
            x = A @ x + B @ u[k]
        return y if servo is None else play(y, servo.backlash)
