"""Check axes, pivot and nozzle of a gimbal against the controller's conventions."""

import mujoco
import numpy as np
from numpy.typing import NDArray

from hardware.frames import AXES
from twin.physics.mechanism.names import MechanismError, find, prefix

ALONG = 0.99  # cosine of 8°: tolerance of a printed part
OFF = 1e-3  # m, of an axis from the pivot
BODY, SITE = mujoco.mjtObj.mjOBJ_BODY, mujoco.mjtObj.mjOBJ_SITE


def check_frame(model: mujoco.MjModel) -> None:
    """Refuse a gimbal whose signs or pivot are not those of docs/mechanism.md.

    At home the axis of `gimbal_x` is x and that of `gimbal_y` y of the body `vehicle`, or of the
    mechanism's `mount` where there is no vehicle; both go through its origin; z of the site
    `nozzle` is its z. A gimbal that is turned otherwise would be steered the wrong way.

    Raises
    ------
    MechanismError : an axis, the pivot or the nozzle is elsewhere; says where it must be
    """
    before = prefix(model)
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    frame = _frame(model, before)
    origin, turn = data.xpos[frame], data.xmat[frame].reshape(3, 3)
    owner = model.body(frame).name
    for k, axis in enumerate(AXES):
        joint = model.joint(f"{before}{axis}")
        along = turn.T @ data.xaxis[joint.id]
        if along[k] < ALONG:
            raise MechanismError(
                f"joint {joint.name!r} turns about {_vector(along)} of body {owner!r}; it must be"
                f" its {axis}, {_vector(np.eye(3)[k])}"
            )
        off = turn.T @ (data.xanchor[joint.id] - origin)
        away = float(np.linalg.norm(np.delete(off, k)))
        if away > OFF:
            raise MechanismError(
                f"the axis of joint {joint.name!r} passes {away * 1e3:.3g} mm from the origin of"
                f" body {owner!r}, which is the pivot; it must go through it"
            )
    nozzle = find(model, SITE, f"{before}nozzle")
    if nozzle >= 0:
        thrust = turn.T @ data.site_xmat[nozzle].reshape(3, 3)[:, 2]
        if thrust[2] < ALONG:
            raise MechanismError(
                f"z of site '{before}nozzle', along which the thrust acts, is {_vector(thrust)} of"
                f" body {owner!r} at home; it must be its z, {_vector(np.eye(3)[2])}"
            )


def _frame(model: mujoco.MjModel, before: str) -> int:
    for name in ("vehicle", f"{before}mount"):
        if (body := find(model, BODY, name)) >= 0:
            return body
    return int(model.body_parentid[model.jnt_bodyid[model.joint(f"{before}x").id]])


def _vector(v: NDArray[np.float64]) -> str:
    return "({:.3g}, {:.3g}, {:.3g})".format(*np.round(v, 3) + 0.0)
