"""Setpoint programmes: where the nose is to point, over time."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from twin.errors import TwinError

Array = NDArray[np.float64]
Vector = tuple[float, float, float]
UP: Vector = (0.0, 0.0, 1.0)


class Setpoint(Protocol):
    """A programme of nose directions."""

    def direction(self, t: float, position: Array, velocity: Array) -> Array:
        """Return unit nose directions (..., 3) for positions and velocities (..., 3), world."""


def off_axis(launch: Vector, right: float, up: float) -> Vector:
    """Return the unit vector `right` and `up` of a launch direction, as seen along it [rad].

    The angles make a rotation vector, so that the direction lies hypot(right, up) off the launch.
    From a vertical launch, `up` leads to the west and `right` to the south, as for one that leans
    to the east.
    """
    launch = unit(launch, "launch")
    beside = cross(launch, UP)
    beside = unit(beside, "right") if math.hypot(*beside) > 1e-9 else (0.0, -1.0, 0.0)
    above = cross(beside, launch)
    angle = math.hypot(right, up)
    if angle == 0.0:
        return launch
    along, across = math.cos(angle), math.sin(angle) / angle
    a, b, c = (along * launch[k] + across * (right * beside[k] + up * above[k]) for k in range(3))
    return (a, b, c)


def unit(vector: Vector, name: str) -> Vector:
    """Return a vector scaled to length 1; `name` is for the error message.

    Raises
    ------
    TwinError : it has no direction
    """
    length = math.sqrt(sum(c * c for c in vector))
    if not (math.isfinite(length) and length > 0.0):
        raise TwinError(f"{name} {vector}: must not be zero, and must be finite")
    return (vector[0] / length, vector[1] / length, vector[2] / length)


def cross(a: Vector, b: Vector) -> Vector:
    """Return a × b."""
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


@dataclass(frozen=True)
class Hold:
    """Hold one direction.

    Attributes
    ----------
    launch : launch direction, world frame, any length but zero
    axis : world axis about which the nose is turned; by default the one for which a positive angle
        tips the nose down-range (to the east from a vertical launch)
    """

    launch: Vector = UP
    axis: Vector | None = None

    def __post_init__(self) -> None:
        launch = unit(self.launch, "launch")
        axis = self.axis
        if axis is None:
            level = cross(UP, launch)
            axis = level if math.hypot(*level) > 1e-9 else (0.0, 1.0, 0.0)
        along = unit(axis, "axis")
        if math.hypot(*cross(along, launch)) < 1e-9:
            raise TwinError(f"axis {axis} lies along launch {self.launch}; turning does nothing")
        object.__setattr__(self, "launch", launch)
        object.__setattr__(self, "axis", along)
        # Rodrigues' formula at angle a: still + cos(a)·turning + sin(a)·across
        lengthwise = sum(a * b for a, b in zip(along, launch, strict=True))
        still = np.array(along) * lengthwise
        for name, value in (
            ("_still", still),
            ("_turning", np.array(launch) - still),
            ("_across", np.array(cross(along, launch))),
            ("_at_rest", np.array(launch)),
        ):
            value.setflags(write=False)
            object.__setattr__(self, name, value)

    def angle(self, t: float) -> float:  # noqa: ARG002
        """Angle from the launch direction [rad]."""
        return 0.0

    def direction(self, t: float, position: Array, velocity: Array) -> Array:  # noqa: ARG002
        """Wanted nose direction (..., 3), unit, world."""
        a = self.angle(t)
        if a == 0.0 and position.ndim == 1:  # the common case
            return self._at_rest  # type: ignore[attr-defined, no-any-return]
        nose: Array = (
            self._still + math.cos(a) * self._turning + math.sin(a) * self._across  # type: ignore[attr-defined]
        )
        return nose if position.ndim == 1 else np.broadcast_to(nose, position.shape).copy()


@dataclass(frozen=True)
class Step(Hold):
    """One step of `amplitude` [rad] at `begin` [s]."""

    amplitude: float = math.radians(5.0)
    begin: float = 3.0

    def angle(self, t: float) -> float:
        """Angle from the launch direction [rad]."""
        return self.amplitude if t >= self.begin else 0.0


@dataclass(frozen=True)
class Doublet(Step):
    """`amplitude` [rad] for `duration` [s], its negative for as long, then zero."""

    duration: float = 1.5

    def angle(self, t: float) -> float:
        """Angle from the launch direction [rad]."""
        if not self.begin <= t < self.begin + 2.0 * self.duration:
            return 0.0
        return self.amplitude if t < self.begin + self.duration else -self.amplitude


@dataclass(frozen=True)
class PitchOver(Step):
    """Turn by `amplitude` [rad] within `duration` [s], like the start of a gravity turn.

    Half a cosine: the angular acceleration is at most amplitude·π²/(2·duration²).
    """

    duration: float = 4.0

    def angle(self, t: float) -> float:
        """Angle from the launch direction [rad]."""
        share = min(max((t - self.begin) / self.duration, 0.0), 1.0)
        return self.amplitude * 0.5 * (1.0 - math.cos(math.pi * share))


PROGRAMMES: Mapping[str, type[Hold]] = MappingProxyType(
    {"hold": Hold, "step": Step, "doublet": Doublet, "pitch-over": PitchOver}
)
