"""Whether a vehicle's air coefficients belong to its geometry.

A coarse check on loading, in milliseconds; `silhouette` makes the tables themselves.
"""

from typing import Final

import mujoco
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
STATIONS: Final = 120
LENGTH: Final = 0.02  # of the vehicle's length: ends and centroid of the planform
AREA: Final = 0.06  # of the planform, in which facets and fins seen askew cost up to 4 %
VISIBLE: Final = 2  # largest geom group of what the air meets; inner parts are in higher ones
REBUILD: Final = "`twin doctor --vehicle FILE` computes them from the geometry"
_TURN: Final = 2 * np.pi * np.arange(24) / 24


def misfits(model: mujoco.MjModel) -> tuple[str, ...]:
    """What of the numerics `air_*` does not fit the shapes of the body `vehicle`, one line each.

    Compared are both ends, the area and the centroid of the planform that the crossflow strips
    describe, and the stations of nose and fins, with the geoms that are not hidden.
    """
    parts = _outer_parts(model)
    z, area = (np.array(model.numeric(f"air_strip_{what}").data) for what in ("z", "area"))
    if not parts or not area.sum() > 0:
        return ()
    low = min(float(points[:, 2].min()) for points in parts)
    high = max(float(points[:, 2].max()) for points in parts)
    slack = LENGTH * (high - low)
    if z.max() > high + slack or z.min() < low - slack:
        ends = f"{z.min():.4g} to {z.max():.4g} m"
        found = [f"air_strip_z reaches from {ends}, the geometry from {low:.4g} to {high:.4g} m"]
    else:
        found = _planform(parts, z, area, low, high)
    for part in ("nose", "fin"):
        slopes, stations = (model.numeric(f"air_{part}_{what}").data for what in ("slope", "z"))
        found += [
            f"air_{part}_z = {at:.4g} m lies off the geometry, {low:.4g} to {high:.4g} m"
            for slope, at in zip(slopes, stations, strict=True)
            if slope and not low - slack <= at <= high + slack
        ]
    return tuple(f"the air coefficients are of another shape: {f}; {REBUILD}" for f in found)


def _planform(parts: list[Array], z: Array, area: Array, low: float, high: float) -> list[str]:
    edges = np.linspace(low, high, STATIONS + 1)
    middle = (edges[1:] + edges[:-1]) / 2
    width = np.max([_width(points, middle) for points in parts], axis=0)
    own, centre = width.sum() * (edges[1] - edges[0]), float(width @ middle / width.sum())
    stated, at = float(area.sum()), float(area @ z / area.sum())
    found = []
    if abs(stated / own - 1) > AREA:
        found.append(
            f"air_strip_area adds up to {stated * 1e4:.4g} cm², the geometry's planform to"
            f" {own * 1e4:.4g} cm²"
        )
    if abs(at - centre) > LENGTH * (high - low):
        found.append(
            f"the centroid of air_strip_area lies at {at:.4g} m, that of the geometry at"
            f" {centre:.4g} m"
        )
    return found


def _width(points: Array, z: Array) -> Array:
    """Width (…,) [m] of one part's shadow at stations z, taken as round about the axis."""
    reach = np.hypot(points[:, 0], points[:, 1])
    levels, at = np.unique(points[:, 2].round(6), return_inverse=True)
    widest = np.zeros(levels.size)
    np.maximum.at(widest, at, reach)
    return 2 * np.interp(z, levels, widest, left=0.0, right=0.0)


def _outer_parts(model: mujoco.MjModel) -> list[Array]:
    """Vertices (n, 3) of every visible geom of the vehicle, in its frame; joints at zero."""
    body = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, "vehicle")
    if body < 0:
        return []
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    rotation, origin = data.xmat[body].reshape(3, 3), data.xpos[body]
    parts = []
    for geom in np.flatnonzero(model.body_rootid[model.geom_bodyid] == body):
        if model.geom_contype[geom] or model.geom_group[geom] > VISIBLE:
            continue
        points = _points(model, int(geom))
        points = points @ data.geom_xmat[geom].reshape(3, 3).T + data.geom_xpos[geom]
        parts.append((points - origin) @ rotation)
    return parts


def _points(model: mujoco.MjModel, geom: int) -> Array:
    """Points on the surface of a geom, in its own frame."""
    kind, size = mujoco.mjtGeom(model.geom_type[geom]), model.geom_size[geom]
    if kind == mujoco.mjtGeom.mjGEOM_MESH:
        mesh = model.geom_dataid[geom]
        first, count = model.mesh_vertadr[mesh], model.mesh_vertnum[mesh]
        return np.asarray(model.mesh_vert[first : first + count], dtype=float)
    if kind == mujoco.mjtGeom.mjGEOM_BOX:
        corners = np.array(np.meshgrid(*[(-1, 1)] * 3)).reshape(3, -1).T
        return np.asarray(corners * size)
    rise = np.linspace(0.0, np.pi / 2, 8)
    profile = np.column_stack([np.cos(rise), np.sin(rise)])  # radius and height of a half
    if kind == mujoco.mjtGeom.mjGEOM_CYLINDER:
        profile = np.array([[size[0], size[1]]])
    elif kind == mujoco.mjtGeom.mjGEOM_CAPSULE:
        profile = profile * size[0] + [0.0, size[1]]
    elif kind == mujoco.mjtGeom.mjGEOM_ELLIPSOID:
        profile = profile * [size[:2].max(), size[2]]
    else:
        profile = profile * size[0]
    r, h = np.concatenate([profile, profile * [1.0, -1.0]]).T
    ring = np.stack([np.outer(r, np.cos(_TURN)), np.outer(r, np.sin(_TURN))], axis=-1)
    height = np.broadcast_to(h[:, None, None], (*ring.shape[:2], 1))
    return np.concatenate([ring, height], axis=-1).reshape(-1, 3)
