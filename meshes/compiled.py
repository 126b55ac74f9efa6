"""The check of a mesh, for all meshes of a compiled model whatever format they came in."""

import mujoco
import numpy as np

from meshes.stl import check_closed


def check_model(model: mujoco.MjModel) -> None:
    """Refuse a model with a mesh that does not enclose a volume: its mass would be made up.

    Raises
    ------
    MeshError : names the first such mesh and counts its open edges
    """
    for mesh in range(model.nmesh):
        vertex, face = int(model.mesh_vertadr[mesh]), int(model.mesh_faceadr[mesh])
        points = model.mesh_vert[vertex : vertex + int(model.mesh_vertnum[mesh])]
        faces = model.mesh_face[face : face + int(model.mesh_facenum[mesh])].astype(np.int64)
        # vertices that a file repeats are one corner of the solid
        _, one = np.unique(points, axis=0, return_inverse=True)
        check_closed(f"mesh {model.mesh(mesh).name!r}", points[faces], one.reshape(-1)[faces])
