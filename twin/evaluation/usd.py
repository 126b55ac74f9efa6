"""The scene of a recording as OpenUSD, by MuJoCo's exporter (extra `export`)."""

import shutil
from pathlib import Path

import mujoco
import numpy as np

from analysis.export import Origin
from analysis.export.scene import Body, bodies

FPS = 50  # as poses are recorded


def write_usd(source: Path, target: Path, _: Origin) -> None:
    """Write bodies and their motion: the recorded poses, one frame for every 20 ms.

    Raises
    ------
    AnalysisError : the recording has no 3D scene
    """
    from mujoco.usd import exporter

    found = bodies(source)
    model = _model(found)
    data = mujoco.MjData(model)
    times = max((b.time for b in found), key=len)
    folder = target.with_suffix(".frames")
    usd = exporter.USDExporter(
        model, output_directory=folder.name, output_directory_root=str(folder.parent),
        max_geom=10_000, verbose=False,
    )  # fmt: skip
    for time in times:
        for body in found:
            row = max(int(np.searchsorted(body.time, time, side="right")) - 1, 0)
            mocap = int(model.body(body.name).mocapid[0])
            data.mocap_pos[mocap] = body.position[row]
            data.mocap_quat[mocap] = body.attitude[row]
        mujoco.mj_forward(model, data)
        usd.update_scene(data)
    usd.stage.SetTimeCodesPerSecond(FPS)
    usd.stage.SetFramesPerSecond(FPS)
    usd.stage.SetEndTimeCode(usd.frame_count)
    usd.stage.Export(str(target))
    shutil.rmtree(folder, ignore_errors=True)


def _model(found: list[Body]) -> mujoco.MjModel:
    """A body that is placed freely for each of the scene's, a mesh for each of its colours."""
    spec = mujoco.MjSpec()
    spec.visual.global_.offwidth = spec.visual.global_.offheight = 1024
    for body in found:
        placed = spec.worldbody.add_body(name=body.name, mocap=True)
        own = body.colors[body.faces[:, 0]]
        for k, color in enumerate(np.unique(own, axis=0)):
            faces = body.faces[(own == color).all(axis=1)]
            name = f"{body.name}_{k}"
            spec.add_mesh(
                name=name, uservert=body.vertices[faces].ravel().tolist(),
                userface=np.arange(faces.size).tolist(),
                inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL,
            )  # fmt: skip
            placed.add_geom(
                name=name, meshname=name, type=mujoco.mjtGeom.mjGEOM_MESH,
                rgba=(color / 255.0).tolist(), contype=0, conaffinity=0,
            )  # fmt: skip
    return spec.compile()
