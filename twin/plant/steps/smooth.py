"""Runge–Kutta steps of a vehicle: whole ones, and parts of them where its forces change.

Nothing in a vehicle without moving parts moves fast, so that a step may be as long as a control
tick; a gimbal asks for shorter ones. Seven things divide a step: a corner of the thrust curve, a
lug that leaves the rail within centimetres, air that turns or slows the vehicle within a step, a
vehicle that spins, backlash that is crossed, a servo shaft that turns, and an identified gimbal far
from its command.
"""

import math
from typing import Final, NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from analysis.compiled import njit
from twin.physics.aerodynamics.atmosphere import SEA_LEVEL_DENSITY
from twin.physics.native.ramp import RELEASE
from twin.physics.native.servo import CONSTANT, DAMPING, RESISTANCE
from twin.plant.authority import balance, launch_of, numeric, thrust_curve

Array = NDArray[np.float64]
Integers = NDArray[np.int64]
Flags = NDArray[np.bool_]

# Radians or e-foldings of the fastest motion that one step may take: Runge–Kutta of order 4 errs by
# 0.5⁵/120 of it, 3e-4.
REACH: Final = 0.5
# Radians that one step may turn by: the forces turn with the vehicle. 0.5 misses the limits of
# docs/convergence.md by twenty times at 120 rad/s.
TURN: Final = 0.2
# s of a step, without and with moving parts; docs/convergence.md: longer ones miss its limits
LONGEST: Final = 0.02
MOVING: Final = 0.004
# s of a step while an identified gimbal is more than AWAY [rad] from its command: with 4 ms swings
# of 7 degrees change the angular momentum of a free vehicle by 6e-6 N m s
SWINGING: Final = 0.004 / 3.0
AWAY: Final = math.radians(0.3)
DAMPED: Final = 2.0  # e-foldings of the fastest damped part in a step; Runge-Kutta bears 2.8
# of the width of a gear's backlash that the horn may cross in a step: it bounces between two stops
CROSSED: Final = 0.02
BOUNCES: Final = 1e4  # steps in a second for that, at most
# rad that a servo shaft may turn by in a step, and steps in a second for that, at most: 2 ms while
# it swings, whole steps of 4 ms while it follows a steered flight at less than 0.1 rad/s
FOLLOWED: Final = 4e-4
SWINGS: Final = 500.0
SAME: Final = 1e-9  # s, between two instants that count as one
PARTS: Final = 4  # of the stretch over which the rail releases a lug, one step at most each


def applies(model: mujoco.MjModel) -> bool:
    """Whether a model is one rigid vehicle without springs, loops or an elastic rail."""
    alone = model.nv == 6 and model.neq == 0 and model.nu == 0
    return alone and not model.dof_frictionloss.any() and not on_elastic_rail(model)


def longest_step(model: mujoco.MjModel) -> float:
    """Longest Runge-Kutta step that keeps the limits of docs/convergence.md [s].

    Shorter than those of the shipped models where a part is damped or a constraint acts faster than
    a step. The elastic rail has none.
    """
    if applies(model):
        return LONGEST
    if on_elastic_rail(model):
        return 0.0
    soft = [model.eq_solref[:, 0], model.jnt_solref[model.jnt_limited > 0, 0]]
    soft += [model.dof_solref[model.dof_frictionloss > 0.0, 0]]
    times = np.concatenate(soft) if model.neq else np.empty(0)  # stops are met in half steps
    damping = model.dof_damping + _servo_damping(model)
    return min(
        MOVING,
        float(times[times > 0.0].min(initial=np.inf)),
        DAMPED / float((damping / model.dof_M0).max(initial=1e-3)),
    )


def _servo_damping(model: mujoco.MjModel) -> Array:
    """What velocity feedback and back-EMF of the actuators damp each dof with [N m s/rad]."""
    damping = np.zeros(model.nv)
    for k in range(model.nu):
        if model.actuator_trntype[k] == mujoco.mjtTrn.mjTRN_JOINT:
            dof = model.jnt_dofadr[model.actuator_trnid[k, 0]]
            gain, bias = model.actuator_gainprm[k], -model.actuator_biasprm[k, 2]
            if model.actuator_gaintype[k] == mujoco.mjtGain.mjGAIN_DCMOTOR:
                # the feedback contains the back-EMF; a saturated winding has that alone
                bias = max(gain[CONSTANT] ** 2 / gain[RESISTANCE], gain[DAMPING])
            damping[dof] += max(0.0, bias) * model.actuator_gear[k, 0] ** 2
    return damping


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
    speeds, fast : all velocities; of each backlash joint and servo shaft its place in them, how far
        it may move in a step [rad], and steps in a second for that, at most
    ctrl, places, angle : controls, places of the commanded angles of an identified gimbal in them,
        and its angles [rad]
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
    speeds: Array
    fast: Array
    ctrl: Array
    places: Integers
    angle: Array


def undivided() -> Division:
    """Division of a model whose steps are all alike."""
    nothing = np.empty(0)
    flags = np.empty(0, np.bool_)
    return Division(
        False,
        nothing,
        nothing,
        nothing,
        nothing,
        RELEASE,
        flags,
        nothing,
        nothing,
        nothing,
        nothing,
        np.empty((0, 3)),
        nothing,
        np.empty(0, np.int64),
        nothing,
    )


def division(
    model: mujoco.MjModel, position: Array, velocity: Array, rate: Array,
    speeds: Array, ctrl: Array, places: Integers, angle: Array,
) -> Division:  # fmt: skip
    """Division of the vehicle whose state (3,) each is."""
    curve = thrust_curve(model)
    corners = np.empty(0) if curve is None else np.unique(curve[0])
    ends = _rail(model)
    return Division(
        applies(model), np.array([_rate(model)]), corners, np.array(launch_of(model)[1]), ends,
        RELEASE / PARTS, np.array([ends.size > 0]), position, velocity, rate,
        speeds, _fast(model), ctrl, places, angle,
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
    for k in range(len(d.fast)):
        often = max(often, min(d.fast[k, 2], abs(d.speeds[int(d.fast[k, 0])]) / d.fast[k, 1]))
    for k in range(d.places.size):
        if abs(d.ctrl[d.places[k]] - d.angle[k]) > AWAY:
            often = max(often, 1.0 / SWINGING)
    if d.on_rail[0]:
        often = max(often, _release(d, speed))
    after = np.searchsorted(d.corners, t + SAME, side="right")
    if after < d.corners.size and d.corners[after] < end - SAME:
        end = d.corners[after]
    length: float = (end - t) / max(1.0, math.ceil(often * (end - t) - 1e-6))
    return length


def _fast(model: mujoco.MjModel) -> Array:
    """Rows of `Division.fast`."""
    rows = []
    for axis in ("x", "y"):
        joint = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, f"gimbal_play_{axis}")
        if joint >= 0:
            low, high = model.jnt_range[joint]
            rows.append((float(model.jnt_dofadr[joint]), CROSSED * (high - low), BOUNCES))
    servos = model.actuator_gaintype == mujoco.mjtGain.mjGAIN_DCMOTOR
    servos &= model.actuator_trntype == mujoco.mjtTrn.mjTRN_JOINT
    dofs = model.jnt_dofadr[model.actuator_trnid[servos, 0]]
    rows += [(float(dof), FOLLOWED, SWINGS) for dof in dofs]
    return np.array(rows).reshape(-1, 3)


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
