"""Mobility of a mechanism, counted from its bodies and joints."""

from dataclasses import dataclass

import mujoco
import numpy as np

from hardware.frames import AXES
from twin.physics.mechanism.names import find, prefix

FREEDOM = {
    mujoco.mjtJoint.mjJNT_FREE: 6,
    mujoco.mjtJoint.mjJNT_BALL: 3,
    mujoco.mjtJoint.mjJNT_SLIDE: 1,
    mujoco.mjtJoint.mjJNT_HINGE: 1,
}
BALL = 3  # a connect holds three coordinates of a point and leaves three rotations


@dataclass(frozen=True)
class Mobility:
    """The Chebychev–Grübler–Kutzbach count of a spatial mechanism.

    Attributes
    ----------
    count : degrees of freedom without the idle ones
    total : `6 (bodies - 1 - joints) + Σ freedoms`, with idle ones
    bodies : links that can move against each other, including the frame
    joints : joints and loop closures between them
    freedoms : sum of the degrees of freedom of the joints
    idle : degrees of freedom that move no other body, by name
    """

    count: int
    total: int
    bodies: int
    joints: int
    freedoms: int
    idle: tuple[str, ...]

    @property
    def text(self) -> str:
        """One line."""
        idle = f"; not counted: {', '.join(self.idle)}" if self.idle else ""
        return f"{self.count} ({self.bodies} links, {self.joints} joints and loops{idle})"


def mobility(model: mujoco.MjModel) -> Mobility:
    """Count the mobility of a compiled model's gimbal.

    Bodies welded together are one link; two joints in one body count a massless link between them.
    Idle are the spin of a link held by two balls alone about the line between them, and the play
    of a backlash joint.

    Raises
    ------
    MechanismError : the model has no gimbal
    """
    links = _links(model)
    joints = [j for j in range(model.njnt) if int(model.jnt_bodyid[j]) in links]
    loops = [e for e in range(model.neq) if _closes(model, e, links)]
    freedoms = sum(FREEDOM[mujoco.mjtJoint(int(model.jnt_type[j]))] for j in joints)
    freedoms += BALL * len(loops)
    bodies, pairs = 1 + len(joints), len(joints) + len(loops)
    total = 6 * (bodies - 1 - pairs) + freedoms
    idle = _spins(model, links, loops) + _plays(model, joints)
    return Mobility(total - len(idle), total, bodies, pairs, freedoms, tuple(idle))


def _links(model: mujoco.MjModel) -> set[int]:
    """Jointed bodies below the frame that carries the gimbal."""
    frame = int(model.body_parentid[model.jnt_bodyid[model.joint(f"{prefix(model)}x").id]])
    below = {frame}
    for body in range(frame + 1, model.nbody):  # parents precede their children
        if int(model.body_parentid[body]) in below:
            below.add(body)
    return {b for b in below - {frame} if model.body_jntnum[b] > 0}


def _closes(model: mujoco.MjModel, equality: int, links: set[int]) -> bool:
    connect = model.eq_type[equality] == mujoco.mjtEq.mjEQ_CONNECT
    return bool(connect and links & set(_ends(model, equality)))


def _ends(model: mujoco.MjModel, equality: int) -> tuple[int, int]:
    """Links that a connect joins."""
    ends = [int(model.eq_obj1id[equality]), int(model.eq_obj2id[equality])]
    if model.eq_objtype[equality] == mujoco.mjtObj.mjOBJ_SITE:
        ends = [int(model.site_bodyid[s]) for s in ends]
    return int(model.body_weldid[ends[0]]), int(model.body_weldid[ends[1]])


def _spins(model: mujoco.MjModel, links: set[int], loops: list[int]) -> list[str]:
    names = []
    for body in sorted(links):
        first = int(model.body_jntadr[body])
        balled = model.body_jntnum[body] == 1 and (
            model.jnt_type[first] == mujoco.mjtJoint.mjJNT_BALL
        )
        parents = np.asarray(model.body_parentid)
        alone = not any(int(parents[b]) == body for b in links)
        if balled and alone and sum(body in _ends(model, e) for e in loops) == 1:
            names.append(f"spin of {model.body(body).name}")
    return names


def _plays(model: mujoco.MjModel, joints: list[int]) -> list[str]:
    plays = {find(model, mujoco.mjtObj.mjOBJ_JOINT, f"{prefix(model)}play_{a}") for a in AXES}
    return [f"play of {model.joint(j).name}" for j in joints if j in plays]
