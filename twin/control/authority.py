"""Gains and control authority of a vehicle from its model."""

import math
from dataclasses import replace

import mujoco
import numpy as np
from numpy.typing import NDArray

from twin.control.attitude import ControlConfig

Array = NDArray[np.float64]

# numeric of the vehicle → field of ControlConfig
NUMERICS = {
    "control_kp": "kp",
    "control_ki": "ki",
    "control_kd": "kd",
    "control_cutoff": "cutoff",
    "control_limit": "limit",
    "control_rate_limit": "rate_limit",
    "control_error_limit": "error_limit",
    "control_authority_floor": "authority_floor",
}


def numeric(model: mujoco.MjModel, name: str) -> Array | None:
    """Values (n,) of a numeric, or None where the model has none of that name."""
    index = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_NUMERIC, name)
    if index < 0:
        return None
    begin, size = int(model.numeric_adr[index]), int(model.numeric_size[index])
    return np.array(model.numeric_data[begin : begin + size])


def lever_and_inertia(model: mujoco.MjModel) -> tuple[float, float]:
    """Distance from gimbal pivot to centre of mass [m], transverse inertia about that [kg m²].

    Of the vehicle as compiled, gimbal centred.
    """
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    root = model.body("vehicle").id
    centre = data.subtree_com[root]
    members = [b for b in range(model.nbody) if int(model.body_rootid[b]) == root]
    total = np.zeros((3, 3))
    for body in members:
        R = data.ximat[body].reshape(3, 3)
        offset = data.xipos[body] - centre
        total += R @ np.diag(model.body_inertia[body]) @ R.T
        total += model.body_mass[body] * (offset @ offset * np.eye(3) - np.outer(offset, offset))
    R = data.xmat[root].reshape(3, 3)
    in_body = R.T @ total @ R
    lever = float(R[:, 2] @ (centre - data.xpos[root]))
    return lever, float(0.5 * (in_body[0, 0] + in_body[1, 1]))


def control_config(model: mujoco.MjModel) -> ControlConfig:
    """Gains from the model's `control_*` numerics, authority from its thrust curve.

    What the model does not carry keeps its default. Thrust is read from `motor_time` and
    `motor_thrust`; lever and inertia are those of the loaded vehicle, 15 % below the empty one's
    ratio at most (field notes: 0.45/0.099 → 0.49/0.084).
    """
    found = {field: numeric(model, name) for name, field in NUMERICS.items()}
    gains = {field: float(v[0]) for field, v in found.items() if v is not None}
    config = replace(ControlConfig(), **gains)  # type: ignore[arg-type]
    time, thrust = numeric(model, "motor_time"), numeric(model, "motor_thrust")
    if time is None or thrust is None:
        return config
    count = int(np.argmax(time)) + 1
    lever, inertia = lever_and_inertia(model)
    authority = thrust[:count] * lever / inertia
    return replace(
        config,
        authority_time=tuple(float(t) for t in time[:count]),
        authority=tuple(float(a) if math.isfinite(a) else 0.0 for a in authority),
    )
