"""The launch ramp: a rail that guides the lugs of the vehicle until they leave its end."""

import mujoco
import numpy as np
from numba.extending import register_jitable
from numpy.typing import NDArray

from twin.errors import TwinError

RELEASE = 0.02  # m; length over which the force on a lug fades out at the end of the rail
ASIDE = 0.04  # m; distance from the line of the rail at which the force begins to fade, `_fade`
BELOW = 0.25  # m; the same below the foot; a heavy vehicle on its stop is above it
REST = 1e-3  # m; travel over which the foot of a rigid rail ceases to carry the vehicle
# corner of a rigid rail's feedback, in radians per step: a double pole at -0.2/dt lies inside the
# stability region of every integrator here, Adams-Bashforth 4 (-0.3) being the narrowest; one at
# -0.8/dt lies in that of Runge-Kutta (-2.8), which keeps the corner of 1 ms in steps of 4 ms
FEEDBACK, FEEDBACK_RK4 = 0.2, 0.8
# rad/s; that of a step of 1 ms also for finer ones: with a corner that grows without end, a fading
# rail would hold ever longer, and flights would not converge as their steps become finer
CORNER = 200.0
STEEPEST = np.pi / 2 + 1e-5  # rad; 90 degrees, also where they are written with five digits


@register_jitable
def rail(elevation: float, azimuth: float) -> tuple[float, float, float]:
    """Unit vector up the rail, world frame."""
    level = np.cos(elevation)
    return level * np.cos(azimuth), level * np.sin(azimuth), np.sin(elevation)


@register_jitable
def _fade(distance: float, reach: float) -> float:
    """1 up to `reach`, 0 from twice that on, smooth between."""
    rest = min(1.0, max(0.0, 2.0 - distance / reach))
    return rest * rest * (3.0 - 2.0 * rest)


@register_jitable
def hold_of(
    offset: tuple[float, float, float], direction: tuple[float, float, float], length: float
) -> tuple[float, float, tuple[float, float, float]]:
    """Share of the rail's force that a lug feels, 0 to 1; its travel [m]; its place off the line.

    `offset` of the lug from the foot of the rail [m], `direction` of the rail. The lug is on the
    rail while its travel is below `length` [m] and it is within centimetres of the line, so that a
    vehicle landing beside the rail is not affected.
    """
    ux, uy, uz = direction
    travel = offset[0] * ux + offset[1] * uy + offset[2] * uz
    across = (offset[0] - travel * ux, offset[1] - travel * uy, offset[2] - travel * uz)
    if travel >= length or length <= 0.0:
        return 0.0, travel, across
    hold = min(1.0, (length - travel) / RELEASE)
    hold *= hold * (3.0 - 2.0 * hold)
    away = np.sqrt(across[0] * across[0] + across[1] * across[1] + across[2] * across[2])
    return hold * _fade(away, ASIDE) * _fade(-travel, BELOW), travel, across


@register_jitable
def guide_force(
    offset: tuple[float, float, float],
    velocity: tuple[float, float, float],
    direction: tuple[float, float, float],
    length: float,
    stiffness: float,
    damping: float,
    stop: bool,
) -> tuple[float, float, float, float]:
    """Force of an elastic rail on one lug [N], world frame, and the share of it that remains.

    Arguments as for `hold_of`, `velocity` of the lug [m/s]. A spring and damper act across the
    line; with `stop`, another pushes up from the foot and never pulls.
    """
    hold, travel, across = hold_of(offset, direction, length)
    if hold == 0.0:
        return 0.0, 0.0, 0.0, 0.0
    ux, uy, uz = direction
    along = velocity[0] * ux + velocity[1] * uy + velocity[2] * uz
    k, c = hold * stiffness, hold * damping
    fx = -k * across[0] - c * (velocity[0] - along * ux)
    fy = -k * across[1] - c * (velocity[1] - along * uy)
    fz = -k * across[2] - c * (velocity[2] - along * uz)
    if stop and travel < 0.0:
        push = hold * max(0.0, -stiffness * travel - damping * along)
        fx, fy, fz = fx + push * ux, fy + push * uy, fz + push * uz
    return fx, fy, fz, hold


@register_jitable
def rigid_forces(
    free: tuple[float, float],
    wanted: tuple[float, float],
    arms: tuple[float, float],
    holds: tuple[float, float],
    mass: float,
    inertia: float,
) -> tuple[float, float]:
    """Forces across a rigid rail on two lugs, in one plane [N].

    They give the lugs the `wanted` accelerations [m/s²] in place of `free`, those without a rail,
    at `arms` from the centre of mass towards the nose [m], of a rigid body of `mass` [kg] and
    transverse `inertia` about it [kg m²]. A lug with a hold of 0 feels none; in between, its share
    fades.
    """
    p, q = 1.0 / mass, 1.0 / inertia
    if holds[0] <= 0.0 and holds[1] <= 0.0:
        return 0.0, 0.0
    b0, b1 = wanted[0] - free[0], wanted[1] - free[1]
    if holds[1] <= 0.0:
        return b0 * holds[0] / (p + q * arms[0] * arms[0]), 0.0
    if holds[0] <= 0.0:
        return 0.0, b1 * holds[1] / (p + q * arms[1] * arms[1])
    a00 = (p + q * arms[0] * arms[0]) / holds[0]
    a11 = (p + q * arms[1] * arms[1]) / holds[1]
    a01 = p + q * arms[0] * arms[1]
    rest = a00 * a11 - a01 * a01
    return (a11 * b0 - a01 * b1) / rest, (a00 * b1 - a01 * b0) / rest


@register_jitable
def stop(travel: float, speed: float, free: float, corner: float) -> float:
    """Acceleration that the foot of a rigid rail gives the vehicle along it [m/s²], never pulling.

    `travel` of the lower lug from the foot [m], `speed` along the rail [m/s], `free` acceleration
    without the foot [m/s²], `corner` of the feedback [rad/s].
    """
    if travel >= REST:
        return 0.0
    if travel > 0.0:
        return max(0.0, -free) * (1.0 - travel / REST)
    push: float = max(0.0, -free - 2.0 * corner * speed - corner * corner * travel)
    return push


def launch_pose(model: mujoco.MjModel) -> NDArray[np.float64]:
    """Position [m] and quaternion (wxyz) of a vehicle whose lower lug rests at the foot, (7,).

    Body x points to the ground side of the rail: roll is such that pitching down turns about +y.

    Raises
    ------
    TwinError : an elevation beyond ±90 degrees, or a negative length
    """
    elevation, azimuth, length = (
        float(model.numeric(f"ramp_{name}").data[0]) for name in ("elevation", "azimuth", "length")
    )
    if not abs(elevation) <= STEEPEST:
        raise TwinError(f"ramp_elevation = {elevation:g} rad: must lie within ±π/2")
    if not 0 <= length < np.inf:
        raise TwinError(f"ramp_length = {length:g} m: must be 0 (no ramp) or positive")
    foot, lug = model.numeric("ramp_position").data[:3], model.numeric("ramp_lug").data[0]
    position = foot - lug * np.array(rail(elevation, azimuth))
    tilt, turn = (np.pi / 2 - elevation) / 2, azimuth / 2
    quaternion = (
        np.cos(turn) * np.cos(tilt),
        -np.sin(turn) * np.sin(tilt),
        np.cos(turn) * np.sin(tilt),
        np.sin(turn) * np.cos(tilt),
    )
    return np.array([*position, *quaternion])
