"""Triangles for MuJoCo's primitive shapes, in the geom's own frame, wound counter-clockwise."""

from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Faces = NDArray[np.int32]

SEGMENTS = 32  # of a circle; a 54 mm tube then deviates by 0.13 mm
PLANE_HALF_EXTENT = 1500.0  # m; of an infinite plane: exceeds the range of the shipped vehicles
GRID_SPACING, GRID_WIDTH = 50.0, 0.4  # [m]


@dataclass(frozen=True, slots=True)
class Triangles:
    """A mesh: vertices (n, 3) [m], unit normals (n, 3), faces (m, 3) as vertex indices."""

    vertices: Floats
    normals: Floats
    faces: Faces

    def moved(self, rotation: Floats, translation: Floats) -> "Triangles":
        """Rotate by the matrix (3, 3), then shift by (3,) [m]."""
        return Triangles(
            self.vertices @ rotation.T + translation, self.normals @ rotation.T, self.faces
        )


def flat(corners: Floats, faces: Faces) -> Triangles:
    """Give every face its own three vertices, so that edges stay sharp under shading."""
    points = corners[faces]  # (m, 3, 3)
    normal = np.cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0])
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    normal = normal / np.where(length > 0.0, length, 1.0)
    n = 3 * len(faces)
    return Triangles(
        points.reshape(n, 3),
        np.repeat(normal, 3, axis=0),
        np.arange(n, dtype=np.int32).reshape(-1, 3),
    )


def box(half: Floats) -> Triangles:
    """Box of half extents (3,) [m]."""
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * half
    sides = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    faces = [f for a, b, c, d in sides for f in ((a, b, c), (a, c, d))]
    return flat(corners, np.array(faces, dtype=np.int32))


def plane(half: Floats) -> Triangles:
    """Rectangle in z = 0 of half extents (2,) [m]; zero means infinite."""
    x, y = (h if h > 0.0 else PLANE_HALF_EXTENT for h in half[:2])
    corners = np.array([[-x, -y, 0], [x, -y, 0], [x, y, 0], [-x, y, 0]], dtype=np.float64)
    return flat(corners, np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32))


def grid() -> Triangles:
    """Stripes every 50 m just above an infinite plane, to show the scale."""
    end, half = PLANE_HALF_EXTENT, 0.5 * GRID_WIDTH
    places = np.arange(-end + 0.5 * GRID_SPACING, end, GRID_SPACING)  # none through the ramp
    stripe = plane(np.array([half, end]))
    shifts = np.column_stack([places, np.zeros_like(places), np.full_like(places, 0.02)])
    n = len(stripe.vertices)
    stripes = Triangles(
        (stripe.vertices + shifts[:, None]).reshape(-1, 3),
        np.tile(stripe.normals, (len(places), 1)),
        (stripe.faces + n * np.arange(len(places), dtype=np.int32)[:, None, None]).reshape(-1, 3),
    )
    quarter = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    return merged([stripes, stripes.moved(quarter, np.zeros(3))])


def merged(parts: Sequence[Triangles]) -> Triangles:
    """One mesh of several."""
    offsets = np.cumsum([0, *(len(part.vertices) for part in parts)])
    return Triangles(
        np.vstack([part.vertices for part in parts]),
        np.vstack([part.normals for part in parts]),
        np.vstack([part.faces + np.int32(o) for part, o in zip(parts, offsets, strict=False)]),
    )


def ellipsoid(radii: Floats) -> Triangles:
    """Ellipsoid of radii (3,) [m]."""
    latitude = np.linspace(-np.pi / 2, np.pi / 2, SEGMENTS // 2 + 1)
    unit = np.column_stack([np.cos(latitude), np.sin(latitude)])
    ball = _revolved(unit, unit)
    normals = ball.normals / radii
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return Triangles(ball.vertices * radii, normals, ball.faces)


def capsule(radius: float, half: float) -> Triangles:
    """Cylinder of half length `half` [m] about z with two half balls of `radius` [m]."""
    latitude = np.linspace(-np.pi / 2, 0.0, SEGMENTS // 4 + 1)
    south = np.column_stack([np.cos(latitude), np.sin(latitude)])
    north = south[::-1] * [1.0, -1.0]
    profile = np.vstack([radius * south - [0.0, half], radius * north + [0.0, half]])
    return _revolved(profile, np.vstack([south, north]))


def cylinder(radius: float, half: float) -> Triangles:
    """Cylinder, closed, of `radius` and half length `half` [m] about z."""
    profile = np.array(
        [[0, -half], [radius, -half], [radius, -half], [radius, half], [radius, half], [0, half]]
    )
    normals = np.array([[0, -1], [0, -1], [1, 0], [1, 0], [0, 1], [0, 1]], dtype=np.float64)
    return _revolved(profile, normals)


def of_geom(model: mujoco.MjModel, geom: int) -> Triangles | None:
    """Triangles of one geom in its own frame; None for an unsupported shape."""
    size = np.array(model.geom_size[geom])
    kind = mujoco.mjtGeom(int(model.geom_type[geom]))
    match kind:
        case mujoco.mjtGeom.mjGEOM_MESH:
            return _mesh(model, int(model.geom_dataid[geom]))
        case mujoco.mjtGeom.mjGEOM_PLANE:
            return plane(size)
        case mujoco.mjtGeom.mjGEOM_SPHERE:
            return ellipsoid(np.full(3, size[0]))
        case mujoco.mjtGeom.mjGEOM_ELLIPSOID:
            return ellipsoid(size)
        case mujoco.mjtGeom.mjGEOM_CAPSULE:
            return capsule(size[0], size[1])
        case mujoco.mjtGeom.mjGEOM_CYLINDER:
            return cylinder(size[0], size[1])
        case mujoco.mjtGeom.mjGEOM_BOX:
            return box(size)
    return None


def _mesh(model: mujoco.MjModel, mesh: int) -> Triangles:
    vertex, count = int(model.mesh_vertadr[mesh]), int(model.mesh_vertnum[mesh])
    face, faces = int(model.mesh_faceadr[mesh]), int(model.mesh_facenum[mesh])
    corners = np.array(model.mesh_vert[vertex : vertex + count], dtype=np.float64)
    return flat(corners, np.array(model.mesh_face[face : face + faces], dtype=np.int32))


def _revolved(profile: Floats, normals: Floats) -> Triangles:
    """Surface of revolution about z of (n, 2) points (r, z), south to north, and their normals."""
    turn = np.linspace(0.0, 2 * np.pi, SEGMENTS, endpoint=False)
    ring = np.column_stack([np.cos(turn), np.sin(turn)])  # (s, 2)

    def spun(points: Floats) -> Floats:
        around = points[:, None, 0:1] * ring[None]  # (n, s, 2)
        up = np.broadcast_to(points[:, None, 1:2], (len(points), SEGMENTS, 1))
        return np.concatenate([around, up], axis=2).reshape(-1, 3)

    row, column = np.mgrid[0 : len(profile) - 1, 0:SEGMENTS].reshape(2, -1)
    after = (column + 1) % SEGMENTS
    a, b = row * SEGMENTS + column, row * SEGMENTS + after
    c, d = b + SEGMENTS, a + SEGMENTS
    faces = np.vstack([np.column_stack([a, b, c]), np.column_stack([a, c, d])])
    return Triangles(spun(profile), spun(normals), faces.astype(np.int32))
