"""The compiled passive forces: thrust, jet damping, air, wind, ramp, and dead bands of servos.

One `mjcb_passive` callback for every model in the process: stateless, without Python or the
interpreter lock, reading all coefficients from the model; models without them are left alone.
"""

import numpy as np
from numba import types

from analysis.compiled import cfunc
from twin.physics import aerodynamics as air
from twin.physics.native.cache import jit
from twin.physics.native.guide import GRAVITY, guide
from twin.physics.native.index import NOZZLE, PROPELLANT, VEHICLE, locate, slot, value, values
from twin.physics.native.layout import (
    DATA,
    MODEL,
    address,
    floats,
    integers,
    number,
    size,
)
from twin.physics.native.recovery import density_at, recover, sound_at, wind_of
from twin.physics.native.rigid_body import (
    Array,
    Vector,
    apply_force,
    cross,
    turn,
    turn_back,
    vector,
    velocity_at,
)
from twin.physics.native.servo import dead_bands

_TIME, _XPOS, _XMAT, _XIPOS = DATA["time"], DATA["xpos"], DATA["xmat"], DATA["xipos"]
_SITE_XPOS, _SITE_XMAT = DATA["site_xpos"], DATA["site_xmat"]
_COM, _MASS, _CRB = DATA["subtree_com"], MODEL["body_mass"], DATA["crb"]
_NBODY, _NSITE = MODEL["nbody"], MODEL["nsite"]
_NUMERIC, _NNUMERIC = MODEL["numeric_data"], MODEL["nnumericdata"]
_SITE_BODY = MODEL["site_bodyid"]


_AIR, _AIR_MODEL = slot("air_enabled"), slot("air_model")
_CROSSFLOW, _AXIAL = slot("air_crossflow_drag"), slot("air_axial_drag")
_STRIP_Z, _STRIP_AREA = slot("air_strip_z"), slot("air_strip_area")
_AREA, _ROLL = slot("air_reference_area"), slot("air_roll_damping")
_NOSE, _NOSE_Z = slot("air_nose_slope"), slot("air_nose_z")
_FIN, _FIN_Z = slot("air_fin_slope"), slot("air_fin_z")
_CANT, _PITCH = slot("air_roll_forcing"), slot("air_pitch_damping")
_MACH, _COASTING, _THRUSTING = (slot(f"air_drag_{n}") for n in ("mach", "coasting", "thrusting"))
_RADIUS, _MISALIGNMENT = slot("gravity_radius"), slot("motor_misalignment")
_SWIRL, _CHUTES = slot("motor_swirl"), slot("chute_drag_area")
_THESIS_R, _THESIS_DV = slot("air_thesis_radius"), slot("air_thesis_offset")
_RAMP_LENGTH = slot("ramp_length")
_CURVE_TIME, _CURVE_THRUST = slot("motor_time"), slot("motor_thrust")
_IMPULSE, _IGNITION = slot("motor_impulse"), slot("motor_ignition")
_PROPELLANT_MASS, _GRAIN_LENGTH, _BURN = (
    slot("motor_propellant_mass"),
    slot("motor_grain_length"),
    slot("motor_burn"),
)


@jit
def thrust_at(time: Array, thrust: Array, t: float) -> float:
    """Thrust of a piecewise linear curve [N]; zero before its first and after its last point."""
    low, high = 0, time.size - 1
    if t < time[low] or t >= time[high]:
        return 0.0
    while high - low > 1:
        middle = (low + high) // 2
        if t >= time[middle]:
            low = middle
        else:
            high = middle
    slope = (thrust[high] - thrust[low]) / (time[high] - time[low])
    force: float = thrust[low] + slope * (t - time[low])
    return force


@jit
def jet_damping(
    nozzle: Vector, source: Vector, spread: float, up: Vector, w: Vector, flow: float
) -> tuple[Vector, Vector, Vector]:
    """Where the gas in a turning motor loads it, with which force [N] and torque [N m].

    The Coriolis force -2 ω×u dm of every element on its way from the `source` [m] to the `nozzle`
    [m]. Along a line ∫u dm is `flow` [kg/s] times the way, so the sum acts in the middle of it.
    Where the grain burns all along a stretch `spread` [m] about the source, the moment of inertia
    of that stretch is missing from the sum. `w` is the motor's own rate [rad/s]; neither the
    vehicle's centre of mass nor the pivot enters.
    Source: Thomson, Introduction to Space Dynamics (1961), on variable mass and jet damping;
    Cornelisse, Schöyer & Wakker, Rocket Propulsion and Spaceflight Dynamics (1979), whose Coriolis
    force and moment these are, for a channel.
    """
    way = (nozzle[0] - source[0], nozzle[1] - source[1], nozzle[2] - source[2])
    turned = cross(w, way)
    load = (-2.0 * flow * turned[0], -2.0 * flow * turned[1], -2.0 * flow * turned[2])
    middle = (source[0] + 0.5 * way[0], source[1] + 0.5 * way[1], source[2] + 0.5 * way[2])
    k, roll = flow * spread * spread / 12.0, w[0] * up[0] + w[1] * up[1] + w[2] * up[2]
    torque = (k * (w[0] - roll * up[0]), k * (w[1] - roll * up[1]), k * (w[2] - roll * up[2]))
    return middle, load, torque


@jit
def _motor(m: int, d: int, data: Array, index: Array) -> None:
    t = number(d, _TIME) - value(data, index, _IGNITION)
    force = thrust_at(values(data, index, _CURVE_TIME), values(data, index, _CURVE_THRUST), t)
    impulse = value(data, index, _IMPULSE)
    if force == 0.0 or impulse <= 0.0:
        return
    site = int(index[NOZZLE])
    nsite, nbody = size(m, _NSITE), size(m, _NBODY)
    body = int(np.int64(integers(m, _SITE_BODY, nsite)[site]))  # as `guide` has it
    nozzle = vector(floats(d, _SITE_XPOS, 3 * nsite), site)
    axis = floats(d, _SITE_XMAT, 9 * nsite)[9 * site : 9 * site + 9]
    up = (axis[2], axis[5], axis[8])
    if index[_MISALIGNMENT] >= 0:
        a, b = values(data, index, _MISALIGNMENT)[0], values(data, index, _MISALIGNMENT)[1]
        if a != 0.0 or b != 0.0:  # z turned about x, then about y
            up = turn(axis, (np.sin(b) * np.cos(a), -np.sin(a), np.cos(b) * np.cos(a)))

    push = (force * up[0], force * up[1], force * up[2])
    swirl = value(data, index, _SWIRL) if index[_SWIRL] >= 0 else 0.0
    roll = (swirl * push[0], swirl * push[1], swirl * push[2])
    apply_force(m, d, body, nozzle, push, roll)

    full = value(data, index, _PROPELLANT_MASS)
    grain = int(index[PROPELLANT])
    burnt = 1.0 - floats(m, _MASS, nbody)[grain] / full
    source = vector(floats(d, _XIPOS, 3 * nbody), grain)
    back, spread = 0.0, value(data, index, _GRAIN_LENGTH)  # of a bore that burns along its length
    if value(data, index, _BURN) != 0.0:
        back, spread = 0.5 * (1.0 - burnt) * spread, 0.0
    source = (source[0] - back * up[0], source[1] - back * up[1], source[2] - back * up[2])
    _, w = velocity_at(m, d, body, nozzle)
    middle, load, torque = jet_damping(nozzle, source, spread, up, w, force * full / impulse)
    apply_force(m, d, body, middle, load, torque)


@jit
def _crossflow(
    v: Vector,
    w: Vector,
    rho: float,
    station: float,
    data: Array,
    index: Array,
) -> air.body.Load:
    """Crossflow drag by the model the vehicle asks for."""
    z, area = values(data, index, _STRIP_Z), values(data, index, _STRIP_AREA)
    coefficient = value(data, index, _CROSSFLOW)
    if value(data, index, _AIR_MODEL) == 0.0:
        return air.crossflow(v[0], v[1], w[0], w[1], 0.5 * rho * coefficient, z, area, station)
    r_ref, dv_ref = value(data, index, _THESIS_R), value(data, index, _THESIS_DV)
    return air.crossflow_by_moments(
        v[0], v[1], w[0], w[1], rho, coefficient, z, area, station, r_ref, dv_ref
    )


@jit
def _lift(
    load: air.body.Load,
    v: Vector,
    w: Vector,
    q: float,
    axial: float,
    slope: Array,
    z: Array,
    station: float,
) -> air.body.Load:
    """A load with the normal forces of parts of those slopes at those stations added."""
    fx, fy, mx, my = load
    for k in range(slope.size):
        part = air.normal_force(v[0], v[1], axial, w[0], w[1], q * slope[k], z[k] - station)
        fx, fy, mx, my = fx + part[0], fy + part[1], mx + part[2], my + part[3]
    return fx, fy, mx, my


@jit
def table_at(x: Array, y: Array, at: float) -> float:
    """Value of a table, linear between its points and constant outside."""
    if at <= x[0]:
        return float(y[0])
    for k in range(1, x.size):
        if at <= x[k]:
            return float(y[k - 1] + (y[k] - y[k - 1]) * (at - x[k - 1]) / (x[k] - x[k - 1]))
    return float(y[x.size - 1])


@jit
def _axial(d: int, data: Array, index: Array, v: Vector, height: float) -> float:
    """Axial drag coefficient, over the Mach number where the model has tables of it."""
    if index[_MACH] < 0:
        return value(data, index, _AXIAL)
    t = number(d, _TIME) - value(data, index, _IGNITION)
    curve_time, curve_thrust = values(data, index, _CURVE_TIME), values(data, index, _CURVE_THRUST)
    on = index[_THRUSTING] >= 0 and thrust_at(curve_time, curve_thrust, t) > 0.0
    table = values(data, index, _THRUSTING if on else _COASTING)
    sound = sound_at(data, index, height)
    mach = np.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]) / sound
    return table_at(values(data, index, _MACH), table, mach)


@jit
def _gravity(m: int, d: int, data: Array, index: Array) -> None:
    """What gravity is weaker by than on the ground: g (1 - (R / (R + h))²)."""
    radius = value(data, index, _RADIUS)
    body, nbody = int(index[VEHICLE]), size(m, _NBODY)
    com = vector(floats(d, _COM, 3 * nbody), body)
    mass = floats(d, _CRB, 10 * nbody)[10 * body + 9]
    less = mass * ((radius / (radius + com[2])) ** 2 - 1.0)
    g = (number(m, GRAVITY), number(m, GRAVITY + 8), number(m, GRAVITY + 16))
    apply_force(m, d, body, com, (less * g[0], less * g[1], less * g[2]), (0.0, 0.0, 0.0))


@jit
def _air(m: int, d: int, data: Array, index: Array, hangs: bool) -> None:
    """Forces of the air on the body; of one that hangs on a parachute its drag without its lift.

    On its line a body is free to turn about the vertical, so that its lift has no lasting direction
    and carries it nowhere, unlike that of a rigid body that always shows the flow the same side.
    RocketPy and OpenRocket leave out all forces on the body under a parachute.
    """
    body, nbody = int(index[VEHICLE]), size(m, _NBODY)
    origin = vector(floats(d, _XPOS, 3 * nbody), body)
    rotation = floats(d, _XMAT, 9 * nbody)[9 * body : 9 * body + 9]
    com = vector(floats(d, _COM, 3 * nbody), body)
    offset = (com[0] - origin[0], com[1] - origin[1], com[2] - origin[2])
    station = turn_back(rotation, offset)[2]  # of the centre of mass along the axis
    up = turn(rotation, (0.0, 0.0, station))
    point = (origin[0] + up[0], origin[1] + up[1], origin[2] + up[2])
    velocity, rate = velocity_at(m, d, body, point)
    wind = wind_of(d, data, index, point)
    rho = density_at(data, index, point[2])
    through = (velocity[0] - wind[0], velocity[1] - wind[1], velocity[2] - wind[2])
    v, w = turn_back(rotation, through), turn_back(rotation, rate)

    q = 0.5 * rho * value(data, index, _AREA)
    fx, fy, mx, my = _crossflow(v, w, rho, station, data, index)
    load = (fx, fy, mx, my)
    # a nose lifts only while it leads; fins do both ways
    slope, z = values(data, index, _NOSE), values(data, index, _NOSE_Z)
    load = _lift(load, v, w, q, max(v[2], 0.0), slope, z, station)
    slope, z = values(data, index, _FIN), values(data, index, _FIN_Z)
    load = _lift(load, v, w, q, abs(v[2]), slope, z, station)
    fz = air.axial_drag(v[2], q * _axial(d, data, index, v, point[2]))
    mz = air.roll_damping(v[2], w[2], 0.5 * rho * value(data, index, _ROLL))
    if index[_CANT] >= 0:
        mz += 0.5 * rho * value(data, index, _CANT) * v[2] * abs(v[2])
    damping = 0.0
    if index[_PITCH] >= 0:
        damping = -0.5 * rho * value(data, index, _PITCH) * abs(v[2])
    force = turn(rotation, (load[0], load[1], fz))
    square = through[0] * through[0] + through[1] * through[1] + through[2] * through[2]
    if hangs and square > 0.0:
        along = force[0] * through[0] + force[1] * through[1] + force[2] * through[2]
        share = along / square
        force = (share * through[0], share * through[1], share * through[2])
    torque = turn(rotation, (load[2] + damping * w[0], load[3] + damping * w[1], mz))
    apply_force(m, d, body, point, force, torque)


@jit
def add_forces(m: int, d: int) -> None:
    """Add every force of the vehicle to qfrc_passive; nothing where the model carries none."""
    carries, index = locate(m)
    if not carries or index[VEHICLE] < 0:
        return
    data = floats(m, _NUMERIC, size(m, _NNUMERIC))
    hangs = index[_CHUTES] >= 0 and recover(m, d, data, index)
    if index[_AIR] >= 0 and value(data, index, _AIR) != 0.0:
        _air(m, d, data, index, hangs)
    if index[NOZZLE] >= 0 and index[_IMPULSE] >= 0:
        _motor(m, d, data, index)
    if index[_RADIUS] >= 0 and value(data, index, _RADIUS) > 0.0:
        _gravity(m, d, data, index)
    if index[_RAMP_LENGTH] >= 0:
        guide(m, d, data, index)


@cfunc(types.void(types.voidptr, types.voidptr), error_model="numpy")
def passive(model, data):  # type: ignore[no-untyped-def]  # noqa: ANN001, ANN201
    """`mjcb_passive`: forces of the vehicle, and play and dead band of its servos."""
    add_forces(address(model), address(data))
    dead_bands(address(model), address(data))
