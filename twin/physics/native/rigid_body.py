"""Forces and velocities of points of rigid bodies, from MuJoCo's com-based motion axes."""

import numpy as np
from numpy.typing import NDArray

from twin.physics.native.cache import jit
from twin.physics.native.layout import DATA, MODEL, floats, integers, size

Vector = tuple[float, float, float]
Array = NDArray[np.float64]

_COM, _CDOF, _CVEL = DATA["subtree_com"], DATA["cdof"], DATA["cvel"]
_PASSIVE, _NV, _NBODY = DATA["qfrc_passive"], MODEL["nv"], MODEL["nbody"]
_ROOT, _PARENT, _WELD = MODEL["body_rootid"], MODEL["dof_parentid"], MODEL["body_weldid"]
_DOF, _DOFS = MODEL["body_dofadr"], MODEL["body_dofnum"]


@jit
def cross(a: Vector, b: Vector) -> Vector:
    """A × b."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@jit
def dot(a: Vector, b: Vector) -> float:
    """A · b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@jit
def turn(rotation: Array, v: Vector) -> Vector:
    """Local to world, by a flat rotation matrix (9,)."""
    r = rotation
    return (
        r[0] * v[0] + r[1] * v[1] + r[2] * v[2],
        r[3] * v[0] + r[4] * v[1] + r[5] * v[2],
        r[6] * v[0] + r[7] * v[1] + r[8] * v[2],
    )


@jit
def turn_back(rotation: Array, v: Vector) -> Vector:
    """World to local, by a flat rotation matrix (9,)."""
    r = rotation
    return (
        r[0] * v[0] + r[3] * v[1] + r[6] * v[2],
        r[1] * v[0] + r[4] * v[1] + r[7] * v[2],
        r[2] * v[0] + r[5] * v[1] + r[8] * v[2],
    )


@jit
def vector(array: Array, row: int) -> Vector:
    """Row of a flat (3 n,) array."""
    return array[3 * row], array[3 * row + 1], array[3 * row + 2]


@jit
def velocity_at(m: int, d: int, body: int, point: Vector) -> tuple[Vector, Vector]:
    """World velocity of a body's point, and the body's angular velocity."""
    nbody = size(m, _NBODY)
    root = int(np.int64(integers(m, _ROOT, nbody)[body]))
    com = vector(floats(d, _COM, 3 * nbody), root)
    cvel = floats(d, _CVEL, 6 * nbody)[6 * body : 6 * body + 6]
    w = (cvel[0], cvel[1], cvel[2])
    c = cross(w, (point[0] - com[0], point[1] - com[1], point[2] - com[2]))
    return (cvel[3] + c[0], cvel[4] + c[1], cvel[5] + c[2]), w


@jit
def apply_force(m: int, d: int, body: int, point: Vector, force: Vector, torque: Vector) -> None:
    """Add a force at a point of a body, and a torque, to qfrc_passive; world frame.

    The same as mj_applyFT, along the chain of dofs above the body.
    """
    nbody, nv = size(m, _NBODY), size(m, _NV)
    root = int(np.int64(integers(m, _ROOT, nbody)[body]))
    com = vector(floats(d, _COM, 3 * nbody), root)
    arm = cross((point[0] - com[0], point[1] - com[1], point[2] - com[2]), force)
    t = (torque[0] + arm[0], torque[1] + arm[1], torque[2] + arm[2])
    moved = integers(m, _WELD, nbody)[body]
    cdof, passive = floats(d, _CDOF, 6 * nv), floats(d, _PASSIVE, nv)
    parent = integers(m, _PARENT, nv)
    dof = integers(m, _DOF, nbody)[moved] + integers(m, _DOFS, nbody)[moved] - 1
    while dof >= 0 and moved > 0:
        c = cdof[6 * dof : 6 * dof + 6]
        passive[dof] += (
            c[0] * t[0]
            + c[1] * t[1]
            + c[2] * t[2]
            + c[3] * force[0]
            + c[4] * force[1]
            + c[5] * force[2]
        )
        dof = parent[dof]
