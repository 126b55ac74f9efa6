"""A bounded servo as found on one axis."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

from analysis.array import Array
from analysis.identify.problem.noise import Pair
from analysis.identify.problem.problem import Problem
from analysis.transfer_function.servo import Structure


@dataclass(frozen=True, slots=True)
class ServoFit:
    """A bounded servo as found on one axis.

    Attributes
    ----------
    structure : where the rate is bounded
    poles : 1 or 2
    theta : denominator (as `basis.denominator`), delay [s], ln rate limit, dead band, backlash
    linear : gain, offsets, biases
    residual : measured − model (rows,)
    jacobian : of the weighted residual in θ and the linear parameters (rows, all)
    noise : of angle [rad] and rate [rad/s]
    losses : on steps held out, of every structure that was tried; a less simple one has to earn
        its place
    idle : limits of speed that the readings do not ask for, and the lowest that they allow, on the
        command's side [rad/s]
    rival : another structure that predicts steps held out as well, and by how much its denominator,
        delay and ln rate limit differ; None without one
    """

    problem: Problem
    structure: Structure
    poles: int
    theta: Array
    linear: Array
    residual: Array
    jacobian: Array
    noise: Pair
    converged: bool
    losses: Mapping[Structure, float] = field(default_factory=dict)
    idle: Mapping[str, float] = field(default_factory=dict)
    rival: tuple[Structure, Array] | None = None

    @property
    def weighted(self) -> Array:
        """Residual over the noise (rows,)."""
        return self.residual * self.problem.weight

    @property
    def gain(self) -> float:
        """Output per command at rest."""
        return float(self.linear[0])

    @property
    def delay(self) -> float:
        """Transport delay [s]."""
        return float(self.theta[self.poles])

    @property
    def rate_limit(self) -> float:
        """Fastest change of the command's side of the gain [rad/s]."""
        return math.exp(self.theta[self.poles + 1])

    @property
    def dead_band(self) -> float:
        """Half width, on the command's side [rad]."""
        return float(self.theta[self.poles + 2])

    @property
    def backlash(self) -> float:
        """Total width at the output [rad]."""
        return float(self.theta[self.poles + 3] * abs(self.gain))
