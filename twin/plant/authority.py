"""Gains, control authority and steering programmes of a vehicle from its model."""

from dataclasses import replace
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from hardware.frames import AXES
from twin.control.attitude import LARGEST_COMMAND, ControlConfig
from twin.control.guidance import FixedPoint
from twin.control.setpoint import Vector, off_axis
from twin.physics.aerodynamics.atmosphere import COLUMNS, SEA_LEVEL_DENSITY, mean_wind

Array = NDArray[np.float64]
HIGHEST, HEIGHTS = 5000.0, 40  # m, and number of heights, of the wind that guidance knows
INSTANT = 1e-9  # s; rise time of a thrust curve that begins above zero

LIMIT, STROKE = "control_limit", "gimbal_stroke"
OF_STOPS = 0.8  # of a mechanism's stops that may be commanded where it states no stroke

# numeric of the vehicle → field of ControlConfig
NUMERICS = {
    "control_kp": "kp",
    "control_ki": "ki",
    "control_kd": "kd",
    "control_cutoff": "cutoff",
    LIMIT: "limit",
    "control_rate_limit": "rate_limit",
    "control_error_limit": "error_limit",
    "control_authority_floor": "authority_floor",
}


def insert_control(spec: mujoco.MjSpec) -> None:
    """Give a vehicle the `control_*` numerics that it lacks, so that they can be set."""
    if spec.body("vehicle") is None or spec.joint("gimbal_x") is None:
        return
    for name, field in NUMERICS.items():
        if spec.numeric(name) is None:
            value = 0.0 if name == LIMIT else getattr(ControlConfig(), field)
            spec.add_numeric(name=name, size=1, data=[value])


def settle_limit(model: mujoco.MjModel) -> None:
    """Limit the commands of a vehicle that states no limit to its mechanism's stroke."""
    index = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_NUMERIC, LIMIT)
    if index >= 0 and model.numeric(LIMIT).data[0] == 0.0:
        model.numeric(LIMIT).data[0] = stroke(model)


def stroke(model: mujoco.MjModel) -> float:
    """Largest commanded angle of a mechanism, either way [rad]: as stated, or 0.8 of its stops."""
    stated = numeric(model, STROKE)
    if stated is not None:
        return float(stated[0])
    ends = stops(model)
    return LARGEST_COMMAND if ends is None else OF_STOPS * ends


def stops(model: mujoco.MjModel) -> float | None:
    """Angle of a mechanism's nearest stop [rad]; None where it has none."""
    ends = np.abs([model.joint(f"gimbal_{a}").range for a in AXES])
    return float(ends.min()) if ends.all() else None


def command_limit(model: mujoco.MjModel) -> float:
    """Largest commanded angle of a model's attitude loop, either way [rad]."""
    limit = numeric(model, LIMIT)
    return LARGEST_COMMAND if limit is None else float(limit[0])


def numeric(model: mujoco.MjModel, name: str) -> Array | None:
    """Values (n,) of a numeric, or None where the model has none of that name."""
    index = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_NUMERIC, name)
    if index < 0:
        return None
    begin, size = int(model.numeric_adr[index]), int(model.numeric_size[index])
    return np.array(model.numeric_data[begin : begin + size])


def lever_and_inertia(model: mujoco.MjModel) -> tuple[float, float]:
    """Distance from gimbal pivot to centre of mass [m], transverse inertia about that [kg m²].

    Of the vehicle at its initial pose, gimbal centred.
    """
    _, lever, transverse, _ = balance(model)
    return lever, transverse


def balance(
    model: mujoco.MjModel, data: mujoco.MjData | None = None
) -> tuple[float, float, float, float]:
    """Mass [kg], station of its centre [m], transverse and axial inertia about that [kg m²].

    Of the vehicle with the masses that the model has now, gimbal centred. `data` in its initial
    state may be given.
    """
    data = data or mujoco.MjData(model)
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
    transverse = float(0.5 * (in_body[0, 0] + in_body[1, 1]))
    return float(model.body_mass[members].sum()), lever, transverse, float(in_body[2, 2])


def thrust_curve(model: mujoco.MjModel) -> tuple[Array, Array] | None:
    """Times (n,) [s], ignition included, and thrusts (n,) [N] of the model's motor, or None.

    The curve begins and ends at zero, since interpolation holds its ends.
    """
    time, thrust = numeric(model, "motor_time"), numeric(model, "motor_thrust")
    if time is None or thrust is None:
        return None
    ignition = numeric(model, "motor_ignition")
    count = int(np.argmax(time)) + 1  # the rest of the table repeats the last point
    time = time[:count] + (0.0 if ignition is None else ignition[0])
    thrust = thrust[:count]
    if thrust[0] > 0.0:
        time, thrust = np.append(time[0] - INSTANT, time), np.append(0.0, thrust)
    if thrust[-1] > 0.0:
        time, thrust = np.append(time, time[-1] + INSTANT), np.append(thrust, 0.0)
    return time, thrust


def control_config(model: mujoco.MjModel) -> ControlConfig:
    """Gains from the model's `control_*` numerics, authority from its thrust curve.

    Gains that the model lacks keep their defaults. Lever and inertia are those of the loaded
    vehicle: burning raises the authority of the reference vehicle by 15 % (centre of mass 0.45 to
    0.49 m from the tail, inertia 0.099 to 0.084 kg m²), which the gain margin covers.
    """
    values = {field: numeric(model, name) for name, field in NUMERICS.items()}
    gains = {field: float(v[0]) for field, v in values.items() if v is not None}
    config = replace(ControlConfig(), **gains)  # type: ignore[arg-type]
    curve = thrust_curve(model)
    if curve is None:
        return config
    lever, inertia = lever_and_inertia(model)
    return replace(
        config,
        authority_time=tuple(float(t) for t in curve[0]),
        authority=tuple(float(f) * lever / inertia for f in curve[1]),
    )


def launch_of(model: mujoco.MjModel) -> tuple[Vector, Vector]:
    """Launch direction (unit) and position of the gimbal pivot [m] of the model's initial pose."""
    q = int(model.joint("vehicle").qposadr[0])
    x, y, z = (float(c) for c in model.qpos0[q : q + 3])
    matrix = np.empty(9)
    mujoco.mju_quat2Mat(matrix, model.qpos0[q + 3 : q + 7])
    return (float(matrix[2]), float(matrix[5]), float(matrix[8])), (x, y, z)


def fixed_point(
    model: mujoco.MjModel, right: float, up: float, distance: float = 500.0, **attributes: float
) -> FixedPoint:
    """Programme that steers to a point given relative to the launch direction.

    Parameters
    ----------
    right, up : angles off the launch direction, seen along it [rad]
    distance : from the launch point [m]
    attributes : further ones of `FixedPoint`

    Raises
    ------
    TwinError
        The point lies outside the 30° cone.
    """
    launch, origin = launch_of(model)
    toward = off_axis(launch, right, up)
    target = tuple(o + distance * t for o, t in zip(origin, toward, strict=True))
    return steer_to(model, (target[0], target[1], target[2]), **attributes)


def steer_to(model: mujoco.MjModel, target: Vector, **attributes: float) -> FixedPoint:
    """Programme that steers to `target` [m], world frame, with the vehicle's thrust, mass and drag.

    Raises
    ------
    TwinError
        The point lies outside the 30° cone around the launch direction.
    """
    launch, origin = launch_of(model)
    base = FixedPoint(target, launch, origin, **attributes)  # type: ignore[arg-type]
    known: dict[str, Any] = {"mass": float(model.body_subtreemass[model.body("vehicle").id])}
    curve = thrust_curve(model)
    if curve is not None:
        known["thrust_time"] = tuple(float(t) for t in curve[0])
        known["thrust"] = tuple(float(f) for f in curve[1])
    area, drag = numeric(model, "air_reference_area"), numeric(model, "air_axial_drag")
    nose, fins = numeric(model, "air_nose_slope"), numeric(model, "air_fin_slope")
    if area is not None and nose is not None and fins is not None:
        known["normal_force"] = float(0.5 * SEA_LEVEL_DENSITY * area[0] * (nose.sum() + fins.sum()))
    if area is not None and drag is not None:
        known["drag"] = float(0.5 * SEA_LEVEL_DENSITY * area[0] * drag[0])
    known |= _mean_wind(model)
    return replace(base, **(known | attributes))


def _mean_wind(model: mujoco.MjModel) -> dict[str, tuple[float, ...]]:
    """Mean wind over height as `FixedPoint` has it: what a forecast gives, without gusts."""
    profile = numeric(model, "air_profile")
    if profile is not None:
        height, east, north, _, _ = profile.reshape(COLUMNS, -1).tolist()
        return {
            "wind_height": tuple(height),
            "wind_east": tuple(east),
            "wind_north": tuple(north),
        }
    values = [
        numeric(model, f"wind_{n}") for n in ("speed", "azimuth", "reference_height", "exponent")
    ]
    if any(v is None for v in values):
        return {}
    speed, azimuth, reference, exponent = (float(v[0]) for v in values if v is not None)
    heights = np.concatenate([[0.0], np.geomspace(1.0, HIGHEST, HEIGHTS)])
    mean = np.array([mean_wind(speed, max(float(h), 1e-3), reference, exponent) for h in heights])
    return {
        "wind_height": tuple(heights.tolist()),
        "wind_east": tuple((mean * np.cos(azimuth)).tolist()),
        "wind_north": tuple((mean * np.sin(azimuth)).tolist()),
    }
