"""Inverse dynamics of two joints: the torques that give them wanted accelerations.

What acts on the model is known when MuJoCo asks for actuator forces, except for the forces of
constraints and of other actuators; those are left to the caller's feedback.
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from twin.physics.native.cache import jit
from twin.physics.native.layout import DATA, MODEL, floats, integers, size

Array = NDArray[np.float64]

_NV, _NC, _NBODY = MODEL["nv"], MODEL["nC"], MODEL["nbody"]
_ROWNNZ, _ROWADR, _COLIND = MODEL["M_rownnz"], MODEL["M_rowadr"], MODEL["M_colind"]
_ROOT, _WELD = MODEL["body_rootid"], MODEL["body_weldid"]
_BODY_DOF, _BODY_DOFS, _PARENT = MODEL["body_dofadr"], MODEL["body_dofnum"], MODEL["dof_parentid"]
_PASSIVE, _BIAS, _APPLIED = DATA["qfrc_passive"], DATA["qfrc_bias"], DATA["qfrc_applied"]
_LD, _DIAGONAL = DATA["qLD"], DATA["qLDiagInv"]
_XFRC, _XIPOS, _COM, _CDOF = (
    DATA["xfrc_applied"],
    DATA["xipos"],
    DATA["subtree_com"],
    DATA["cdof"],
)
_WRENCH: Final = 6


@jit
def torques(m: int, d: int, x: int, y: int, wanted_x: float, wanted_y: float):  # type: ignore[no-untyped-def]  # noqa: ANN201
    """Torques on the dofs x and y that give them the wanted accelerations.

    Solves the 2×2 system a = S M⁻¹ (f + Sᵀ τ) with MuJoCo's own factor of M.
    """
    nv = size(m, _NV)
    from_x, from_y, force = np.empty(nv), np.empty(nv), np.empty(nv)
    unit_response(m, d, nv, x, from_x)
    unit_response(m, d, nv, y, from_y)
    smooth_force(m, d, nv, force)
    for i in range(nv):
        wanted_x -= from_x[i] * force[i]
        wanted_y -= from_y[i] * force[i]
    xx, xy, yy = from_x[x], from_x[y], from_y[y]
    determinant = xx * yy - xy * xy
    return (
        (yy * wanted_x - xy * wanted_y) / determinant,
        (xx * wanted_y - xy * wanted_x) / determinant,
    )


@jit
def unit_response(m: int, d: int, nv: int, dof: int, out: Array) -> None:
    """Acceleration (nv,) of a unit torque on one dof: a column of M⁻¹ from MuJoCo's LᵀDL."""
    count, start = integers(m, _ROWNNZ, nv), integers(m, _ROWADR, nv)
    column, L = integers(m, _COLIND, size(m, _NC)), floats(d, _LD, size(m, _NC))
    diagonal = floats(d, _DIAGONAL, nv)
    out[:] = 0.0
    out[dof] = 1.0
    for i in range(dof, -1, -1):
        if out[i] != 0.0:
            for k in range(start[i], start[i] + count[i] - 1):
                out[column[k]] -= L[k] * out[i]
    for i in range(nv):
        out[i] *= diagonal[i]
        for k in range(start[i], start[i] + count[i] - 1):
            out[i] -= L[k] * out[column[k]]


@jit
def smooth_force(m: int, d: int, nv: int, out: Array) -> None:
    """Generalised force (nv,) of everything but actuators and constraints."""
    passive, bias = floats(d, _PASSIVE, nv), floats(d, _BIAS, nv)
    applied = floats(d, _APPLIED, nv)
    for i in range(nv):
        out[i] = passive[i] - bias[i] + applied[i]
    bodies = size(m, _NBODY)
    wrenches = floats(d, _XFRC, _WRENCH * bodies)
    for body in range(1, bodies):
        wrench = wrenches[_WRENCH * body : _WRENCH * (body + 1)]
        acts = False
        for k in range(_WRENCH):
            acts = acts or wrench[k] != 0.0
        if acts:
            _add_wrench(m, d, nv, bodies, body, wrench, out)


@jit
def _add_wrench(m: int, d: int, nv: int, bodies: int, body: int, wrench: Array, out: Array) -> None:
    """Add what a force and torque at a body's centre of mass does to the dofs that move it."""
    centre, com = floats(d, _XIPOS, 3 * bodies), floats(d, _COM, 3 * bodies)
    root = integers(m, _ROOT, bodies)[body]
    f, t = wrench[0:3], wrench[3:6]
    r = centre[3 * body : 3 * body + 3] - com[3 * root : 3 * root + 3]
    tx, ty, tz = (
        t[0] + r[1] * f[2] - r[2] * f[1],
        t[1] + r[2] * f[0] - r[0] * f[2],
        t[2] + r[0] * f[1] - r[1] * f[0],
    )
    mover = integers(m, _WELD, bodies)[body]
    dof = integers(m, _BODY_DOF, bodies)[mover] + integers(m, _BODY_DOFS, bodies)[mover] - 1
    if integers(m, _BODY_DOFS, bodies)[mover] == 0:
        return
    parent, axes = integers(m, _PARENT, nv), floats(d, _CDOF, _WRENCH * nv)
    while dof >= 0:
        c = axes[_WRENCH * dof : _WRENCH * (dof + 1)]
        out[dof] += c[0] * tx + c[1] * ty + c[2] * tz + c[3] * f[0] + c[4] * f[1] + c[5] * f[2]
        dof = parent[dof]
