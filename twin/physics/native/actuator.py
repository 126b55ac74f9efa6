"""The transfer-function actuator: an identified gimbal moves the joints of a MuJoCo model.

Each axis is one actuator with user activation dynamics. The activations hold the state of the
exact zero-order-hold equivalent, the shift register of past commands included; returning
`act_dot = (next − now)/dt` makes MuJoCo's Euler update of them exact. The force is the torque that
gives the joints the acceleration of the transfer function's output (inverse dynamics with MuJoCo's
inertia matrix), with weak feedback against contacts, stops and friction. It is a joint torque, so
its reaction acts on the vehicle.

RK4 evaluates four stages per step. The first activation counts them: its rates are chosen so that
stages see 0, 1, 2, 3, and the step leaves 0. Stages 1 to 3 return the rates of stage 0, which makes
RK4's weighted mean of them exact too. A step of the actuator may be taken in parts, the last of
which moves the activations. docs/control.md has the derivation.
"""

from typing import Final

import mujoco
import numpy as np
from numba import types
from numpy.typing import NDArray

from analysis.compiled import cfunc
from analysis.transfer_function import TransferFunctionModel
from hardware.frames import AXES
from twin.errors import TwinError
from twin.physics.native.cache import jit
from twin.physics.native.hold import (
    BEFORE,
    MARK,
    OUTPUT,
    PHASE,
    RATE,
    REGISTERS,
    advance,
    packed,
)
from twin.physics.native.inverse import torques
from twin.physics.native.layout import (
    DATA,
    INTEGRATOR,
    MODEL,
    MULTISTEP,
    RK4,
    TIMESTEP,
    address,
    characters,
    floats,
    integer,
    integers,
    number,
    size,
)

Array = NDArray[np.float64]

# Corner of the feedback behind the inverse dynamics, in radians per step: the double pole
# −0.2/dt lies inside the stability region of every integrator here, Adams–Bashforth 4 (−0.3)
# being the narrowest (E. Hairer et al., Solving Ordinary Differential Equations II, fig. V.1.1).
FEEDBACK: Final = 0.2
# s; longer steps of RK4 keep the corner of this one, which they bear: friction holds the joint back
# by the square of it
COARSEST: Final = 1e-3

# y[k], y[k+1], and the rates there, or y[k−1] where a step is evaluated once
_KEPT: Final = 4
_FITS: Final = 1e-6  # of a step, to which the times of its parts are exact

_NDYN: Final = int(mujoco.mjNDYN)
_NACTUATOR, _NU, _NA, _NV = (MODEL[n] for n in ("nactuator", "nu", "na", "nv"))
_NQ, _NJNT, _NNUMERIC, _NNUMERICDATA = (
    MODEL[n] for n in ("nq", "njnt", "nnumeric", "nnumericdata")
)
_DYNPRM, _TRNID, _CTRLADR, _ACTADR, _ACTNUM = (
    MODEL[f"actuator_{n}"] for n in ("dynprm", "trnid", "ctrladr", "actadr", "actnum")
)
_LIMITED, _RANGE = MODEL["actuator_ctrllimited"], MODEL["actuator_ctrlrange"]
_QPOSADR, _DOFADR = MODEL["jnt_qposadr"], MODEL["jnt_dofadr"]
_NUMERIC_ADR, _NUMERIC_DATA = MODEL["numeric_adr"], MODEL["numeric_data"]
_CTRL, _ACT, _ACT_DOT, _QPOS, _QVEL, _TIME = (
    DATA[n] for n in ("ctrl", "act", "act_dot", "qpos", "qvel", "time")
)


def attach(spec: mujoco.MjSpec, model: TransferFunctionModel, dt: float) -> None:
    """Add the actuators `gimbal_x` and `gimbal_y` of an identified model to a spec.

    Parameters
    ----------
    spec : has hinge joints `gimbal_x`, `gimbal_y`; nothing else may move them
    model : inputs and outputs `x` and `y`
    dt : physics step the spec will run at [s]

    Raises
    ------
    TwinError
        The model has other axes, is unstable, or the spec lacks a joint.
    """
    if set(model.inputs) != set(AXES) or set(model.outputs) != set(AXES):
        raise TwinError(
            f"the identified model has inputs {list(model.inputs)}, outputs {list(model.outputs)};"
            " both must be ['x', 'y'] (twin identify --both uses one axis for both)"
        )
    marginal = all(c.zero or c.den == (1.0, 0.0) for row in model.channels for c in row)
    if not (model.stable or marginal):  # integrators make joints that follow a rate
        raise TwinError("the identified model is unstable: all poles must have negative real parts")
    for axis in AXES:
        data, states = packed(model, axis, dt)
        _add(spec, axis, [MARK, dt, FEEDBACK, *data], REGISTERS + states)


def _add(spec: mujoco.MjSpec, axis: str, data: list[float], moving: int) -> None:
    joint = spec.joint(f"gimbal_{axis}")
    if joint is None:
        names = ", ".join(j.name for j in spec.joints if j.name)
        raise TwinError(f"the model has no joint 'gimbal_{axis}'; its joints are {names or 'none'}")
    spec.add_numeric(name=f"tf_gimbal_{axis}", data=data, size=len(data))
    actuator = spec.add_actuator(
        name=f"gimbal_{axis}",
        trntype=mujoco.mjtTrn.mjTRN_JOINT,
        target=joint.name,
        dyntype=mujoco.mjtDyn.mjDYN_USER,
        gaintype=mujoco.mjtGain.mjGAIN_FIXED,
        biastype=mujoco.mjtBias.mjBIAS_NONE,
        # moving activations, what RK4's stages need of stage 0, and the torque
        actdim=moving + (moving - 1) + _KEPT + 1,
    )
    actuator.gainprm[0] = 1.0
    actuator.dynprm[:3] = MARK, len(spec.numerics) - 1, AXES.index(axis)


def phases(model: mujoco.MjModel) -> NDArray[np.intp]:
    """Addresses in `act` of the stage counters, for steppers that update activations themselves."""
    ours = (model.actuator_dyntype == mujoco.mjtDyn.mjDYN_USER) & (
        model.actuator_dynprm[:, 0] == MARK
    )
    return np.asarray(model.actuator_actadr[ours], dtype=np.intp)


@jit
def _acceleration(
    kept: Array, share: float, method: int, dt: float, w: float, q: float, v: float
) -> float:
    """Joint acceleration that keeps the joint on the output, of what is `kept` of it.

    Euler and the implicit integrators move by v⁺ = v + dt·a, q⁺ = q + dt·v⁺, where backward
    differences are the exact velocity. Adams–Bashforth takes that of the parabola through three
    outputs, which spreads the jumps at commands over a step, and RK4 at `share` of the step the
    cubic with both outputs and both rates.
    """
    rise, speed = (kept[1] - kept[0]) / dt, (kept[0] - kept[2]) / dt
    position, change = kept[0], (rise - speed) / dt
    if method == MULTISTEP:
        speed = 0.5 * (rise + speed)
    if method == RK4:
        a, b = kept[2], kept[3]
        second, third = 3.0 * rise - 2.0 * a - b, a + b - 2.0 * rise
        position += dt * share * (a + share * (second + share * third))
        speed = a + share * (2.0 * second + 3.0 * share * third)
        change = (2.0 * second + 6.0 * share * third) / dt
    return change + 2.0 * w * (speed - v) + w * w * (position - q)


@jit
def _commands(m: int, d: int, first: int, out: Array) -> None:
    """Commands (2,) of both axes within their control ranges [rad]."""
    n, nu = size(m, _NACTUATOR), size(m, _NU)
    where, ctrl = integers(m, _CTRLADR, n), floats(d, _CTRL, nu)
    limited, bounds = characters(m, _LIMITED, nu), floats(m, _RANGE, 2 * nu)
    for j in range(len(AXES)):
        u = where[first + j]
        out[j] = ctrl[u]
        if limited[u]:
            out[j] = min(max(out[j], bounds[2 * u]), bounds[2 * u + 1])


@jit
def _within(time: float, h: float, dt: float, staged: bool) -> tuple[float, float]:
    """Where a step of `h` from `time` on begins in a step of the actuator, and its length there.

    Both are shares of `dt`. Whole steps may begin at any time.
    """
    if abs(h - dt) <= 1e-12:
        return 0.0, 1.0
    if not staged:
        return np.nan, np.nan
    begun = time / dt
    return begun - np.floor(begun + _FITS), h / dt


@jit
def _act(m: int, d: int, index: int) -> None:
    n = size(m, _NACTUATOR)
    parameters = floats(m, _DYNPRM, n * _NDYN)[index * _NDYN : (index + 1) * _NDYN]
    if parameters[0] != MARK:
        return
    numeric, axis = int(parameters[1]), int(parameters[2])
    begin = integers(m, _NUMERIC_ADR, size(m, _NNUMERIC))[numeric]
    p = floats(m, _NUMERIC_DATA, size(m, _NNUMERICDATA))[begin:]
    adr, num = integers(m, _ACTADR, n)[index], integers(m, _ACTNUM, n)[index]
    everything = floats(d, _ACT, size(m, _NA))
    act = everything[adr : adr + num]
    rates = floats(d, _ACT_DOT, size(m, _NA))[adr : adr + num]
    dt, h = p[1], number(m, TIMESTEP)
    method = integer(m, INTEGRATOR)
    staged = method == RK4
    stage = round(act[PHASE]) if staged else 0
    part = 0.0 if stage == 0 else (1.0 if stage == 3 else 0.5)
    begun, length = _within(number(d, _TIME) - part * h, h, dt, staged)
    if p[0] != MARK or not begun + length <= 1.0 + _FITS:
        rates[:] = np.nan  # matrices for another step: the result would be wrong
        act[num - 1] = np.nan
        return
    moving = (num - _KEPT) // 2
    stored, kept = moving, num - 1 - _KEPT  # rates of all but the counter, then of the output
    if stage == 0:
        commands = np.empty(len(AXES))
        _commands(m, d, index - axis, commands)
        following = rates  # scratch until the differences are taken
        advance(p, act, following, commands)
        act[kept], act[kept + 1] = act[OUTPUT], following[OUTPUT]
        act[kept + 2], act[kept + 3] = act[RATE] if staged else act[BEFORE], following[RATE]
        last = begun + length >= 1.0 - _FITS
        for k in range(1, moving):
            act[stored + k - 1] = (following[k] - act[k]) / h if last else 0.0
    for k in range(1, moving):
        rates[k] = act[stored + k - 1]
    for k in range(moving, num):
        rates[k] = 0.0
    # with RK4's weights 1, 2, 2, 1: rates 2, 4, 3 count the stages, the last one resets the count
    if not staged:
        rates[PHASE] = -act[PHASE] / h
    elif stage == 0:
        rates[PHASE] = 2.0 / h
    elif stage == 1:
        rates[PHASE] = 4.0 / h
    elif stage == 2:
        rates[PHASE] = 3.0 / h
    else:
        rates[PHASE] = -(16.0 + 6.0 * (act[PHASE] - 3.0)) / h
    share = begun + part * length
    w = p[2] / (min(dt, COARSEST) if staged else dt)
    joint = integers(m, _TRNID, 2 * n)[2 * index]
    q = floats(d, _QPOS, size(m, _NQ))[integers(m, _QPOSADR, size(m, _NJNT))[joint]]
    v = floats(d, _QVEL, size(m, _NV))[integers(m, _DOFADR, size(m, _NJNT))[joint]]
    act[num - 1] = _acceleration(act[kept : kept + 4], share, method, dt, w, q, v)
    if axis == len(AXES) - 1:
        x, y = index - 1, index
        joints, dofs = integers(m, _TRNID, 2 * n), integers(m, _DOFADR, size(m, _NJNT))
        first = integers(m, _ACTADR, n)[x] + integers(m, _ACTNUM, n)[x] - 1
        everything[first], act[num - 1] = torques(
            m, d, dofs[joints[2 * x]], dofs[joints[2 * y]], everything[first], act[num - 1]
        )


@cfunc(types.float64(types.voidptr, types.voidptr, types.int32), error_model="numpy")
def act_dyn(model, data, index):  # type: ignore[no-untyped-def]  # noqa: ANN001, ANN201
    """`mjcb_act_dyn`: activation rates and torques of transfer-function actuators."""
    _act(address(model), address(data), index)
    return 0.0
