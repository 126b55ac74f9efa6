"""The 3D scene of a recording: which bodies are drawn, their meshes, and where they start."""

from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from twin.recorder import shapes

HIDDEN_GROUP = 3  # MuJoCo's viewer hides geom groups from 3 on: collision shapes
GROUND = "ground"


@dataclass(frozen=True, slots=True)
class BodyMesh:
    """What is drawn for one body, in its frame, baked into one mesh.

    Attributes
    ----------
    name : last part of the entity path `/world/<name>`
    body : index of the body
    triangles : mesh in the body frame [m]
    colors : RGBA per vertex (n, 4) uint8
    moves : false where the body is fixed to the world
    """

    name: str
    body: int
    triangles: shapes.Triangles
    colors: NDArray[np.uint8]
    moves: bool


def bodies(model: mujoco.MjModel) -> list[BodyMesh]:
    """Return every body that has something to draw; the world's own geoms are `ground`."""
    drawn = []
    for body in range(model.nbody):
        parts = [part for geom in _visible(model, body) if (part := _part(model, geom)) is not None]
        if parts:
            drawn.append(_baked(model, body, parts))
    return drawn


def _visible(model: mujoco.MjModel, body: int) -> list[int]:
    first, count = int(model.body_geomadr[body]), int(model.body_geomnum[body])
    return [g for g in range(first, first + count) if model.geom_group[g] < HIDDEN_GROUP]


def _part(model: mujoco.MjModel, geom: int) -> tuple[shapes.Triangles, NDArray[np.uint8]] | None:
    rgba = _rgba(model, geom)
    triangles = shapes.of_geom(model, geom)
    if triangles is None or rgba[3] == 0:
        return None
    rotation = np.zeros(9)
    mujoco.mju_quat2Mat(rotation, model.geom_quat[geom])
    moved = triangles.moved(rotation.reshape(3, 3), np.array(model.geom_pos[geom]))
    return moved, np.tile(rgba, (len(moved.vertices), 1))


def _rgba(model: mujoco.MjModel, geom: int) -> NDArray[np.uint8]:
    material = int(model.geom_matid[geom])
    own = np.array(model.geom_rgba[geom])
    # The compiler leaves the default grey on a geom that takes its colour from a material.
    is_default = np.allclose(own, [0.5, 0.5, 0.5, 1.0])
    rgba = model.mat_rgba[material] if material >= 0 and is_default else own
    return np.asarray(np.clip(np.round(np.array(rgba) * 255.0), 0, 255), dtype=np.uint8)


def _baked(
    model: mujoco.MjModel, body: int, parts: list[tuple[shapes.Triangles, NDArray[np.uint8]]]
) -> BodyMesh:
    offsets = np.cumsum([0, *(len(t.vertices) for t, _ in parts)])
    triangles = shapes.Triangles(
        np.vstack([t.vertices for t, _ in parts]),
        np.vstack([t.normals for t, _ in parts]),
        np.vstack([t.faces + np.int32(o) for (t, _), o in zip(parts, offsets, strict=False)]),
    )
    name = GROUND if body == 0 else (model.body(body).name or f"body_{body}")
    moves = int(model.body_weldid[body]) != 0 or int(model.body_mocapid[body]) >= 0
    return BodyMesh(name, body, triangles, np.vstack([c for _, c in parts]), moves)
