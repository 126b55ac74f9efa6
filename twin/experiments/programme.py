"""The setpoint programme of a flight, from its settings."""

import math

import mujoco
import numpy as np

from twin.config import Fly
from twin.control import PROGRAMMES, Setpoint
from twin.errors import TwinError
from twin.plant.authority import fixed_point, launch_of, steer_to
from twin.plant.launch import check_launch

Vector = tuple[float, float, float]


def setpoint(config: Fly, model: mujoco.MjModel) -> tuple[Setpoint, Vector | None]:
    """Setpoint programme of a flight, and the world point it steers to if any [m].

    Raises
    ------
    TwinError : numbers that make no programme, a point outside the cone, no gimbal to steer with,
        or a vehicle that cannot leave the ground
    """
    check_launch(model)
    _refuse_steering_without_gimbal(config, model)
    if config.target is None and config.programme != "point":
        launch, _ = launch_of(model)
        axis = _body_x(model) if config.turns_about == "x" else None
        if config.programme == "hold":
            return PROGRAMMES["hold"](launch=launch, axis=axis), None
        angle = math.radians(config.amplitude_deg)
        kind = PROGRAMMES[config.programme]
        programme = kind(launch=launch, axis=axis, amplitude=angle, begin=config.at_s)  # type: ignore[call-arg]
        return programme, None
    if config.target is not None:
        start = start_of(model)
        x, y, z = (o + t for o, t in zip(start, config.target, strict=True))
        steering = steer_to(model, (x, y, z))
    else:
        right, up = (math.radians(angle) for angle in config.off_axis_deg)
        steering = fixed_point(model, right, up, config.target_range_m)
    return steering, steering.target


def _refuse_steering_without_gimbal(config: Fly, model: mujoco.MjModel) -> None:
    if mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, "gimbal_x") >= 0:
        return
    if config.target is not None or config.programme != "hold":
        what = "--target" if config.target is not None else f"--programme {config.programme}"
        raise TwinError(
            f"{what}: this vehicle's motor is fixed (there is no joint 'gimbal_x'); only"
            " --programme hold is possible"
        )


def start_of(model: mujoco.MjModel) -> Vector:
    """Position of the gimbal pivot at the launch, in the world [m]."""
    q = int(model.joint("vehicle").qposadr[0])
    x, y, z = model.qpos0[q : q + 3]
    return float(x), float(y), float(z)


def _body_x(model: mujoco.MjModel) -> Vector:
    """The vehicle's x axis at the launch, in the world."""
    q = int(model.joint("vehicle").qposadr[0])
    matrix = np.empty(9)
    mujoco.mju_quat2Mat(matrix, model.qpos0[q + 3 : q + 7])
    return float(matrix[0]), float(matrix[3]), float(matrix[6])
