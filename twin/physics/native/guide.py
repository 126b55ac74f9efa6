"""Forces of the launch rail on the lugs of a vehicle, added to the passive forces.

With `ramp_stiffness` the rail is elastic; with 0 it is rigid: the forces are those that keep both
lugs on the line under all that acts on the vehicle, by inverse dynamics of one rigid body, with a
feedback whose corner follows the time step down to 1 ms (4 ms under RK4). A rigid rail therefore
limits no step, and its feedback only has to remove what the gimbal's own motion adds.
"""

from typing import Final

import numpy as np
from mujoco.introspect import structs

from twin.physics.native import ramp
from twin.physics.native.cache import jit
from twin.physics.native.index import VEHICLE, slot, value, values
from twin.physics.native.layout import (
    DATA,
    INTEGRATOR,
    MODEL,
    RK4,
    TIMESTEP,
    _place,
    floats,
    integer,
    integers,
    number,
    size,
)
from twin.physics.native.rigid_body import (
    Array,
    Vector,
    apply_force,
    cross,
    dot,
    turn,
    vector,
    velocity_at,
)

_XPOS, _XMAT, _COM, _CRB = DATA["xpos"], DATA["xmat"], DATA["subtree_com"], DATA["crb"]
_PASSIVE, _NV, _NBODY, _DOF = (
    DATA["qfrc_passive"],
    MODEL["nv"],
    MODEL["nbody"],
    MODEL["body_dofadr"],
)
GRAVITY: Final = MODEL["opt"] + _place(structs.STRUCTS["mjOption"].fields)[0]["gravity"]
_RAMP, _ELEVATION, _AZIMUTH = slot("ramp_position"), slot("ramp_elevation"), slot("ramp_azimuth")
_RAMP_LENGTH, _LUG = slot("ramp_length"), slot("ramp_lug")
_STIFFNESS, _DAMPING = slot("ramp_stiffness"), slot("ramp_damping")
_AREA = slot("air_reference_area")


@jit
def guide(m: int, d: int, data: Array, index: Array) -> None:
    """Add the forces of the rail; they include those that stand in `qfrc_passive` already."""
    length = value(data, index, _RAMP_LENGTH)
    body, nbody = int(index[VEHICLE]), size(m, _NBODY)
    foot, lugs = values(data, index, _RAMP), values(data, index, _LUG)
    origin = vector(floats(d, _XPOS, 3 * nbody), body)
    reach = lugs[1] - lugs[0] + length + 1.0
    away = (origin[0] - foot[0]) ** 2 + (origin[1] - foot[1]) ** 2 + (origin[2] - foot[2]) ** 2
    if length <= 0.0 or away > reach * reach:
        return
    if value(data, index, _STIFFNESS) > 0.0:
        _elastic(m, d, data, index, body)
    else:
        _rigid(m, d, data, index, body)


@jit
def _shift(lugs: Array, k: int, length: float) -> float:
    """Distance by which the foot of a lug is up the rail: a rail shorter than the lugs' is a stand.

    A stand holds both until the lower one has lifted by its length.
    """
    return lugs[k] - lugs[0] if length < lugs[1] - lugs[0] else 0.0


@jit
def _lug(d: int, nbody: int, body: int, station: float, foot: Array) -> tuple[Vector, Vector]:
    """Place of a lug in the world, and from the foot of the rail."""
    origin = vector(floats(d, _XPOS, 3 * nbody), body)
    rotation = floats(d, _XMAT, 9 * nbody)[9 * body : 9 * body + 9]
    arm = turn(rotation, (0.0, 0.0, station))
    point = (origin[0] + arm[0], origin[1] + arm[1], origin[2] + arm[2])
    return point, (point[0] - foot[0], point[1] - foot[1], point[2] - foot[2])


@jit
def _elastic(m: int, d: int, data: Array, index: Array, body: int) -> None:
    nbody, length = size(m, _NBODY), value(data, index, _RAMP_LENGTH)
    foot, lugs = values(data, index, _RAMP), values(data, index, _LUG)
    rotation = floats(d, _XMAT, 9 * nbody)[9 * body : 9 * body + 9]
    direction = ramp.rail(value(data, index, _ELEVATION), value(data, index, _AZIMUTH))
    stiffness, damping = value(data, index, _STIFFNESS), value(data, index, _DAMPING)
    up = turn(rotation, (0.0, 0.0, 1.0))
    for k in range(2 if lugs[1] != lugs[0] else 1):
        point, offset = _lug(d, nbody, body, lugs[k], foot)
        s = _shift(lugs, k, length)
        offset = (
            offset[0] - s * direction[0],
            offset[1] - s * direction[1],
            offset[2] - s * direction[2],
        )
        velocity, rate = velocity_at(m, d, body, point)
        fx, fy, fz, hold = ramp.guide_force(
            offset, velocity, direction, length, stiffness, damping, k == 0
        )
        # the lug sits at the tube's surface and rubs when the vehicle rolls
        rub = -hold * damping * value(data, index, _AREA) / np.pi
        spin = rub * dot(rate, up)
        torque = (spin * up[0], spin * up[1], spin * up[2])
        apply_force(m, d, body, point, (fx, fy, fz), torque)


@jit
def _around(inertia: Array, n: Vector) -> float:
    """Moment of inertia about an axis, of a com-based inertia as `mjData.crb` has it."""
    return (
        inertia[0] * n[0] * n[0]
        + inertia[1] * n[1] * n[1]
        + inertia[2] * n[2] * n[2]
        + 2.0 * (inertia[3] * n[0] * n[1] + inertia[4] * n[0] * n[2] + inertia[5] * n[1] * n[2])
    )


@jit
def _loads(m: int, d: int, body: int, mass: float) -> tuple[Vector, Vector]:
    """Force on a vehicle without its rail, gravity included, and torque about its centre of mass.

    The free joint's first three generalised forces are a force, the others a torque about the
    body's origin in its own frame.
    """
    nbody = size(m, _NBODY)
    dof = int(np.int64(integers(m, _DOF, nbody)[body]))
    f = floats(d, _PASSIVE, size(m, _NV))[dof : dof + 6]
    origin, com = (
        vector(floats(d, _XPOS, 3 * nbody), body),
        vector(floats(d, _COM, 3 * nbody), body),
    )
    rotation = floats(d, _XMAT, 9 * nbody)[9 * body : 9 * body + 9]
    torque = turn(rotation, (f[3], f[4], f[5]))
    back = cross((origin[0] - com[0], origin[1] - com[1], origin[2] - com[2]), (f[0], f[1], f[2]))
    force = (
        f[0] + mass * number(m, GRAVITY),
        f[1] + mass * number(m, GRAVITY + 8),
        f[2] + mass * number(m, GRAVITY + 16),
    )
    return force, (torque[0] + back[0], torque[1] + back[1], torque[2] + back[2])


@jit
def _rigid(m: int, d: int, data: Array, index: Array, body: int) -> None:
    nbody, length = size(m, _NBODY), value(data, index, _RAMP_LENGTH)
    foot, lugs = values(data, index, _RAMP), values(data, index, _LUG)
    azimuth = value(data, index, _AZIMUTH)
    u = ramp.rail(value(data, index, _ELEVATION), azimuth)
    com = vector(floats(d, _COM, 3 * nbody), body)
    inertia = floats(d, _CRB, 10 * nbody)[10 * body : 10 * body + 10]
    share = ramp.FEEDBACK_RK4 if integer(m, INTEGRATOR) == RK4 else ramp.FEEDBACK
    mass, w = inertia[9], min(share / number(m, TIMESTEP), ramp.CORNER)

    low, offset_low = _lug(d, nbody, body, lugs[0], foot)
    high, offset_high = _lug(d, nbody, body, lugs[1], foot)
    s = _shift(lugs, 1, length)
    offset_high = (offset_high[0] - s * u[0], offset_high[1] - s * u[1], offset_high[2] - s * u[2])
    hold_low, travel, aside_low = ramp.hold_of(offset_low, u, length)
    hold_high, _, aside_high = ramp.hold_of(offset_high, u, length)
    if lugs[0] == lugs[1]:
        hold_high = 0.0
    if hold_low == 0.0 and hold_high == 0.0:
        return
    force, torque = _loads(m, d, body, mass)
    v_low, rate = velocity_at(m, d, body, low)
    v_high, _ = velocity_at(m, d, body, high)
    arms = (
        (low[0] - com[0]) * u[0] + (low[1] - com[1]) * u[1] + (low[2] - com[2]) * u[2],
        (high[0] - com[0]) * u[0] + (high[1] - com[1]) * u[1] + (high[2] - com[2]) * u[2],
    )
    at_low, at_high = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    side = (-np.sin(azimuth), np.cos(azimuth), 0.0)
    for k in range(2):
        e = side if k == 0 else cross(u, side)
        n = cross(u, e)
        around = _around(inertia, n)
        push, turning = dot(force, e) / mass, dot(torque, n) / around
        free = (push + turning * arms[0], push + turning * arms[1])
        wanted = (
            -2.0 * w * dot(v_low, e) - w * w * dot(aside_low, e),
            -2.0 * w * dot(v_high, e) - w * w * dot(aside_high, e),
        )
        holds = (hold_low, hold_high)
        one, other = ramp.rigid_forces(free, wanted, arms, holds, mass, around)
        at_low = (at_low[0] + one * e[0], at_low[1] + one * e[1], at_low[2] + one * e[2])
        at_high = (at_high[0] + other * e[0], at_high[1] + other * e[1], at_high[2] + other * e[2])
    push = hold_low * mass * ramp.stop(travel, dot(v_low, u), dot(force, u) / mass, w)
    at_low = (at_low[0] + push * u[0], at_low[1] + push * u[1], at_low[2] + push * u[2])
    # a rail lets nothing roll that it holds
    spin = -0.5 * (hold_low + hold_high) * _around(inertia, u) * w * dot(rate, u)
    apply_force(m, d, body, low, at_low, (spin * u[0], spin * u[1], spin * u[2]))
    apply_force(m, d, body, high, at_high, (0.0, 0.0, 0.0))
