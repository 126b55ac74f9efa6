"""The moving part of the 3D scene: decimated body poses, trail and thrust arrow."""

from collections.abc import Mapping
from dataclasses import dataclass

import mujoco
import numpy as np
import rerun as rr
from numpy.typing import NDArray

from analysis import schema
from twin.recorder import columns, style
from twin.recorder.scene.ghost import NOZZLE, Ghost
from twin.recorder.scene.scene import BodyMesh, bodies, united

Floats = NDArray[np.float64]
Stamps = NDArray[np.int64]

VEHICLE, GIMBAL_PREFIX = "vehicle", "gimbal_"
GIMBAL = (
    "gimbal_holder",
    "gimbal_motor",
    "gimbal_ring",
)  # the close-up follows the first
FOCUS = "focus"
FOCUS_RADII = 2.7  # of the vehicle, which then fills half the height of the view
NEAR_RADII = 1.5  # of the gimbal
TRAIL_EVERY = 5  # poses to a piece of trail
PATH_POINTS = 2048  # of the whole path; every second one is dropped when full
METRES_PER_NEWTON = 0.02  # length of the thrust arrow

# Rerun takes a negative radius in points of the screen.
TRAIL_RADIUS, PATH_RADIUS = -1.5, -0.75
PATH_COLOR = (150, 150, 150, 120)


@dataclass(frozen=True, slots=True)
class Focus:
    """What a 3D view follows: a point of a body.

    Attributes
    ----------
    name : of the body
    centre : point (3,) in its frame [m]
    size : half the diagonal of the box that fills the view [m]
    """

    name: str
    centre: Floats
    size: float


class Poses:
    """Body poses of one model, and the trail, path and thrust arrow of the scene.

    Parameters
    ----------
    model : compiled model of the scene
    period_ns : experiment time between two poses [ns]
    capacity : poses kept until `full` becomes true
    """

    def __init__(self, model: mujoco.MjModel, period_ns: int, capacity: int = 1024) -> None:
        visible = bodies(model)
        self.fixed = [b for b in visible if not b.moves]
        self.moving = [b for b in visible if b.moves]
        names = [b.name for b in self.moving]
        near = GIMBAL if gimballed(model) else ()
        wanted = (VEHICLE, next((name for name in near if name in names), ""))
        self.focus = {
            k: _focus(model, visible, b) for k, b in enumerate(self.moving) if b.name in wanted
        }
        self.has_vehicle = VEHICLE in names
        self.ghost = Ghost(model, visible)
        self.full = False
        self._model = model
        self._index = np.array([b.body for b in self.moving], dtype=np.intp)
        self._period = period_ns
        self._due = -(2**62)
        self._n = 0
        self._time = np.zeros(capacity, dtype=np.int64)
        self._position = np.zeros((capacity, len(self.moving), 3))
        self._attitude = np.zeros((capacity, len(self.moving), 4))
        self._qpos = np.zeros((capacity, model.nq))
        self._nozzle = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_SITE, NOZZLE)
        self._jet = np.zeros((capacity, 2, 3))  # nozzle position, unit thrust direction
        self._trail = np.zeros((0, 3))
        self._skip = 0
        self._path = np.zeros((PATH_POINTS, 3))
        self._path_n, self._path_every, self._path_seen = 0, 1, 0

    def add(self, time_ns: int, data: mujoco.MjData) -> None:
        """Keep the poses of `data` if due."""
        if time_ns < self._due or self.full:
            return
        self._due = time_ns - time_ns % self._period + self._period
        n = self._n
        self._time[n] = time_ns
        np.take(data.xpos, self._index, axis=0, out=self._position[n])
        np.take(data.xquat, self._index, axis=0, out=self._attitude[n])
        self._qpos[n] = data.qpos
        if self._nozzle >= 0:
            self._jet[n, 0] = data.site_xpos[self._nozzle]
            self._jet[n, 1] = data.site_xmat[self._nozzle, 2::3]
        self._n = n + 1
        self.full = self._n == len(self._time)

    def add_all(self, time: Stamps, frames: Mapping[str, Floats]) -> None:
        """Keep those poses of ascending times (n,), at most `room`, that are due.

        Parameters
        ----------
        frames : arrays of `MjData` at these times, by name
        """
        period = time // self._period
        due = np.flatnonzero(np.diff(period, prepend=self._due // self._period - 1) > 0)
        if not due.size:
            return
        self._due = int(period[due[-1]] + 1) * self._period
        place = slice(self._n, self._n + due.size)
        self._time[place] = time[due]
        self._position[place] = frames["xpos"][due][:, self._index]
        self._attitude[place] = frames["xquat"][due][:, self._index]
        self._qpos[place] = frames["qpos"][due]
        if self._nozzle >= 0:
            self._jet[place, 0] = frames["site_xpos"][due, self._nozzle]
            self._jet[place, 1] = frames["site_xmat"][due, self._nozzle, 2::3]
        self._n = place.stop
        self.full = self._n == len(self._time)

    @property
    def room(self) -> int:
        """Number of poses until `full`."""
        return len(self._time) - self._n

    def start(self, stream: rr.RecordingStream) -> None:
        """Write static data: meshes, colours, poses of fixed bodies."""
        stream.log(schema.WORLD, rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
        data = mujoco.MjData(self._model)
        mujoco.mj_forward(self._model, data)
        for body in self.fixed + self.moving:
            path = f"{schema.WORLD}/{body.name}"
            stream.log(path, _mesh(body), static=True)
            if not body.moves:
                xyzw = np.roll(data.xquat[body.body], -1)
                pose = rr.Transform3D(translation=data.xpos[body.body], quaternion=xyzw)
                stream.log(path, pose, static=True)
        for focus in self.focus.values():
            stream.log(focus_path(focus.name), _invisible(focus.size), static=True)
        trail = rr.LineStrips3D.from_fields(colors=[style.SIMULATED], radii=[TRAIL_RADIUS])
        stream.log(f"{schema.WORLD}/trail", trail, static=True)
        self.ghost.start(stream)
        arrow = rr.Arrows3D.from_fields(colors=[style.THRUST], radii=[0.01])
        stream.log(f"{schema.WORLD}/thrust", arrow, static=True)

    @property
    def times(self) -> Stamps:
        """Experiment times of the poses kept (n,) [ns]."""
        return self._time[: self._n]

    def drain(
        self, stream: columns.Columns, wall: Stamps, thrust: Floats, angles: Mapping[str, Floats]
    ) -> None:
        """Send the kept poses and discard them.

        Parameters
        ----------
        stream : recording
        wall : time since 1970 of each pose (n,) [ns]
        thrust : thrust at each pose (n,) [N]
        angles : gimbal angles (n, 2) at each pose by signal [rad]
        """
        n = self._n
        time = self.times
        # copies, since Rerun may keep references
        position, attitude, jet = (
            a[:n].copy() for a in (self._position, self._attitude, self._jet)
        )
        stamps = columns.times(time, wall)
        for k, body in enumerate(self.moving):
            pose = columns.transforms(position[:, k], attitude[:, k])
            stream.send_columns(f"{schema.WORLD}/{body.name}", stamps, pose)
            if k in self.focus:
                middle = _middles(position[:, k], attitude[:, k], self.focus[k].centre)
                stream.send_columns(focus_path(body.name), stamps, columns.translations(middle))
            if body.name == VEHICLE:
                self._drain_trail(stream, time, wall, position[:, k])
        if self._nozzle >= 0:
            vectors = (METRES_PER_NEWTON * thrust)[:, None] * jet[:, 1]
            arrows = columns.arrows(jet[:, 0] - vectors, vectors)
            stream.send_columns(f"{schema.WORLD}/thrust", stamps, arrows)
        self.ghost.drain(stream, time, wall, self._qpos[:n], angles)
        self._n, self.full = 0, False

    def finish(self, stream: rr.RecordingStream) -> None:
        """Write the whole path as one thin line, visible at any time."""
        if self._path_n > 1:
            line = rr.LineStrips3D(
                [self._path[: self._path_n]], colors=[PATH_COLOR], radii=[PATH_RADIUS]
            )
            stream.log(f"{schema.WORLD}/path", line, static=True)

    def _drain_trail(
        self, stream: columns.Columns, time: Stamps, wall: Stamps, position: Floats
    ) -> None:
        pick = slice(self._skip, None, TRAIL_EVERY)
        self._skip = (self._skip - len(position)) % TRAIL_EVERY
        points = position[pick]
        chain = np.vstack([self._trail, points])
        pieces = len(chain) - 1
        if pieces > 0:
            stamps = columns.times(time[pick][-pieces:], wall[pick][-pieces:])
            piece = columns.segments(chain[:-1], chain[1:])
            stream.send_columns(f"{schema.WORLD}/trail", stamps, piece)
        self._trail = chain[-1:].copy()
        for point in points:
            self._keep(point)

    def _keep(self, point: Floats) -> None:
        self._path_seen += 1
        if self._path_seen % self._path_every:
            return
        self._path[self._path_n] = point
        self._path_n += 1
        if self._path_n == PATH_POINTS:
            self._path[: PATH_POINTS // 2] = self._path[::2].copy()
            self._path_n //= 2
            self._path_every *= 2


def gimballed(model: mujoco.MjModel) -> bool:
    """Whether the motor of a model can turn."""
    return bool(mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, f"{GIMBAL_PREFIX}x") >= 0)


def _focus(model: mujoco.MjModel, bodies: list[BodyMesh], body: BodyMesh) -> Focus:
    """The vehicle itself, or around a part of the gimbal all of the gimbal, at rest."""
    if body.name == VEHICLE:
        return Focus(body.name, body.centre, FOCUS_RADII * body.radius)
    whole = united(model, [b for b in bodies if b.name.startswith(GIMBAL_PREFIX)], body.body)
    low, high = whole.vertices.min(axis=0), whole.vertices.max(axis=0)
    return Focus(
        body.name, 0.5 * (low + high), NEAR_RADII * 0.5 * float(np.linalg.norm(high - low))
    )


def focus_path(body: str) -> str:
    """Entity that a 3D view tracks in place of the body itself.

    When Rerun starts to track, the distance is either 1.5 times the radius of the tracked entity's
    bounding box or that of the blueprint, depending on the loading order. A separate entity without
    rotation and of suitable size makes both equal.
    """
    return f"{schema.WORLD}/{FOCUS}/{body}"


def _invisible(radius: float) -> rr.Mesh3D:
    """Triangle without area whose bounding box has the given radius [m]."""
    ends = [[0.0, 0.0, -radius], [0.0, 0.0, radius], [0.0, 0.0, -radius]]
    return rr.Mesh3D(vertex_positions=ends, triangle_indices=[[0, 1, 2]])


def _middles(position: Floats, attitude: Floats, centre: Floats) -> Floats:
    """World position of a body-fixed point (3,) [m] for poses (n, 3), (n, 4) wxyz."""
    w, u = attitude[:, :1], attitude[:, 1:]
    across = np.cross(u, centre)
    return np.asarray(position + centre + 2.0 * (w * across + np.cross(u, across)))


def _mesh(body: BodyMesh) -> rr.Mesh3D:
    return rr.Mesh3D(
        vertex_positions=body.triangles.vertices.astype(np.float32),
        vertex_normals=body.triangles.normals.astype(np.float32),
        triangle_indices=body.triangles.faces,
        vertex_colors=body.colors,
    )
