"""Which parameters the model of one axis has."""

from dataclasses import dataclass, replace

import numpy as np

from analysis.array import Array


@dataclass(frozen=True, slots=True)
class Layout:
    """Which parameters the model of one axis has.

    Attributes
    ----------
    poles, zeros : of every channel into this axis
    inputs : number of commands
    own : every channel has a denominator of its own; otherwise they share one
    delays : fixed delay of every command [s], NaN where it is free (inputs,)
    frequency : scale of s in the numerators [rad/s], to keep the columns comparable
    channel_zeros : zeros of each command's channel (inputs,), where they differ; else empty
    """

    poles: int
    zeros: int
    inputs: int
    own: bool
    delays: tuple[float, ...]
    frequency: float = 1.0
    channel_zeros: tuple[int, ...] = ()

    @property
    def groups(self) -> int:
        """Number of denominators."""
        return self.inputs if self.own else 1

    @property
    def free_delays(self) -> tuple[int, ...]:
        """Commands whose delay is searched."""
        return tuple(i for i, d in enumerate(self.delays) if np.isnan(d))

    @property
    def size(self) -> int:
        """Number of searched parameters."""
        return self.groups * self.poles + len(self.free_delays)

    @property
    def numerators(self) -> int:
        """Number of numerator coefficients: they come first among the linear parameters."""
        return sum(self.zeros_of(j) + 1 for j in range(self.inputs))

    def zeros_of(self, column: int) -> int:
        """Zeros of a command's channel."""
        return self.channel_zeros[column] if self.channel_zeros else self.zeros

    def numerator(self, column: int) -> slice:
        """Where the numerator of a command's channel stands among the linear parameters."""
        first = sum(self.zeros_of(j) + 1 for j in range(column))
        return slice(first, first + self.zeros_of(column) + 1)

    def group(self, column: int) -> slice:
        """Where the denominator of a command's channel stands in θ."""
        first = (column if self.own else 0) * self.poles
        return slice(first, first + self.poles)

    def delay(self, theta: Array, column: int) -> float:
        """Delay of a command's channel [s]."""
        if not np.isnan(self.delays[column]):
            return self.delays[column]
        return float(theta[self.delay_place(column)])

    def delay_place(self, column: int) -> int:
        """Where the free delay of a command stands in θ."""
        return self.groups * self.poles + self.free_delays.index(column)

    def of(self, columns: tuple[int, ...], zeros: tuple[int, ...]) -> "Layout":
        """The channels of some commands, with other numbers of zeros."""
        return replace(
            self,
            inputs=len(columns),
            delays=tuple(self.delays[j] for j in columns),
            channel_zeros=zeros,
        )
