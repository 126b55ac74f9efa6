"""Meshes and poses of a recording's 3D scene."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from analysis import schema
from analysis.recording import rrd
from analysis.recording.series import RecordingError

Floats = NDArray[np.float64]
ASIDE = ("focus", "axis", "ghost", "trail", "path", "thrust")  # of the viewer alone


@dataclass
class Body:
    """One body of the scene.

    Attributes
    ----------
    name : of the body
    vertices, normals : (n, 3) in its frame [m]
    faces : (m, 3) indices
    colors : (n, 4) RGBA
    time : of the poses (k,) [s]; one at zero for a fixed body
    position, attitude : in the world (k, 3) [m] and (k, 4) wxyz
    """

    name: str
    vertices: Floats
    normals: Floats
    faces: NDArray[np.int64]
    colors: NDArray[np.uint8]
    time: Floats
    position: Floats
    attitude: Floats


class _Bodies:
    """Entities directly below the world."""

    def __contains__(self, entity: object) -> bool:
        below = str(entity).removeprefix(f"{schema.WORLD}/")
        return below != str(entity) and "/" not in below and below not in ASIDE


def bodies(path: Path) -> list[Body]:
    """Visible bodies of a recording.

    Raises
    ------
    RecordingError : it has no 3D scene, or a damaged one
    """
    meshes: dict[str, dict[str, Floats]] = {}
    poses: dict[str, list[Floats]] = {}
    try:
        for entity, batch in rrd.batches(path, _Bodies()):
            name = entity.rsplit("/", 1)[-1]
            if "Mesh3D:vertex_positions" in batch.schema.names:
                meshes[name] = _mesh(batch)
            if "Transform3D:quaternion" in batch.schema.names:
                poses.setdefault(name, []).append(_poses(batch))
        found = [_body(name, meshes[name], poses[name]) for name in sorted(meshes) if name in poses]
    except (rrd.FormatError, pa.ArrowException, ValueError, IndexError, KeyError) as error:
        raise RecordingError(f"{path}: its 3D scene cannot be read ({error})") from None
    if not found:
        raise RecordingError(f"{path}: has no 3D scene")
    return found


def _flat(column: pa.Array) -> Floats:
    """Numbers of nested lists, in order."""
    while pa.types.is_list(column.type) or pa.types.is_fixed_size_list(column.type):
        column = column.flatten()
    return np.asarray(column.to_numpy(zero_copy_only=False))


def _mesh(batch: pa.RecordBatch) -> dict[str, Floats]:
    return {
        key: _flat(batch[f"Mesh3D:{name}"])
        for key, name in (
            ("vertices", "vertex_positions"),
            ("normals", "vertex_normals"),
            ("faces", "triangle_indices"),
            ("colors", "vertex_colors"),
        )
    }


def _poses(batch: pa.RecordBatch) -> Floats:
    """Rows of time [s], position and attitude wxyz (k, 8)."""
    position = _flat(batch["Transform3D:translation"]).reshape(-1, 3)
    xyzw = _flat(batch["Transform3D:quaternion"]).reshape(-1, 4)
    time = np.zeros(len(position))
    if schema.TIME in batch.schema.names:
        stamps = batch[schema.TIME].to_numpy(zero_copy_only=False)
        time = stamps.astype("timedelta64[ns]").astype(np.int64) / 1e9
    return np.column_stack([time, position, np.roll(xyzw, 1, axis=1)]).astype(np.float64)


def _body(name: str, mesh: dict[str, Floats], poses: list[Floats]) -> Body:
    rows = np.vstack(poses)
    rows = rows[np.argsort(rows[:, 0], kind="stable")]
    attitude = rows[:, 4:8]
    flips = np.sign((attitude[1:] * attitude[:-1]).sum(axis=1))
    attitude[1:] *= np.cumprod(np.where(flips < 0.0, -1.0, 1.0))[:, None]  # the shorter way round
    packed = mesh["colors"].astype(np.uint32)
    colors = np.stack([packed >> s & 255 for s in (24, 16, 8, 0)], axis=1).astype(np.uint8)
    vertices = mesh["vertices"].reshape(-1, 3).astype(np.float64)
    faces = mesh["faces"].reshape(-1, 3).astype(np.int64)
    if len(colors) != len(vertices) or (faces.size and faces.max() >= len(vertices)):
        raise ValueError(f"mesh of {name}")
    return Body(
        name, vertices, mesh["normals"].reshape(-1, 3).astype(np.float64), faces, colors,
        rows[:, 0], rows[:, 1:4], attitude,
    )  # fmt: skip
