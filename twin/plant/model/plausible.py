"""Masses and sizes of a model held against each other: wrong units show before a flight."""

import math
from typing import Final

import mujoco
import numpy as np
from numpy.typing import NDArray

from twin.errors import TwinError
from twin.physics.mechanism.names import find, prefix
from twin.physics.motor.figures import check_figures
from twin.plant.authority import balance, numeric

Array = NDArray[np.float64]
BODY, SITE = mujoco.mjtObj.mjOBJ_BODY, mujoco.mjtObj.mjOBJ_SITE
DENSEST: Final = 8000.0  # kg/m³ of the cylinder around the vehicle: solid steel
LONGEST: Final = 100.0  # m; vehicles of this project are 0.3 to 10 m long
REACH: Final = 20.0  # geoms of a mechanism over the distance of its joints and sites from the pivot


def check_vehicle(model: mujoco.MjModel) -> None:
    """Refuse a vehicle whose mass, inertia and size contradict each other.

    Raises
    ------
    TwinError : the figure, its value and what would be right
    """
    body = find(model, BODY, "vehicle")
    data = mujoco.MjData(model)
    corners = [] if body < 0 else _corners(model, data, body)
    if not corners:
        return
    points = np.concatenate(corners)
    length = float(np.ptp(points[:, 2]))
    radius = float(np.hypot(points[:, 0], points[:, 1]).max())
    if length > LONGEST:
        raise TwinError(
            f"the vehicle is {length:.4g} m long; must be at most {LONGEST:g} m: are its lengths,"
            " or those of a mesh, in millimetres?"
        )
    mass, _, transverse, _ = balance(model, data)
    volume = math.pi * radius**2 * length
    if mass > DENSEST * volume:
        raise TwinError(
            f"the vehicle weighs {mass:.4g} kg in a cylinder of {2 * radius:.3g} m × {length:.3g} m"
            " around it, which is denser than steel; are its masses in grams?"
        )
    gyration = math.sqrt(transverse / mass)
    if gyration > length:
        raise TwinError(
            f"the vehicle's transverse inertia is {transverse:.4g} kg m², that of a mass"
            f" {gyration:.3g} m away from the centre of a vehicle {length:.3g} m long"
        )


def check_motor(model: mujoco.MjModel) -> None:
    """Refuse motor numerics that contradict each other; a vehicle without thrust passes.

    Raises
    ------
    TwinError : the figure, its value and what would be right
    """
    time, thrust = numeric(model, "motor_time"), numeric(model, "motor_thrust")
    names = ("propellant_mass", "loaded_mass", "diameter", "length")
    values = {name: numeric(model, f"motor_{name}") for name in names}
    if time is None or thrust is None or time.size != thrust.size or not thrust.any():
        return
    figures = {name: float(v[0]) for name, v in values.items() if v is not None}
    if len(figures) == len(names):
        propellant, loaded = figures.pop("propellant_mass"), figures.pop("loaded_mass")
        check_figures(
            "of the vehicle", impulse=float(np.trapezoid(thrust, time)), propellant=propellant,
            loaded=loaded, **figures,
        )  # fmt: skip


def check_mechanism(model: mujoco.MjModel) -> None:
    """Refuse a mechanism with a part far larger than the mechanism, such as a mesh in millimetres.

    Raises
    ------
    TwinError : the part, its size and that of the mechanism
    """
    before = prefix(model)
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    joint = model.joint(f"{before}x").id
    pivot = data.xanchor[joint]
    top = int(model.body_parentid[model.jnt_bodyid[joint]])
    members = _below(model, top)
    sites = data.site_xpos[np.isin(model.site_bodyid, list(members))]
    anchors = data.xanchor[np.isin(model.jnt_bodyid, list(members - {top}))]
    span = float(np.linalg.norm(np.concatenate([sites, anchors]) - pivot, axis=1).max(initial=0.0))
    for geom in range(model.ngeom):
        name = model.geom(geom).name
        if int(model.geom_bodyid[geom]) not in members or not name.startswith(before):
            continue
        size = float(model.geom_rbound[geom])
        if span > 0 and size > REACH * span:
            raise TwinError(
                f"geom {name!r} has a radius of {size:.3g} m in a mechanism whose joints and sites"
                f" lie within {span:.3g} m of the pivot; is its mesh in millimetres? Give the mesh"
                ' scale="0.001 0.001 0.001"'
            )


def _below(model: mujoco.MjModel, top: int) -> set[int]:
    members = {top}
    for body in range(top + 1, model.nbody):  # parents precede their children
        if int(model.body_parentid[body]) in members:
            members.add(body)
    return members


def _corners(model: mujoco.MjModel, data: mujoco.MjData, body: int) -> list[Array]:
    """Corners (8, 3) of the box around every geom of a vehicle, in its frame; joints at zero."""
    mujoco.mj_kinematics(model, data)
    turn, origin = data.xmat[body].reshape(3, 3), data.xpos[body]
    signs = np.array(np.meshgrid(*[(-1.0, 1.0)] * 3)).reshape(3, -1).T
    corners = []
    for geom in np.flatnonzero(model.body_rootid[model.geom_bodyid] == body):
        middle, half = model.geom_aabb[geom, :3], model.geom_aabb[geom, 3:]
        points = (middle + signs * half) @ data.geom_xmat[geom].reshape(3, 3).T
        corners.append((points + data.geom_xpos[geom] - origin) @ turn)
    return corners
