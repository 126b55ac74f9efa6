"""Runge–Kutta steps of a vehicle: whole ones, and parts of them where its forces change.

Nothing in a vehicle without moving parts moves fast, so that a step may be as long as a control
tick; a gimbal asks for shorter ones. Four things divide a step: a corner of the thrust curve, a lug
that leaves the rail within centimetres, air that turns or slows the vehicle within a step, and a
vehicle that spins.
"""

import math
from typing import Final, NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from analysis.compiled import njit
from twin.physics.aerodynamics.atmosphere import SEA_LEVEL_DENSITY
from twin.physics.native.ramp import RELEASE
from twin.plant.authority import balance, launch_of, numeric, thrust_curve

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

# Radians or e-foldings of the fastest motion that one step may take: Runge–Kutta of order 4 errs by
# 0.5⁵/120 of it, 3e-4.
REACH: Final = 0.5
# Radians that one step may turn by: the forces turn with the vehicle. 0.5 misses the limits of
# docs/convergence.md by twenty times at 120 rad/s.
TURN: Final = 0.2
# s of a step; docs/convergence.md: longer ones miss its limits and save nothing
LONGEST: Final = 0.02
SAME: Final = 1e-9  # s, between two instants that count as one
PARTS: Final = 4  # of the stretch over which the rail releases a lug, one step at most each


def applies(model: mujoco.MjModel) -> bool:
    """Whether a model is one rigid vehicle without springs, loops or an elastic rail."""
    alone = model.nv == 6 and model.neq == 0 and model.nu == 0
    return alone and not model.dof_frictionloss.any() and not on_elastic_rail(model)


def on_elastic_rail(model: mujoco.MjModel) -> bool:
    """Whether the vehicle starts on an elastic rail."""
    parts = [numeric(model, f"ramp_{name}") for name in ("length", "stiffness")]
    return all(part is not None and part[0] > 0.0 for part in parts)


class Division(NamedTuple):
    """How steps of one vehicle are divided, for compiled code; all empty where they are not.

    Attributes
    ----------
    bare : whether the vehicle has no constraint but contacts
    rates : fastest motion in the air, per speed [1/m]; empty where nothing is divided
    corners : of the thrust curve [s]
    start : launch point (3,) [m]
    ends : travel at which each lug leaves the rail [m]; empty without a rail
    fine : longest way of a step while the rail releases a lug [m]
    on_rail : (1,) whether a lug may still be on it, written
    position, velocity, rate : (3,) views of the vehicle's state
    """

    bare: bool
    rates: Array
    corners: Array
    start: Array
    ends: Array
    fine: float
    on_rail: Flags
    position: Array
    velocity: Array
    rate: Array


def undivided() -> Division:
    """Division of a model whose steps are all alike."""
    nothing = np.empty(0)
    flags = np.empty(0, np.bool_)
    return Division(
        False, nothing, nothing, nothing, nothing, RELEASE, flags, nothing, nothing, nothing
    )


def division(model: mujoco.MjModel, position: Array, velocity: Array, rate: Array) -> Division:
    """Division of the vehicle whose state (3,) each is."""
    curve = thrust_curve(model)
    corners = np.empty(0) if curve is None else np.unique(curve[0])
    ends = _rail(model)
    return Division(
        applies(model), np.array([_rate(model)]), corners, np.array(launch_of(model)[1]), ends,
        RELEASE / PARTS, np.array([ends.size > 0]), position, velocity, rate,
    )  # fmt: skip


@njit(nogil=True)
def _release(d: Division, speed: float) -> float:
    """Steps in a second on the way to where the rail releases the next lug, and over it."""
    x, y, z = d.position
    travel = math.sqrt((x - d.start[0]) ** 2 + (y - d.start[1]) ** 2 + (z - d.start[2]) ** 2)
    for end in d.ends:
        if travel < end:
            often: float = (2.0 * speed + 1.0) / max(end - RELEASE - travel, d.fine)
            return often  # twice the speed, since it accelerates
    d.on_rail[0] = False
    return 0.0


@njit(nogil=True)
def part(d: Division, t: float, end: float) -> float:
    """Length of the next step [s] from simulation time `t` on, at most up to `end` [s]."""
    v, w = d.velocity, d.rate
    speed = math.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
    spin = math.sqrt(w[0] * w[0] + w[1] * w[1] + w[2] * w[2])
    often = max(d.rates[0] * speed / REACH, spin / TURN)  # steps in a second
    if d.on_rail[0]:
        often = max(often, _release(d, speed))
    k = np.searchsorted(d.corners, t + SAME, side="right")
    if k < d.corners.size and d.corners[k] < end - SAME:
        end = d.corners[k]
    length: float = (end - t) / max(1.0, math.ceil(often * (end - t) - 1e-6))
    return length


def _rail(model: mujoco.MjModel) -> Array:
    """Travel at which either lug leaves the rail [m], the last one last; empty without one."""
    length, lugs = numeric(model, "ramp_length"), numeric(model, "ramp_lug")
    if length is None or lugs is None or length[0] <= 0.0:
        return np.empty(0)
    apart = lugs[1] - lugs[0]
    if length[0] < apart:  # a stand, `twin.physics.native.guide`
        apart = 0.0
    return np.array([length[0] - apart, length[0]])


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
