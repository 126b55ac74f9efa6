"""Which parameters the model of one axis has."""

from dataclasses import dataclass

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
    """

    poles: int
    zeros: int
    inputs: int
    own: bool
    delays: tuple[float, ...]
    frequency: float = 1.0

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

    def group(self, column: int) -> slice:
        """Where the denominator of a command's channel stands in θ."""
        first = (column if self.own else 0) * self.poles
        return slice(first, first + self.poles)

    def delay(self, theta: Array, column: int) -> float:
        """Delay of a command's channel [s]."""
        if not np.isnan(self.delays[column]):
            return self.delays[column]
        return float(theta[self.groups * self.poles + self.free_delays.index(column)])
