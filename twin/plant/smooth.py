"""Runge–Kutta steps of a vehicle without moving parts: whole ones, parts where its forces change.

Nothing in such a vehicle moves fast, so that a step may be as long as a control tick. Three things
end that: a corner of the thrust curve, a lug that leaves the rail within centimetres, and air that
turns or slows the vehicle within a step.
"""

import math
from bisect import bisect_right
from itertools import pairwise
from typing import Final

import mujoco
import numpy as np
from numpy.typing import NDArray

from twin.physics.aerodynamics.atmosphere import SEA_LEVEL_DENSITY
from twin.physics.native.ramp import RELEASE
from twin.plant.authority import balance, launch_of, numeric, thrust_curve

Array = NDArray[np.float64]

# Radians or e-foldings of the fastest motion that one step may take: Runge–Kutta of order 4 errs by
# 0.5⁵/120 of it, 3e-4.
REACH: Final = 0.5
# s of a step; docs/convergence.md: longer ones miss its limits and save nothing
LONGEST: Final = 0.02
PARTS: Final = 4  # of the stretch over which the rail releases a lug, one step at most each


def applies(model: mujoco.MjModel) -> bool:
    """Whether a model is one rigid vehicle without springs, loops or an elastic rail."""
    return model.nv == 6 and model.neq == 0 and model.nu == 0 and not on_elastic_rail(model)


def on_elastic_rail(model: mujoco.MjModel) -> bool:
    """Whether the vehicle starts on an elastic rail."""
    parts = [numeric(model, f"ramp_{name}") for name in ("length", "stiffness")]
    return all(part is not None and part[0] > 0.0 for part in parts)


class Smooth:
    """Divides steps of the vehicle whose `position` and `velocity` (3,) are views of its state."""

    def __init__(self, model: mujoco.MjModel, position: Array, velocity: Array) -> None:
        self._position, self._velocity = position, velocity
        curve = thrust_curve(model)
        self._corners = [] if curve is None else np.unique(curve[0]).tolist()
        self._rate = _rate(model)
        self._start = launch_of(model)[1]
        self._rail, self._ends = _rail(model)
        self.reset()

    def reset(self) -> None:
        """Begin at the launch again."""
        self._on_rail = bool(self._ends)

    def lengths(self, t: float, dt: float) -> list[float]:
        """Steps [s] that take the place of one of `dt` from simulation time `t` on [s]."""
        speed = math.hypot(*self._velocity.tolist())
        parts = self._rate * speed * dt / REACH
        if self._on_rail:
            parts = max(parts, self._release(speed, dt))
        corners = self._corners
        k = bisect_right(corners, t + 1e-9)
        if parts <= 1.0 and (k == len(corners) or corners[k] >= t + dt - 1e-9):
            return [dt]
        ends = [t, *(c for c in corners[k:] if c < t + dt - 1e-9), t + dt]
        steps = []
        for begin, end in pairwise(ends):
            n = max(1, math.ceil(parts * (end - begin) / dt - 1e-6))
            steps += [(end - begin) / n] * n
        return steps

    def _release(self, speed: float, dt: float) -> float:
        """Parts of a step in which a lug may leave the rail; 1 of any other."""
        travel = math.dist(self._position.tolist(), self._start)
        farthest = (2.0 * speed + 1.0) * dt  # it accelerates
        if travel > self._rail:
            self._on_rail = False
        elif any(travel < end < travel + farthest + RELEASE for end in self._ends):
            return farthest / (RELEASE / PARTS)
        return 1.0


def _rail(model: mujoco.MjModel) -> tuple[float, tuple[float, ...]]:
    """Travel at which the last lug leaves the rail, and that of each lug [m]; none without one."""
    length, lugs = numeric(model, "ramp_length"), numeric(model, "ramp_lug")
    if length is None or lugs is None or length[0] <= 0.0:
        return 0.0, ()
    apart = lugs[1] - lugs[0]
    if length[0] < apart:  # a stand, `twin.physics.native.guide`
        apart = 0.0
    return float(length[0]), (float(length[0] - apart), float(length[0]))


def _rate(model: mujoco.MjModel) -> float:
    """Fastest motion of the vehicle in the air of the ground, per speed [1/m].

    Of pitching, pitch and roll damping, and an open parachute's deceleration.
    """
    mass, station, transverse, axial = balance(model)

    def of(name: str) -> Array:
        value = numeric(model, name)
        return np.zeros(1) if value is None else value

    slope = np.concatenate([of("air_nose_slope"), of("air_fin_slope")])
    arm = np.concatenate([of("air_nose_z"), of("air_fin_z")]) - station
    half, area = 0.5 * SEA_LEVEL_DENSITY, float(of("air_reference_area")[0])
    turning = half * area * float(np.abs(slope * arm).sum()) / transverse
    damping = area * float((slope * arm**2).sum()) + float(of("air_pitch_damping")[0])
    rolling = half * float(of("air_roll_damping")[0]) / axial
    slowing = 2.0 * half * float(of("chute_drag_area").sum()) / mass
    return max(math.sqrt(turning), half * damping / transverse, rolling, slowing)
