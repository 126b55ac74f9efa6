"""Loads on a slender body: crossflow drag along its length, nose, fins, axial and roll drag.

Velocities are those of the body through the air, in the body frame, at a reference point on the
axis; r [m] is measured from there toward the nose. Loads act at that point: a force (x, y) and
a moment about it (x, y).
"""

import numpy as np
from numba.extending import register_jitable
from numpy.typing import NDArray

Load = tuple[float, float, float, float]  # force x, y [N]; moment x, y [N m]


@register_jitable
def crossflow(
    vx: float,
    vy: float,
    wx: float,
    wy: float,
    scale: float,
    z: NDArray[np.float64],
    area: NDArray[np.float64],
    reference: float,
) -> Load:
    """Crossflow drag, integrated strip by strip: ∫ ½ρ C |v⊥| v⊥ b(r) dr.

    `scale` = ½ρ C_dc; stations `z` (n,) [m] and their areas b dz `area` (n,) [m²] are the nodes
    of a quadrature, `reference` the station that r counts from. With v⊥ = v + ω×r.
    Source: Allen & Perkins, NACA Report 1048 (1951), with the local velocity of each strip.
    """
    fx, fy, mx, my = 0.0, 0.0, 0.0, 0.0
    for k in range(z.size):
        r = z[k] - reference
        ux, uy = vx + wy * r, vy - wx * r
        drag = -scale * area[k] * np.sqrt(ux * ux + uy * uy)
        fx += drag * ux
        fy += drag * uy
        mx -= r * drag * uy
        my += r * drag * ux
    return fx, fy, mx, my


@register_jitable
def area_moments(
    z: NDArray[np.float64], area: NDArray[np.float64], reference: float
) -> tuple[float, float, float, float, float]:
    """Area moments ∫ rⁿ b dr, n = 0…4, about the station `reference` [m²…m⁶]."""
    a0, a1, a2, a3, a4 = 0.0, 0.0, 0.0, 0.0, 0.0
    for k in range(z.size):
        r = z[k] - reference
        a0 += area[k]
        a1 += area[k] * r
        a2 += area[k] * r * r
        a3 += area[k] * r * r * r
        a4 += area[k] * r * r * r * r
    return a0, a1, a2, a3, a4


@register_jitable
def crossflow_area_moment(
    v0: float,
    w: float,
    rho: float,
    a: tuple[float, float, float, float, float],
    r_ref: float,
    dv_ref: float,
) -> tuple[float, float]:
    """Force and moment of the thesis's area-moment form, as printed, in one plane.

    M = ½ (1/C_v) ρ [v0³, -3v0²ω, 3v0ω², -ω³] · C_d[A1, A2, A3, A4] with
    C_v = |v0 - ω r_ref| + ∂v_ref; the force is the same with A0…A3. `a` holds C_d ∫ rⁿ b dr,
    v0 the freestream across the body [m/s], w the body's rate [rad/s] such that the air passes
    a point at v0 - ω r. Errs by tens of percent and may have the wrong sign: docs/aerodynamics.md.
    Source: the thesis behind this project, section MatRocket.
    """
    c_v = np.abs(v0 - w * r_ref) + dv_ref
    p0, p1, p2, p3 = v0 * v0 * v0, -3.0 * v0 * v0 * w, 3.0 * v0 * w * w, -w * w * w
    force = 0.5 / c_v * rho * (p0 * a[0] + p1 * a[1] + p2 * a[2] + p3 * a[3])
    moment = 0.5 / c_v * rho * (p0 * a[1] + p1 * a[2] + p2 * a[3] + p3 * a[4])
    return force, moment


@register_jitable
def crossflow_by_moments(
    vx: float,
    vy: float,
    wx: float,
    wy: float,
    rho: float,
    coefficient: float,
    z: NDArray[np.float64],
    area: NDArray[np.float64],
    reference: float,
    r_ref: float,
    dv_ref: float,
) -> Load:
    """Crossflow drag by the thesis's area-moment form, in the planes xz and yz apart.

    Arguments as for `crossflow`. The form is planar: the two planes do not know of each other,
    so the load depends on the roll angle (docs/aerodynamics.md says how much).
    """
    a0, a1, a2, a3, a4 = area_moments(z, area, reference)
    c = coefficient
    a = (c * a0, c * a1, c * a2, c * a3, c * a4)
    # air passes at -(v + ω×r): in xz -(vx + wy r), in yz -(vy - wx r)
    fx, my = crossflow_area_moment(-vx, wy, rho, a, r_ref, dv_ref)
    fy, mx = crossflow_area_moment(-vy, -wx, rho, a, r_ref, dv_ref)
    return fx, fy, -mx, my


@register_jitable
def normal_force(
    vx: float, vy: float, axial: float, wx: float, wy: float, scale: float, r: float
) -> Load:
    """Normal force of a nose or a fin set at its own angle of attack, acting at r.

    `scale` = ½ρ A C_Nα, `axial` the speed along the axis [m/s] that the part works in: q A C_Nα
    sin α cos α, which is Barrowman's C_Nα α at small angles and bounded at large ones.
    Source: Barrowman & Barrowman (1966), NARAM-8; local angle of attack adds the pitch damping.
    """
    ux, uy = vx + wy * r, vy - wx * r
    fx, fy = -scale * axial * ux, -scale * axial * uy
    return fx, fy, -r * fy, r * fx


@register_jitable
def axial_drag(vz: float, scale: float) -> float:
    """Drag along the axis [N]; `scale` = ½ρ A C_A [kg/m], vz the speed along the axis [m/s]."""
    drag: float = -scale * np.abs(vz) * vz
    return drag


@register_jitable
def roll_damping(vz: float, wz: float, scale: float) -> float:
    """Moment about the axis that opposes roll [N m]; `scale` = ½ρ · damping [kg m], see docs.

    Source: Barrowman (1967), The practical calculation of the aerodynamic characteristics of
    slender finned vehicles (each fin strip at the angle of attack ω y / v).
    """
    moment: float = -scale * np.abs(vz) * wz
    return moment
