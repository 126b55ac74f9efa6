"""Binary STL with the same bytes for the same solid, and the check every mesh has to pass."""

import struct
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from meshes.errors import MeshError

HEADER, FACET = 84, 50  # bytes
GRID = 1e-3  # mm; far below what a printer resolves, far above the noise of a float
LARGEST = 20_000_000  # bytes; 400 000 triangles


def write(path: Path, solid: Any) -> None:  # noqa: ANN401  manifold3d carries no types
    """Write a solid as binary STL [mm], vertices on a grid and triangles in a fixed order."""
    mesh = solid.simplify(2 * GRID).to_mesh()
    points = np.round(np.asarray(mesh.vert_properties, np.float64)[:, :3] / GRID).astype(np.int64)
    path.write_bytes(_encode(_canonical(points, np.asarray(mesh.tri_verts, np.int64))))


def _canonical(points: NDArray[np.int64], faces: NDArray[np.int64]) -> NDArray[np.int64]:
    """Corners (n, 3, 3) with each triangle's least corner first and the triangles sorted."""
    _, index = np.unique(points, axis=0, return_inverse=True)
    faces = index.reshape(-1)[faces]  # rank of a corner, the same whatever order it came in
    unique = np.unique(points, axis=0)
    distinct = (faces != np.roll(faces, 1, axis=1)).all(axis=1)
    faces = faces[distinct]
    first = faces.argmin(axis=1)
    faces = np.take_along_axis(faces, (first[:, None] + np.arange(3)) % 3, axis=1)
    return unique[faces[np.lexsort(faces.T[::-1])]]


def _encode(corners: NDArray[np.int64]) -> bytes:
    triangles = (corners * GRID).astype(np.float32)
    normal = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    normal = normal / np.where(length > 0, length, 1)
    record = np.zeros(len(corners), np.dtype([("v", "<f4", (4, 3)), ("attribute", "<u2")]))
    record["v"] = np.concatenate([normal[:, None], triangles], axis=1)
    return b"millimetres".ljust(80) + struct.pack("<I", len(record)) + record.tobytes()


def read(path: Path) -> NDArray[np.float32]:
    """Corners (n, 3, 3) [mm] of a binary STL.

    Raises
    ------
    MeshError : the file is missing, too large, no binary STL, or holds a number that is not finite
    """
    try:
        size = path.stat().st_size
        content = path.read_bytes() if size <= LARGEST and path.is_file() else b""
    except OSError as error:
        raise MeshError(f"cannot read mesh {path}: {error.strerror}") from error
    if size > LARGEST:
        raise MeshError(f"{path}: {size} bytes; a mesh here has at most {LARGEST}")
    count = struct.unpack_from("<I", content, 80)[0] if size >= HEADER else 0
    if size != HEADER + FACET * count:
        raise MeshError(f"{path} is no binary STL: {size} bytes do not fit its triangle count")
    record = np.frombuffer(content, np.dtype([("v", "<f4", (4, 3)), ("a", "<u2")]), offset=HEADER)
    corners = record["v"][:, 1:]
    if not np.isfinite(corners).all():
        raise MeshError(f"{path}: a corner is not a finite number")
    return corners


def check(path: Path) -> None:
    """Refuse a mesh that does not enclose a volume: its mass would be made up.

    Raises
    ------
    MeshError : unreadable (see `read`), empty, open (with the number of open edges), or inside out
    """
    corners = read(path)
    _, index = np.unique(corners.reshape(-1, 3), axis=0, return_inverse=True)
    check_closed(str(path), corners, index.reshape(-1, 3))


def check_closed(name: str, corners: NDArray[np.float32], faces: NDArray[np.int64]) -> None:
    """`check` for triangles in memory: corners (n, 3, 3) and the vertices they are (n, 3)."""
    if not len(faces):
        raise MeshError(f"{name} holds no triangles")
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]).astype(np.int64)
    count = int(faces.max()) + 1
    there, times = np.unique(edges[:, 0] * count + edges[:, 1], return_counts=True)
    back = edges[:, 1] * count + edges[:, 0]
    lonely = np.setdiff1d(there, back, assume_unique=False).size + int((times > 1).sum())
    if lonely:
        raise MeshError(
            f"{name} is not watertight: {lonely} of its edges do not join exactly two triangles;"
            " repair it in the program that drew it"
        )
    a, b, c = corners.astype(np.float64).transpose(1, 0, 2)
    volume = float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6)
    if volume <= 0:
        raise MeshError(f"{name} is inside out: its volume is {volume:.3g}; flip its normals")
