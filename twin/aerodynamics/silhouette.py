"""The silhouette b(r) of a body: from a mesh, or from all geometry of a compiled vehicle.

For setting a model up, not for flying it: loads trimesh.
"""

from collections.abc import Callable, Sequence
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from twin.errors import TwinError

Array = NDArray[np.float64]
Width = Callable[[Array], Array]

_SEGMENTS = 256  # of a circle: mean width of the polygon within (π/256)²/6 = 3e-5
_FEW_LEVELS = 4  # a prism or plate, whose every level of vertices is a kink; a round mesh has more
_SHORTEST_PANEL = 1e-2  # m; closer edges are one edge


def silhouette(vertices: Array, faces: NDArray[np.int64]) -> Width:
    """Width b(z) [m] of a mesh's shadow, averaged over the roll angle it is looked at from.

    The mean width of a slice is the perimeter of its convex hull over π (Cauchy's theorem), so
    fins count alike at every roll angle. Axis z; `vertices` (n, 3) [m], `faces` (m, 3).
    """
    import trimesh
    from scipy.spatial import ConvexHull

    mesh = trimesh.Trimesh(vertices, faces, process=False)
    slice_at: Any = trimesh.intersections.mesh_plane

    def width(z: Array) -> Array:
        result = np.zeros(np.size(z))
        for k, station in enumerate(np.ravel(z)):
            lines = slice_at(mesh, (0.0, 0.0, 1.0), (0.0, 0.0, station))
            if len(lines):
                result[k] = ConvexHull(lines.reshape(-1, 3)[:, :2]).area / np.pi
        return result.reshape(np.shape(z))

    return width


def strips(width: Width, edges: Sequence[float], nodes: Sequence[int]) -> tuple[Array, Array]:
    """Stations z (n,) [m] and areas b dz (n,) [m²] for the crossflow integral.

    Gauss-Legendre panels between `edges` (k + 1,) [m] with `nodes` (k,) each; edges belong where
    the silhouette jumps or kinks. Toward a tip, where b vanishes like a root, nodes are spaced
    evenly in the root of the distance. `width` gives b [m] at stations (…,) [m].
    """
    z, area = [], []
    for low, high, count in zip(edges[:-1], edges[1:], nodes, strict=True):
        x, weight = np.polynomial.legendre.leggauss(count)
        t, length = (1 + x) / 2, high - low
        station, stretch = low + length * t, np.ones(count)
        if high == edges[-1] and _vanishes(width, low, high):
            station, stretch = high - length * t**2, 2 * t
        z.append(station)
        area.append(length / 2 * weight * stretch * width(station))
    return np.concatenate(z), np.concatenate(area)


def _vanishes(width: Width, low: float, high: float) -> bool:
    near, far = width(np.array([high - 1e-3 * (high - low), low + 1e-3 * (high - low)]))
    return bool(near < 0.1 * far)


def strip_table(model: mujoco.MjModel, nodes: int = 32) -> tuple[Array, Array]:
    """Stations (nodes,) [m] and areas (nodes,) [m²] of the body `vehicle` and all it carries.

    Joints stand at their zero; geometry that may touch (collision) or lies in a hidden group (3 and
    up, inner parts) is passed over.

    Raises
    ------
    TwinError : no body `vehicle`, no geometry, or fewer than three nodes a panel
    """
    vertices, faces, extents = _geometry(model)
    edges = _edges(extents)
    lengths = np.diff(edges)
    if nodes < 3 * lengths.size:
        raise TwinError(f"{nodes} stations are too few; {lengths.size} panels need three each")
    counts = np.full(lengths.size, 3)
    for _ in range(nodes - int(counts.sum())):
        counts[np.argmax(lengths / counts)] += 1
    return strips(silhouette(vertices, faces), list(edges), [int(c) for c in counts])


def _edges(extents: Array) -> Array:
    """Stations where the outline jumps or kinks, those closer than the shortest panel merged."""
    ends = np.unique(extents)
    keep = np.concatenate([[True], np.diff(ends) > _SHORTEST_PANEL])
    return np.asarray(ends[keep])


def _geometry(model: mujoco.MjModel) -> tuple[Array, NDArray[np.int64], Array]:
    """Vertices and faces in the vehicle's frame, and where the outer parts end or kink."""
    body = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, "vehicle")
    if body < 0:
        raise TwinError("the model has no body 'vehicle' whose silhouette could be taken")
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    rotation, origin = data.xmat[body].reshape(3, 3), data.xpos[body]
    vertices, faces, ends, count = [], [], [], 0
    for geom in range(model.ngeom):
        owner = model.geom_bodyid[geom]
        if (
            model.body_rootid[owner] != body
            or model.geom_contype[geom]
            or model.geom_group[geom] > 2
        ):
            continue
        points, triangles = _shape(model, geom)
        points = points @ data.geom_xmat[geom].reshape(3, 3).T + data.geom_xpos[geom]
        points = (points - origin) @ rotation
        vertices.append(points)
        faces.append(triangles + count)
        count += len(points)
        if owner == body or model.body(owner).name == "gimbal_motor":
            levels = np.unique(points[:, 2].round(6))
            ends.append(levels if levels.size <= _FEW_LEVELS else levels[[0, -1]])
    if not vertices:
        raise TwinError("the body 'vehicle' has no geometry to take a silhouette from")
    return np.vstack(vertices), np.vstack(faces), np.concatenate(ends)


def _shape(model: mujoco.MjModel, geom: int) -> tuple[Array, NDArray[np.int64]]:
    """Vertices and faces of one geom in its own frame."""
    import trimesh

    kind, size = mujoco.mjtGeom(model.geom_type[geom]), model.geom_size[geom]
    make = trimesh.creation
    if kind == mujoco.mjtGeom.mjGEOM_MESH:
        mesh = model.geom_dataid[geom]
        first, number = model.mesh_vertadr[mesh], model.mesh_vertnum[mesh]
        start, count = model.mesh_faceadr[mesh], model.mesh_facenum[mesh]
        points = model.mesh_vert[first : first + number].astype(float)
        return points, model.mesh_face[start : start + count].astype(np.int64)
    if kind == mujoco.mjtGeom.mjGEOM_CYLINDER:
        shape = make.cylinder(radius=size[0], height=2 * size[1], sections=_SEGMENTS)
    elif kind == mujoco.mjtGeom.mjGEOM_CAPSULE:
        shape = make.capsule(radius=size[0], height=2 * size[1])
        shape.apply_translation([0, 0, -shape.bounds.mean(axis=0)[2]])
    elif kind == mujoco.mjtGeom.mjGEOM_BOX:
        shape = make.box(extents=2 * size)
    elif kind in (mujoco.mjtGeom.mjGEOM_SPHERE, mujoco.mjtGeom.mjGEOM_ELLIPSOID):
        shape = make.icosphere(subdivisions=5)
        shape.apply_scale(size if kind == mujoco.mjtGeom.mjGEOM_ELLIPSOID else np.full(3, size[0]))
    else:
        raise TwinError(f"geom {model.geom(geom).name!r} is a {kind.name}, which has no silhouette")
    return np.asarray(shape.vertices), np.asarray(shape.faces, dtype=np.int64)
