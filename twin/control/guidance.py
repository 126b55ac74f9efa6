"""Steering to a fixed point in space, a demonstration for simulation only.

The point must lie within 30° of the launch direction. The law is the energy-optimal approach to a
fixed point: the miss that would remain without further steering, divided by the time to go squared,
times three (P. Zarchan, Tactical and Strategic Missile Guidance, 6th ed., 2012,
ch. 8: zero effort miss). Gravity is part of the predicted path,
so the law does not compensate it.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.compiled import njit
from hardware.parts import STANDARD_GRAVITY as GRAVITY
from twin.control.attitude import interpolate
from twin.control.setpoint import UP, Vector, unit
from twin.errors import TwinError

Array = NDArray[np.float64]
CONE = math.radians(30.0)
_SLACK = 1e-6  # rad; rounding of a point at exactly 30°


@dataclass(frozen=True)
class FixedPoint:
    """Nose directions that take the vehicle through one point.

    Attributes
    ----------
    target : the point, world frame [m]
    launch : launch direction; the point must lie within 30° of it
    origin : launch point, world [m]
    navigation : gain on the predicted miss; 3 is optimal in energy
    mass : of the vehicle [kg]
    thrust_time, thrust : motor's thrust [N] at times [s]
    normal_force : ½ρ·area·slope of the normal force, [N per rad per (m/s)²]
    drag : ½ρ·area·drag coefficient [N per (m/s)²]
    most : largest angle between nose and velocity [rad]
    begin : time until which the launch direction is held [s]
    last : lower limit of the time to go in the gain [s]; the attitude loop could not follow faster
    """

    target: Vector
    launch: Vector = UP
    origin: Vector = (0.0, 0.0, 0.0)
    navigation: float = 3.0
    mass: float = 1.0
    thrust_time: tuple[float, ...] = (0.0,)
    thrust: tuple[float, ...] = (13.0,)
    normal_force: float = 0.011
    drag: float = 0.0007
    most: float = math.radians(25.0)
    begin: float = 0.7
    last: float = 0.3

    def __post_init__(self) -> None:
        launch = unit(self.launch, "launch")
        line = np.subtract(self.target, self.origin)
        distance = float(np.linalg.norm(line))
        if not (math.isfinite(distance) and distance > 0.0):
            raise TwinError(f"target {self.target}: must be finite and away from the launch point")
        across = float(np.linalg.norm(np.cross(launch, line)))
        angle = math.atan2(across, float(np.dot(launch, line)))
        if angle > CONE + _SLACK:
            raise TwinError(
                f"target {self.target}: {math.degrees(angle):.1f}° off the launch direction; must"
                f" be within {math.degrees(CONE):.0f}°"
            )
        object.__setattr__(self, "launch", launch)
        fixed = np.array(
            [*self.target, *launch, self.navigation, self.mass, self.normal_force, self.drag,
             self.most, self.begin, self.last], dtype=np.float64,
        )  # fmt: skip
        times, thrust = np.array(self.thrust_time, float), np.array(self.thrust, float)
        for name, value in (("_fixed", fixed), ("_times", times), ("_thrust", thrust)):
            value.setflags(write=False)
            object.__setattr__(self, name, value)

    def direction(self, t: float, position: Array, velocity: Array) -> Array:
        """Wanted nose direction (..., 3), unit, for position and velocity (..., 3) in the world."""
        out = np.empty(position.shape)
        _directions(
            t, position.reshape(-1, 3), velocity.reshape(-1, 3),
            self._fixed, self._times, self._thrust, out.reshape(-1, 3),  # type: ignore[attr-defined]
        )  # fmt: skip
        return out


@njit(nogil=True)
def _time_to_go(distance: float, speed: float, push: float) -> float:
    """Time for a distance at a speed that changes by `push` [m/s²]."""
    root = speed * speed + 2.0 * push * distance
    if root <= 0.0:
        return 2.0 * distance / speed
    return 2.0 * distance / (speed + math.sqrt(root))


@njit(nogil=True)
def _directions(
    t: float, position: Array, velocity: Array, fixed: Array, times: Array, thrusts: Array,
    out: Array,
) -> None:  # fmt: skip
    target, launch = fixed[0:3], fixed[3:6]
    navigation, mass, normal_force, drag, most, begin, last = fixed[6:13]
    thrust = interpolate(t, times, thrusts)
    for k in range(len(out)):
        v = velocity[k]
        speed = math.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
        line = target - position[k]
        distance = math.sqrt(line[0] ** 2 + line[1] ** 2 + line[2] ** 2)
        closing = (line[0] * v[0] + line[1] * v[1] + line[2] * v[2]) / max(distance, 1e-9)
        if t < begin or speed < 3.0 or closing < 0.2 * speed:
            if t < begin or speed < 3.0:
                out[k] = launch
            else:
                out[k] = v / speed  # past the point, or turned away from it: fly straight ahead
            continue
        ahead = v / speed
        push = (thrust - drag * speed * speed) / mass - GRAVITY * ahead[2]
        go = max(_time_to_go(distance, closing, push), last)
        miss = line - v * go
        miss[2] += 0.5 * GRAVITY * go * go
        along = miss[0] * ahead[0] + miss[1] * ahead[1] + miss[2] * ahead[2]
        steer = navigation / (go * go) * (miss - along * ahead)
        need = math.sqrt(steer[0] ** 2 + steer[1] ** 2 + steer[2] ** 2)
        # force across the path for small angles: thrust component and normal force of the air
        lean = min(need * mass / max(thrust + normal_force * speed * speed, 0.1), most)
        out[k] = math.cos(lean) * ahead + math.sin(lean) / max(need, 1e-9) * steer
