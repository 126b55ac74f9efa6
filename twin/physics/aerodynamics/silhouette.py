"""The silhouette b(r) of a body: from a mesh, or from all geometry of a compiled vehicle.

For setting a model up, not for flying it: loads trimesh.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache

import mujoco
import numpy as np
from numpy.typing import NDArray

from twin.errors import TwinError
from twin.physics.aerodynamics import revolve

Array = NDArray[np.float64]
Width = Callable[[Array], Array]

NODES = 40  # stations of a vehicle: 1e-4 of the integral of magnitudes wherever the flow turns
_FEW_LEVELS = 4  # a prism or plate, whose every level of vertices is a kink; a round mesh has more
_LEAST = 4  # stations of a panel; a fin taper needs them
_SHORTEST_PANEL = 1e-2  # m; closer edges are merged
_THIN = 1e-7  # m; tolerance of a point or line, which has no hull
_NEAR = 3e-3  # m; distance from an edge at which its effect is evaluated
_STRAIGHT = 1e-6  # of the largest width; the end of a fin leaves 1e-2, a nose on its tube 2e-4


def silhouette(vertices: Array, faces: NDArray[np.int64]) -> Width:
    """Width b(z) [m] of a mesh's shadow, averaged over the roll angle.

    The mean width of a slice is the perimeter of its convex hull over π (Cauchy's theorem), so
    fins count alike at every roll angle. Axis z; `vertices` (n, 3) [m], `faces` (m, 3).
    """
    pairs = np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1)
    _, once = np.unique(pairs @ [len(vertices), 1], return_index=True)
    first, second = vertices[pairs[once].T]  # ends of every edge, (k, 3) each

    def width(z: Array) -> Array:
        result = np.zeros(np.size(z))
        for k, station in enumerate(np.ravel(z)):
            before, after = first[:, 2] - station, second[:, 2] - station
            cut = before * after < 0
            share = (before[cut] / (before[cut] - after[cut]))[:, None]
            points = first[cut] + share * (second[cut] - first[cut])
            points = np.vstack([points, first[before == 0], second[after == 0]])
            if len(points) > 2:
                result[k] = _perimeter(points[:, :2]) / np.pi
        return result.reshape(np.shape(z))

    return width


def _perimeter(points: Array) -> float:
    """Of the convex hull of points (n, 2) [m]; of a point or a line, which has no hull, too."""
    from scipy.spatial import ConvexHull

    extent = np.ptp(points, axis=0)
    if extent.min() < _THIN:
        return float(2.0 * np.hypot(*extent))
    return float(ConvexHull(points).area)


@cache
def gauss(count: int) -> tuple[Array, Array]:
    """Abscissae and weights (count,) of Gauss-Legendre quadrature on -1 to 1; read-only."""
    found = np.polynomial.legendre.leggauss(count)
    for part in found:
        part.setflags(write=False)
    return found


def strips(width: Width, edges: Sequence[float], nodes: Sequence[int]) -> tuple[Array, Array]:
    """Stations z (n,) [m] and areas b dz (n,) [m²] for the crossflow integral.

    Gauss-Legendre panels between `edges` (k + 1,) [m] with `nodes` (k,) each; edges belong where
    the silhouette jumps or kinks. Toward a tip, where b vanishes like a root, nodes are spaced
    evenly in the root of the distance. `width` gives b [m] at stations (…,) [m].
    """
    z, area = [], []
    for low, high, count in zip(edges[:-1], edges[1:], nodes, strict=True):
        x, weight = gauss(count)
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


def strip_table(model: mujoco.MjModel, nodes: int = NODES) -> tuple[Array, Array]:
    """Stations (nodes,) [m] and areas (nodes,) [m²] of the body `vehicle` and all it carries.

    Joints stand at their zero; geometry that may touch (collision) or lies in a hidden group (3 and
    up, inner parts) is ignored.

    Raises
    ------
    TwinError : no body `vehicle`, no geometry, or too few nodes for its panels
    """
    vertices, faces, extents = _geometry(model)
    width = silhouette(vertices, faces)
    edges = _edges(extents, width)
    lengths = np.diff(edges)
    if nodes < _LEAST * lengths.size:
        raise TwinError(f"{nodes} stations are too few: {lengths.size} panels need {_LEAST} each")
    counts = np.full(lengths.size, _LEAST)
    for _ in range(nodes - int(counts.sum())):
        counts[np.argmax(lengths / counts)] += 1
    return strips(width, list(edges), [int(c) for c in counts])


@dataclass(frozen=True)
class StripCheck:
    """The crossflow stations of a vehicle file against the geometry of the same file.

    Attributes
    ----------
    error : planform area of the file's stations over that of the geometry, minus 1
    numerics : `<numeric>` elements for the file, from the geometry
    """

    error: float
    numerics: str

    @property
    def text(self) -> str:
        """One line."""
        return f"{self.error * 100:+.2f} % planform against the geometry"


def strip_check(model: mujoco.MjModel) -> StripCheck:
    """Compare `air_strip_area` of a model with its geometry; loads trimesh.

    Raises
    ------
    TwinError : no body `vehicle`, no geometry, or no such numeric
    """
    size = _given(model, "air_strip_z").size
    z, area = strip_table(model, size)
    given = _given(model, "air_strip_area").sum()
    lines = [
        f'<numeric name="{name}" data="{" ".join(f"{v:.6g}" for v in values)}"/>'
        for name, values in (("air_strip_z", z), ("air_strip_area", area))
    ]
    return StripCheck(float(given / area.sum() - 1.0), "\n".join(lines))


def _given(model: mujoco.MjModel, name: str) -> Array:
    if mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_NUMERIC, name) < 0:
        raise TwinError(f"the model has no numeric {name!r}; docs/aerodynamics.md lists them")
    return np.array(model.numeric(name).data)


def _edges(extents: Array, width: Width) -> Array:
    """Stations where the outline jumps or kinks, those closer than the shortest panel merged.

    A part may end inside another: there the width does not change, and no panel need end.
    """
    ends = np.unique(extents)
    bend = np.abs(width(ends - _NEAR) - 2 * width(ends) + width(ends + _NEAR))
    ends = ends[bend > _STRAIGHT * width(ends).max()]
    keep = np.concatenate([[True], np.diff(ends) > _SHORTEST_PANEL])
    return np.asarray(ends[keep])


def _geometry(model: mujoco.MjModel) -> tuple[Array, NDArray[np.int64], Array]:
    """Vertices and faces in the vehicle's frame, and where the outer parts end or kink."""
    body = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, "vehicle")
    if body < 0:
        raise TwinError("the model has no body 'vehicle'")
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
        points, triangles = revolve.refined(points, triangles, silhouette(points, triangles))
        vertices.append(points)
        faces.append(triangles + count)
        count += len(points)
        if owner == body or model.body(owner).name == "gimbal_motor":
            levels = np.unique(points[:, 2].round(6))
            ends.append(levels if levels.size <= _FEW_LEVELS else levels[[0, -1]])
    if not vertices:
        raise TwinError("the body 'vehicle' has no geometry for a silhouette")
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
        shape = make.cylinder(radius=size[0], height=2 * size[1], sections=revolve.SEGMENTS)
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
