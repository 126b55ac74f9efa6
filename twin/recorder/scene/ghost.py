"""Attitudes of the gimbal beside the simulated one: the command as a ghost, axes as lines."""

from collections.abc import Mapping

import mujoco
import numpy as np
import rerun as rr
from numpy.typing import NDArray

from analysis import schema
from twin.recorder import columns, style
from twin.recorder.scene.scene import BodyMesh, united

Floats = NDArray[np.float64]
Stamps = NDArray[np.int64]

JOINTS = ("gimbal_x", "gimbal_y")
NOZZLE = "gimbal_nozzle"
GHOST = f"{schema.WORLD}/ghost"
AXES = f"{schema.WORLD}/axis"
GHOST_COLOR = (235, 235, 235, 75)
AXIS_RADIUS = -1.5  # Rerun takes a negative radius in points of the screen
BEYOND = 0.35  # of the distance from pivot to nozzle by which an axis is longer


class Ghost:
    """Copy of the gimbal's inner part at other angles than the recorded poses have.

    Parameters
    ----------
    model : of the scene
    bodies : its visible bodies

    Attributes
    ----------
    signals : whose angles are shown, as far as they are recorded
    active : false where the scene has no gimbal
    stops : lowest and highest angle of each axis [deg]; empty without
    """

    signals = ("gimbal/command", "gimbal/measured", "gimbal/simulated")

    def __init__(self, model: mujoco.MjModel, bodies: list[BodyMesh]) -> None:
        joints = [mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, name) for name in JOINTS]
        self.active = min(joints) >= 0
        self.stops: list[tuple[float, float]] = []
        if not self.active:
            return
        self._model, self._data = model, mujoco.MjData(model)
        self._places = [int(model.jnt_qposadr[j]) for j in joints]
        self._holder = int(model.jnt_bodyid[joints[1]])
        self._nozzle = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_SITE, NOZZLE)
        fixed = model.body_weldid[self._holder]
        inner = [b for b in bodies if model.body_weldid[b.body] == fixed]
        self._mesh = united(model, inner, self._holder) if inner else None
        if model.jnt_limited[joints].all():
            low, high = np.degrees(model.jnt_range[joints]).T.tolist()
            self.stops = list(zip(low, high, strict=True))

    def start(self, stream: rr.RecordingStream) -> None:
        """Write the mesh and the styles of the axes."""
        if not self.active:
            return
        if (mesh := self._mesh) is not None:
            ghost = rr.Mesh3D(
                vertex_positions=mesh.vertices.astype(np.float32),
                vertex_normals=mesh.normals.astype(np.float32),
                triangle_indices=mesh.faces,
                albedo_factor=GHOST_COLOR,
            )
            stream.log(GHOST, ghost, static=True)
        for name in self.signals:
            color, _ = style.meaning(name) or (style.SIMULATED, 0.0)
            line = rr.LineStrips3D.from_fields(colors=[color], radii=[AXIS_RADIUS])
            stream.log(_axis(name), line, static=True)

    def drain(
        self,
        stream: columns.Columns,
        time: Stamps,
        wall: Stamps,
        qpos: Floats,
        angles: Mapping[str, Floats],
    ) -> None:
        """Write poses and axes.

        Parameters
        ----------
        stream : recording
        time, wall : of the poses, in the experiment and since 1970 (n,) [ns]
        qpos : joint positions (n, nq) of the recorded poses
        angles : gimbal angles (n, 2) by signal [rad]; a row that is not finite shows nothing
        """
        if not self.active:
            return
        for name, rows in angles.items():
            known = np.isfinite(rows).all(axis=1)
            gone = np.flatnonzero(np.diff(known.astype(np.int8), prepend=1) < 0)
            if gone.size:
                stream.send_columns(
                    _axis(name), columns.times(time[gone], wall[gone]), columns.ends(gone.size)
                )
            if not known.any():
                continue
            pairs = zip(qpos[known], rows[known], strict=True)
            posed = np.array([self._pose(q, row) for q, row in pairs])
            when = columns.times(time[known], wall[known])
            ends = columns.segments(posed[:, 7:10], posed[:, 10:])
            stream.send_columns(_axis(name), when, ends)
            if name == "gimbal/command" and self._mesh is not None:
                pose = columns.transforms(posed[:, :3], posed[:, 3:7])
                stream.send_columns(GHOST, when, pose)

    def _pose(self, qpos: Floats, angle: Floats) -> Floats:
        """Position, attitude (wxyz), and both ends of the axis of the inner part (13,)."""
        data = self._data
        data.qpos[:] = qpos
        data.qpos[self._places] = angle
        mujoco.mj_kinematics(self._model, data)
        pivot = data.xpos[self._holder]
        if self._nozzle >= 0:
            along = (data.site_xpos[self._nozzle] - pivot) * (1.0 + BEYOND)
        else:
            along = -0.1 * data.xmat[self._holder, 2::3]
        return np.concatenate([pivot, data.xquat[self._holder], pivot, pivot + along])


def _axis(name: str) -> str:
    return f"{AXES}/{name.rsplit('/', 1)[-1]}"
