"""The launch ramp: a rail that guides the lugs of the vehicle until they leave its end."""

import mujoco
import numpy as np
from numba.extending import register_jitable
from numpy.typing import NDArray

from twin.errors import TwinError

RELEASE = 0.02  # m; length over which the force on a lug fades out at the end of the rail
ASIDE = 0.04  # m; distance from the line of the rail at which the force begins to fade, `_fade`
BELOW = 0.25  # m; the same below the foot; a heavy vehicle on its stop is above it
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
def guide_force(
    offset: tuple[float, float, float],
    velocity: tuple[float, float, float],
    direction: tuple[float, float, float],
    length: float,
    stiffness: float,
    damping: float,
    stop: bool,
) -> tuple[float, float, float, float]:
    """Force of the rail on one lug [N], world frame, and the share of it that remains, 0 to 1.

    `offset` of the lug from the foot of the rail [m], its `velocity` [m/s], `direction` of the
    rail. The lug is on the rail while its travel is below `length` [m] and it is within centimetres
    of the line, so that a vehicle landing beside the rail is not affected. A spring and damper act
    across the line; with `stop`, another pushes up from the foot and never pulls.
    """
    ux, uy, uz = direction
    travel = offset[0] * ux + offset[1] * uy + offset[2] * uz
    if travel >= length or length <= 0.0:
        return 0.0, 0.0, 0.0, 0.0
    hold = min(1.0, (length - travel) / RELEASE)
    hold *= hold * (3.0 - 2.0 * hold)
    ax, ay, az = offset[0] - travel * ux, offset[1] - travel * uy, offset[2] - travel * uz
    on = _fade(np.sqrt(ax * ax + ay * ay + az * az), ASIDE) * _fade(-travel, BELOW)
    if on == 0.0:
        return 0.0, 0.0, 0.0, 0.0
    hold *= on
    along = velocity[0] * ux + velocity[1] * uy + velocity[2] * uz
    k, c = hold * stiffness, hold * damping
    fx = -k * ax - c * (velocity[0] - along * ux)
    fy = -k * ay - c * (velocity[1] - along * uy)
    fz = -k * az - c * (velocity[2] - along * uz)
    if stop and travel < 0.0:
        push = on * max(0.0, -stiffness * travel - damping * along)
        fx, fy, fz = fx + push * ux, fy + push * uy, fz + push * uz
    return fx, fy, fz, hold


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
