"""Smallest gap between the parts of a mechanism over its workspace, from the parts as solids."""

import itertools
import math
from dataclasses import dataclass
from typing import Any, Final

import manifold3d
import mujoco
import numpy as np
from numpy.typing import NDArray

from hardware.frames import AXES
from twin.physics.mechanism.kinematics import Kinematics
from twin.physics.mechanism.names import MechanismError, find, prefix

Array = NDArray[np.float64]
MILLIMETRE: Final = 1000.0  # solids are in millimetres, as printed
FAR: Final = 1.0  # mm; larger gaps are not measured
FITTED: Final = 0.3  # mm at home, below which parts of one joint are fitted into each other
INNER: Final = ("propellant",)  # bodies inside another
SAGITTA: Final = 0.01  # mm; a polygon's distance inside its circle
SITE = mujoco.mjtObj.mjOBJ_SITE


@dataclass(frozen=True)
class Gap:
    """A smallest distance.

    Attributes
    ----------
    distance : [m]; 0 where the parts meet, `FAR` where none is nearer
    parts : names of the two; the second is `tube` for the bore
    angles : gimbal x and y at which it was measured [rad]
    """

    distance: float
    parts: tuple[str, str]
    angles: tuple[float, float]

    @property
    def text(self) -> str:
        """One line."""
        if not self.parts[0]:
            return f"more than {self.distance * 1e3:g} mm"
        x, y = np.degrees(self.angles)
        one, other = self.parts
        return f"{self.distance * 1e3:.2f} mm between {one} and {other} at {x:.3g}°, {y:.3g}°"


def solid(model: mujoco.MjModel, geom: int) -> Any:  # noqa: ANN401  manifold3d carries no types
    """Solid of a geom in its own frame [mm]; None where it has no volume.

    Round shapes are polyhedra at most `SAGITTA` inside them.
    """
    kind, size = model.geom_type[geom], model.geom_size[geom] * MILLIMETRE
    if kind == mujoco.mjtGeom.mjGEOM_MESH:
        return _mesh(model, int(model.geom_dataid[geom]))
    if kind == mujoco.mjtGeom.mjGEOM_BOX:
        return manifold3d.Manifold.cube(tuple(2 * size), True)
    if kind == mujoco.mjtGeom.mjGEOM_CYLINDER:
        return manifold3d.Manifold.cylinder(2 * size[1], size[0], size[0], _edges(size[0]), True)
    if kind == mujoco.mjtGeom.mjGEOM_SPHERE:
        return manifold3d.Manifold.sphere(size[0], _edges(size[0]))
    if kind == mujoco.mjtGeom.mjGEOM_CAPSULE:
        ball = manifold3d.Manifold.sphere(size[0], _edges(size[0]))
        return manifold3d.Manifold.batch_hull(
            [ball.translate((0, 0, sign * size[1])) for sign in (-1, 1)]
        )
    return None


def _edges(radius: float) -> int:
    """Edges of a circle of that radius [mm]."""
    return int(np.clip(np.ceil(np.pi / np.arccos(1 - min(SAGITTA / radius, 0.5))), 12, 128))


def _mesh(model: mujoco.MjModel, mesh: int) -> Any:  # noqa: ANN401
    vertex, face = model.mesh_vertadr[mesh], model.mesh_faceadr[mesh]
    points = model.mesh_vert[vertex : vertex + model.mesh_vertnum[mesh]] * np.float32(MILLIMETRE)
    faces = model.mesh_face[face : face + model.mesh_facenum[mesh]]
    body = manifold3d.Mesh(
        vert_properties=np.asarray(points, np.float32), tri_verts=np.asarray(faces, np.uint32)
    )
    body.merge()
    return manifold3d.Manifold(body)


class Clearance:
    """The parts of a mechanism, posed by the kinematic solution.

    Parts of links that a joint or a loop connects, and that are nearer than `FITTED` at home, are
    fitted into each other (a pin in its hole, a ball in its cup) and not compared.
    """

    def __init__(self, model: mujoco.MjModel) -> None:
        self._model, self._before = model, prefix(model)
        self._data = mujoco.MjData(model)
        self._kinematics = Kinematics(model)
        links = _members(model, self._before)
        inner = [f"{self._before}{name}" for name in INNER]
        self._solids: dict[str, tuple[int, Any]] = {}
        for geom in range(model.ngeom):
            body = int(model.geom_bodyid[geom])
            own = model.geom(geom).name.startswith(self._before) or not model.geom(geom).name
            if own and body in links and model.body(body).name not in inner:
                shape = solid(model, geom)
                if shape is not None:
                    name = model.geom(geom).name or f"geom {geom}"
                    self._solids[name.removeprefix(self._before)] = (geom, shape)
        self._pose(0.0, 0.0)
        now = self._posed()
        joined = _joined(model)
        self._pairs = []
        for a, b in itertools.combinations(self._solids, 2):
            pair = frozenset((self._link(a), self._link(b)))
            fitted = pair in joined and now[a].min_gap(now[b], FAR) < FITTED
            if len(pair) == 2 and not fitted:
                self._pairs.append((a, b))

    def _link(self, name: str) -> int:
        return int(self._model.body_weldid[self._model.geom_bodyid[self._solids[name][0]]])

    def _pose(self, x: float, y: float) -> None:
        """Place every body by the kinematic solution, rods turned the shortest way."""
        model, data, before = self._model, self._data, self._before
        mujoco.mj_resetData(model, data)
        servo = self._kinematics.servo_from_gimbal([x, y])
        if not np.isfinite(servo).all():
            raise MechanismError("the rods do not reach everywhere between the stops")
        for axis, angle, shaft in zip(AXES, (x, y), servo, strict=True):
            data.joint(f"{before}{axis}").qpos = angle
            if not self._kinematics.direct:
                data.joint(f"{before}servo_{axis}").qpos = shaft
        mujoco.mj_kinematics(model, data)
        for axis in () if self._kinematics.direct else AXES:
            names = (f"rod_{axis}_end", f"holder_{axis}_ball")
            end, ball = (data.site(f"{before}{name}").xpos for name in names)
            rod = int(model.site_bodyid[find(model, SITE, f"{before}rod_{axis}_end")])
            joint = model.body_jntadr[rod]
            parent = data.xmat[model.body_parentid[rod]].reshape(3, 3)
            now, want = ((p - data.xanchor[joint]) @ parent for p in (end, ball))
            length = np.linalg.norm(now) * np.linalg.norm(want)
            quat = np.append(length + now @ want, np.cross(now, want))
            at = model.jnt_qposadr[joint]
            data.qpos[at : at + 4] = quat / np.linalg.norm(quat)
        mujoco.mj_kinematics(model, data)

    def _posed(self) -> dict[str, Any]:
        """Every solid where it is now."""
        data = self._data
        return {
            name: shape.transform(
                np.hstack([
                    data.geom_xmat[geom].reshape(3, 3), data.geom_xpos[geom, :, None] * MILLIMETRE
                ])
            )
            for name, (geom, shape) in self._solids.items()
        }  # fmt: skip

    def gap(self, a: str, b: str, x: float, y: float) -> float:
        """Distance of two parts at gimbal angles [rad], in metres; `FAR` at most."""
        self._pose(x, y)
        now = self._posed()
        return float(now[a].min_gap(now[b], FAR)) / MILLIMETRE

    def smallest(self, n: int = 5, *, until: float = -math.inf) -> tuple[Gap, Gap | None]:
        """Smallest gap between parts and to the bore of the site `tube`, over n × n angles.

        The second is None where the mechanism has no such site.

        Parameters
        ----------
        until : gap below which no further angles are tried; the corners are then tried first [m]
        """
        ranges = [self._model.joint(f"{self._before}{a}").range for a in AXES]
        between = Gap(FAR / MILLIMETRE, ("", ""), (0.0, 0.0))
        bore: Gap | None = None
        poses = list(itertools.product(*(np.linspace(low, high, n) for low, high in ranges)))
        if until > 0.0:
            poses.sort(key=lambda pose: -math.hypot(*pose))
        for x, y in poses:
            self._pose(float(x), float(y))
            now = self._posed()
            between = self._nearest(now, between, (float(x), float(y)))
            bore = self._in_bore(now, bore, (float(x), float(y)))
            if min(between.distance, math.inf if bore is None else bore.distance) < until:
                break
        return between, bore

    def _nearest(self, now: dict[str, Any], best: Gap, angles: tuple[float, float]) -> Gap:
        boxes = {name: np.array(body.bounding_box()) for name, body in now.items()}
        for a, b in self._pairs:
            apart = np.maximum(boxes[a][:3] - boxes[b][3:], boxes[b][:3] - boxes[a][3:]).max()
            if apart < best.distance * MILLIMETRE:
                gap = float(now[a].min_gap(now[b], best.distance * MILLIMETRE)) / MILLIMETRE
                if gap < best.distance:
                    best = Gap(gap, (a, b), angles)
        return best

    def _in_bore(
        self, now: dict[str, Any], best: Gap | None, angles: tuple[float, float]
    ) -> Gap | None:
        """Nearest to the wall, of what lies ahead of the aft end of the tube and moves."""
        site = find(self._model, SITE, f"{self._before}tube")
        if site < 0:
            return None
        radius, half = self._model.site_size[site, :2] * MILLIMETRE
        turn = self._data.site_xmat[site].reshape(3, 3)
        place = self._data.site_xpos[site] * MILLIMETRE
        axis = turn[:, 2]
        still = int(self._model.body_weldid[self._model.site_bodyid[site]])
        for name, body in now.items():
            if self._link(name) == still:
                continue
            inside = body.trim_by_plane(tuple(axis), float(axis @ place) - half)
            points = np.asarray(inside.to_mesh().vert_properties)[:, :3]
            if len(points):
                local = (points - place) @ turn
                left = (radius - float(np.hypot(local[:, 0], local[:, 1]).max())) / MILLIMETRE
                if best is None or left < best.distance:
                    best = Gap(left, (name, "tube"), angles)
        return best


def _members(model: mujoco.MjModel, before: str) -> set[int]:
    """Bodies of the mechanism: its frame and all below."""
    frame = int(model.body_parentid[model.jnt_bodyid[model.joint(f"{before}x").id]])
    members = {frame}
    for body in range(frame + 1, model.nbody):
        if int(model.body_parentid[body]) in members:
            members.add(body)
    return members


def _joined(model: mujoco.MjModel) -> set[frozenset[int]]:
    """Pairs of links with a joint or a loop between them."""
    weld = model.body_weldid
    pairs = {
        frozenset((int(weld[b]), int(weld[model.body_parentid[b]])))
        for b in range(1, model.nbody)
        if model.body_jntnum[b]
    }
    for k in range(model.neq):
        ends = [int(model.eq_obj1id[k]), int(model.eq_obj2id[k])]
        if model.eq_objtype[k] == SITE:
            ends = [int(model.site_bodyid[s]) for s in ends]
        pairs.add(frozenset(int(weld[e]) for e in ends))
    return pairs
