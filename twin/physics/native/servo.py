"""Dead band of a hobby servo, which MuJoCo's actuators do not have, and its slew limit under RK4.

A `dcmotor` drives its winding with `v = clip(R/K (kp e - kd ω) + K ω, ±V)`. A servo with a dead
band of half width b sees `e - clip(e, ±b)` in place of the error e, so the shaft receives the
difference of the two torques `K/R v` on top. The half width is the first user value of the
actuator (written by twin.physics.mechanism.apply_servo).

MuJoCo has a slewed set point reach in the beginning of a step what it may reach at its end: an
error of first order. Under RK4 the set point is that of the stage.
"""

from typing import Final

import mujoco
import numpy as np
from numpy.typing import NDArray

from twin.physics.native.cache import jit
from twin.physics.native.layout import (
    DATA,
    INTEGRATOR,
    MODEL,
    RK4,
    TIMESTEP,
    characters,
    floats,
    integer,
    integers,
    number,
    size,
)

_DCMOTOR: Final = int(mujoco.mjtGain.mjGAIN_DCMOTOR)
_JOINT: Final = int(mujoco.mjtTrn.mjTRN_JOINT)
_NGAIN: Final = int(mujoco.mjNGAIN)
_NDYN: Final = int(mujoco.mjNDYN)
RESISTANCE, CONSTANT, _GAIN, DAMPING, _VOLTAGE, _SLEW = 0, 1, 4, 6, 7, 7

_NACTUATOR, _NU, _NA, _NV = MODEL["nactuator"], MODEL["nu"], MODEL["na"], MODEL["nv"]
_NJNT, _NOUT, _NUSER = MODEL["njnt"], MODEL["nout"], MODEL["nuser_actuator"]
_USER, _GAINTYPE, _GAINPRM = (
    MODEL["actuator_user"],
    MODEL["actuator_gaintype"],
    MODEL["actuator_gainprm"],
)
_DYNPRM, _TRNTYPE, _TRNID = (
    MODEL["actuator_dynprm"],
    MODEL["actuator_trntype"],
    MODEL["actuator_trnid"],
)
_CTRLADR, _LIMITED, _RANGE = (
    MODEL["actuator_ctrladr"],
    MODEL["actuator_ctrllimited"],
    MODEL["actuator_ctrlrange"],
)
_ACTADR, _ACTNUM, _DOFADR = (
    MODEL["actuator_actadr"],
    MODEL["actuator_actnum"],
    MODEL["jnt_dofadr"],
)
_OUTADR = MODEL["actuator_outadr"]
_LENGTH, _VELOCITY = DATA["actuator_length"], DATA["actuator_velocity"]
_CTRL, _ACT, _PASSIVE = DATA["ctrl"], DATA["act"], DATA["qfrc_passive"]


@jit
def dead_bands(m: int, d: int) -> None:
    """Add the effect of the dead bands of all servos of a model to `qfrc_passive`.

    Parameters
    ----------
    m, d : addresses of mjModel and mjData, positions and velocities computed
    """
    width = size(m, _NUSER)
    if width == 0:
        return
    n = size(m, _NACTUATOR)
    user, kind = floats(m, _USER, n * width), integers(m, _GAINTYPE, n)
    staged = integer(m, INTEGRATOR) == RK4
    for k in range(n):
        if kind[k] == _DCMOTOR and (staged or user[k * width] > 0):
            _dead_band(m, d, k, n, user[k * width], staged)


@jit
def _dead_band(m: int, d: int, k: int, n: int, half: float, staged: bool) -> None:
    if integers(m, _TRNTYPE, n)[k] != _JOINT:
        return
    out = integers(m, _OUTADR, n)[k]
    outputs = size(m, _NOUT)
    angle = floats(d, _LENGTH, outputs)[out]
    theirs, ours = _set_points(m, d, k, n)
    error = (ours if staged else theirs) - angle
    rest = error - max(-half, min(half, error))
    rate = floats(d, _VELOCITY, outputs)[out]
    prm = floats(m, _GAINPRM, n * _NGAIN)[k * _NGAIN : (k + 1) * _NGAIN]
    dof = integers(m, _DOFADR, size(m, _NJNT))[integers(m, _TRNID, 2 * n)[2 * k]]
    change = drive(prm, rest, rate) - drive(prm, theirs - angle, rate)
    floats(d, _PASSIVE, size(m, _NV))[dof] += prm[CONSTANT] / prm[RESISTANCE] * change


@jit
def drive(prm: NDArray[np.float64], error: float, rate: float) -> float:
    """Winding voltage of a `dcmotor` [V] from its gain parameters, error [rad] and rate [rad/s]."""
    torque = prm[_GAIN] * error - prm[DAMPING] * rate
    voltage = prm[RESISTANCE] / prm[CONSTANT] * torque + prm[CONSTANT] * rate
    limit = prm[_VOLTAGE]
    return float(max(-limit, min(limit, voltage)) if limit > 0 else voltage)


@jit
def _set_points(m: int, d: int, k: int, n: int) -> tuple[float, float]:
    """Commanded angle, clamped to its range, then slewed: MuJoCo's, and that of a stage of RK4.

    A set point `held` in a stage is that of its instant while it moves at the limit. In the last
    steps of the way, where MuJoCo's own set point closes five eighths of the `gap` in each, the
    quadratic has the sum of the ramp that ends in the first of them, within 4 %.
    """
    u = integers(m, _CTRLADR, n)[k]
    controls = size(m, _NU)
    command = floats(d, _CTRL, controls)[u]
    if characters(m, _LIMITED, controls)[u]:
        bounds = floats(m, _RANGE, 2 * controls)
        command = max(bounds[2 * u], min(bounds[2 * u + 1], command))
    slew = floats(m, _DYNPRM, n * _NDYN)[k * _NDYN + _SLEW]
    if not (slew > 0 and integers(m, _ACTNUM, n)[k] > 0):
        return float(command), float(command)
    held = floats(d, _ACT, size(m, _NA))[integers(m, _ACTADR, n)[k]]
    step, gap = slew * number(m, TIMESTEP), command - held
    theirs = max(held - step, min(held + step, command))
    ours = held if abs(gap) >= step else command - gap * abs(gap) / step
    return float(theirs), float(ours)
