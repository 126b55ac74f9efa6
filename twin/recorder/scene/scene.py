"""The 3D scene of a recording: its visible bodies and their meshes."""

from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from twin.recorder.scene import shapes

HIDDEN_GROUP = 3  # MuJoCo's viewer hides geom groups from 3 on: collision shapes
GROUND = "ground"

Part = tuple[shapes.Triangles, NDArray[np.uint8]]  # a shape and its RGBA per vertex


@dataclass(frozen=True, slots=True)
class BodyMesh:
    """All visible geoms of one body as one mesh in the body frame.

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

    @property
    def centre(self) -> shapes.Floats:
        """Middle of the bounding box (3,) [m] in the body frame."""
        low, high = self.triangles.vertices.min(axis=0), self.triangles.vertices.max(axis=0)
        return np.asarray(0.5 * (low + high))

    @property
    def radius(self) -> float:
        """Half the diagonal of the bounding box [m]."""
        return float(0.5 * np.linalg.norm(np.ptp(self.triangles.vertices, axis=0)))


def bodies(model: mujoco.MjModel) -> list[BodyMesh]:
    """Return all bodies with visible geoms; those of the world are `ground`."""
    visible = []
    for body in range(model.nbody):
        parts = [part for geom in _visible(model, body) for part in _parts(model, geom)]
        if parts:
            visible.append(_baked(model, body, parts))
    return visible


def united(model: mujoco.MjModel, parts: list[BodyMesh], frame: int) -> shapes.Triangles:
    """Meshes of some bodies as one, at the initial pose, in the frame of a body."""
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    turn = data.xmat[frame].reshape(3, 3).T
    return shapes.merged(
        [
            part.triangles.moved(
                turn @ data.xmat[part.body].reshape(3, 3),
                turn @ (data.xpos[part.body] - data.xpos[frame]),
            )
            for part in parts
        ]
    )


def _visible(model: mujoco.MjModel, body: int) -> list[int]:
    first, count = int(model.body_geomadr[body]), int(model.body_geomnum[body])
    return [g for g in range(first, first + count) if model.geom_group[g] < HIDDEN_GROUP]


def _parts(model: mujoco.MjModel, geom: int) -> list[Part]:
    rgba = _rgba(model, geom)
    triangles = shapes.of_geom(model, geom)
    if triangles is None or rgba[3] == 0:
        return []
    parts = [(triangles, rgba)]
    is_plane = model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_PLANE
    if is_plane and not np.any(model.geom_size[geom, :2]):
        parts.append((shapes.grid(), _lighter(rgba)))
    rotation = np.zeros(9)
    mujoco.mju_quat2Mat(rotation, model.geom_quat[geom])
    at = np.array(model.geom_pos[geom])
    moved = [(shape.moved(rotation.reshape(3, 3), at), color) for shape, color in parts]
    return [(shape, np.tile(color, (len(shape.vertices), 1))) for shape, color in moved]


def _lighter(rgba: NDArray[np.uint8]) -> NDArray[np.uint8]:
    return np.asarray(np.minimum(rgba.astype(np.int16) + 22, 255), dtype=np.uint8)


def _rgba(model: mujoco.MjModel, geom: int) -> NDArray[np.uint8]:
    material = int(model.geom_matid[geom])
    own = np.array(model.geom_rgba[geom])
    # The compiler leaves the default grey on a geom that takes its colour from a material.
    is_default = own.tolist() == [0.5, 0.5, 0.5, 1.0]
    rgba = _of_material(model, material) if material >= 0 and is_default else own
    return np.asarray(np.clip(np.round(np.array(rgba) * 255.0), 0, 255), dtype=np.uint8)


def _of_material(model: mujoco.MjModel, material: int) -> shapes.Floats:
    """RGBA of a material; of a textured one the mean, since textures are not recorded."""
    rgba = np.array(model.mat_rgba[material], dtype=np.float64)
    texture = int(model.mat_texid[material, mujoco.mjtTextureRole.mjTEXROLE_RGB])
    if texture >= 0:
        first, channels = int(model.tex_adr[texture]), int(model.tex_nchannel[texture])
        size = int(model.tex_height[texture]) * int(model.tex_width[texture]) * channels
        pixels = np.array(model.tex_data[first : first + size]).reshape(-1, channels)
        rgba[:3] *= pixels[:, :3].mean(axis=0) / 255.0
    return rgba


def _baked(model: mujoco.MjModel, body: int, parts: list[Part]) -> BodyMesh:
    triangles = shapes.merged([shape for shape, _ in parts])
    name = GROUND if body == 0 else (model.body(body).name or f"body_{body}")
    moves = int(model.body_weldid[body]) != 0 or int(model.body_mocapid[body]) >= 0
    return BodyMesh(name, body, triangles, np.vstack([c for _, c in parts]), moves)
