"""Steering to a fixed point in space, a demonstration for simulation only.

The point must lie within 30° of the launch direction. The law is the energy-optimal approach to a
fixed point: the miss that would remain without further steering, divided by the time to go squared,
times three (P. Zarchan, Tactical and Strategic Missile Guidance, 6th ed., 2012,
ch. 8: zero effort miss). Gravity is part of the predicted path,
so the law does not compensate it.
"""

import math
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from analysis.compiled import njit
from hardware.parts import STANDARD_GRAVITY as GRAVITY
from twin.control.attitude import interpolate
from twin.control.setpoint import UP, Vector, unit
from twin.errors import TwinError

Array = NDArray[np.float64]
CONE = math.radians(30.0)
LEAN = math.sin(math.radians(60.0))  # of the nose to the path, at most
_SLACK = 1e-6  # rad; rounding of a point at exactly 30°


class Aim(NamedTuple):
    """A `FixedPoint` for compiled code.

    Attributes
    ----------
    fixed : its target, launch direction and numbers
    curve : (2, n) times and thrust
    wind : (3, n) heights, wind to the east and to the north
    """

    fixed: Array
    curve: Array
    wind: Array


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
    wind_height, wind_east, wind_north : mean wind [m/s] at heights above ground [m]; still air if
        omitted
    most : largest angle between nose and air at and above the airspeed `brisk` [rad]; below, it
        grows with the square of the speed, so that the load of the air stays the same
    brisk : that airspeed [m/s]
    begin : time until which the launch direction is held [s]
    last : lower limit of the time to go in the gain [s]; the attitude loop could not follow faster
    aim : for compiled code, which calls `directions`
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
    wind_height: tuple[float, ...] = (0.0,)
    wind_east: tuple[float, ...] = (0.0,)
    wind_north: tuple[float, ...] = (0.0,)
    most: float = math.radians(25.0)
    brisk: float = 20.0
    begin: float = 0.7
    last: float = 0.3
    aim: Aim = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        launch = unit(self.launch, "launch")
        line = np.subtract(self.target, self.origin)
        distance = float(np.linalg.norm(line))
        if not (math.isfinite(distance) and distance > 0.0):
            raise TwinError(f"target {self.target}: must be finite and away from the launch point")
        across = float(np.linalg.norm(np.cross(launch, line)))
        angle = math.atan2(across, float(np.dot(launch, line)))
        if angle > CONE + _SLACK:
            place = ", ".join(f"{c:.6g}" for c in line.tolist())
            raise TwinError(
                f"target ({place}) m from the launch point: {math.degrees(angle):.1f}° off the"
                f" launch direction; must be within {math.degrees(CONE):.0f}°"
            )
        object.__setattr__(self, "launch", launch)
        fixed = np.array(
            [*self.target, *launch, self.navigation, self.mass, self.normal_force, self.drag,
             self.most, self.begin, self.last, self.brisk], dtype=np.float64,
        )  # fmt: skip
        curve = np.array([self.thrust_time, self.thrust], float)
        wind = np.array([self.wind_height, self.wind_east, self.wind_north], float)
        object.__setattr__(self, "aim", Aim(fixed, curve, wind))

    def direction(self, t: float, position: Array, velocity: Array) -> Array:
        """Wanted nose direction (..., 3), unit, for position and velocity (..., 3) in the world."""
        out = np.empty(position.shape)
        self._steer(t, position, velocity, out)
        return out

    def limited(self, t: float, position: Array, velocity: Array) -> bool:
        """Whether the limit of the angle to the air acts, for position and velocity (3,)."""
        return bool(self._steer(t, position, velocity, np.empty(3)))

    def _steer(self, t: float, position: Array, velocity: Array, out: Array) -> int:
        count: int = directions(
            t, position.reshape(-1, 3), velocity.reshape(-1, 3), self.aim, out.reshape(-1, 3)
        )
        return count


@njit(nogil=True)
def _time_to_go(distance: float, speed: float, push: float) -> float:
    """Time for a distance at a speed that changes by `push` [m/s²]."""
    root = speed * speed + 2.0 * push * distance
    if root <= 0.0:
        return 2.0 * distance / speed
    return 2.0 * distance / (speed + math.sqrt(root))


@njit(nogil=True)
def _length(v: Array) -> float:
    return math.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])


@njit(nogil=True)
def _turned(direction: Array, toward: Array, most: float) -> Array:
    """`direction`, turned no farther than `most` from `toward`; both unit (3,)."""
    cosine = min(
        1.0,
        max(-1.0, direction[0] * toward[0] + direction[1] * toward[1] + direction[2] * toward[2]),
    )
    if cosine >= math.cos(most):
        return direction
    aside = direction - cosine * toward
    turned: Array = math.cos(most) * toward + math.sin(most) / max(_length(aside), 1e-9) * aside
    return turned


@njit(nogil=True)
def directions(t: float, position: Array, velocity: Array, aim: Aim, out: Array) -> int:
    """Write nose directions to `out` (n, 3); gives how many of them the limit holds."""
    fixed, curve, wind = aim
    target, launch = fixed[0:3], fixed[3:6]
    held = 0
    navigation, mass, normal_force, drag, most, begin, last, brisk = fixed[6:14]
    thrust = interpolate(t, curve[0], curve[1])
    through = np.empty(3)
    for k in range(len(out)):
        v = velocity[k]
        speed = _length(v)
        line = target - position[k]
        distance = _length(line)
        closing = (line[0] * v[0] + line[1] * v[1] + line[2] * v[2]) / max(distance, 1e-9)
        if t < begin or speed < 3.0 or closing < 0.2 * speed:
            if t < begin or speed < 3.0:
                out[k] = launch
            else:
                out[k] = v / speed  # past the point, or turned away from it: fly straight ahead
            continue
        ahead = v / speed
        through[:] = v
        through[0] -= interpolate(position[k, 2], wind[0], wind[1])
        through[1] -= interpolate(position[k, 2], wind[0], wind[2])
        airspeed = max(_length(through), 1e-3)
        flow = through / airspeed
        pressure = airspeed * airspeed
        along_flow = flow[0] * ahead[0] + flow[1] * ahead[1] + flow[2] * ahead[2]
        push = (thrust - drag * pressure * along_flow) / mass - GRAVITY * ahead[2]
        go = max(_time_to_go(distance, closing, push), last)
        miss = line - v * go
        miss[2] += 0.5 * GRAVITY * go * go
        along = miss[0] * ahead[0] + miss[1] * ahead[1] + miss[2] * ahead[2]
        # across the path: thrust·n + normal·(n − flow) − drag·flow = m·a, solved for the nose n
        normal = normal_force * pressure
        aside = (normal + drag * pressure) * (flow - along_flow * ahead)
        steer = mass * navigation / (go * go) * (miss - along * ahead) + aside
        steer /= max(thrust + normal, 0.1)
        need = _length(steer)
        lean = math.asin(min(need, LEAN))
        nose = math.cos(lean) * ahead + math.sin(lean) / max(need, 1e-9) * steer
        angle = min(most * max(1.0, brisk * brisk / pressure), math.pi)
        if need > LEAN or nose[0] * flow[0] + nose[1] * flow[1] + nose[2] * flow[2] < math.cos(
            angle
        ):
            held += 1
        out[k] = _turned(nose, flow, angle)
    return held
