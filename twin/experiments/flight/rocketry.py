"""Figures of rocketry of a flight, computed from its ticks, and what is odd about its launch."""

import math
from typing import Final

import mujoco
import numpy as np

from analysis.compiled import njit
from analysis.flown import fast
from twin.errors import TwinError
from twin.experiments.flight.burnout import at_burnout
from twin.experiments.flight.figures import Figures
from twin.experiments.flight.track import (
    AIRSPEED,
    ATTACK,
    COMMAND,
    POSITION,
    TIME,
    VELOCITY,
    Array,
    Track,
)
from twin.physics.aerodynamics.atmosphere import (
    COLUMNS,
    DENSITY,
    TEMPERATURE,
    density,
    profile_at,
    sound,
    speed_of_sound,
)
from twin.plant.authority import numeric

AT_LIMIT: Final = 1e-6  # rad
TURN: Final = 0.5  # s, over which the direction of the path changes by more than the nose swings
HALF_NS: Final = 5e-10  # s; times are rounded
STEEP: Final = 15.0  # °, angle of attack off the rail that is reported
SUBSONIC: Final = 0.6  # Mach number up to which the normal forces hold, docs/aerodynamics.md
SHORT: Final = 1.0  # s, of a flight to the ground that is reported


def figures(track: Track, burnout: float, *, landed: bool) -> Figures:
    """Figures of the flight so far.

    Parameters
    ----------
    burnout : its time [s]
    landed : whether the last instant is at the ground
    """
    model, ticks = track.plant.model, track.ticks
    start, gimballed = _launch(model), track.plant.twin.gimbal != "fixed"
    time, height = ticks[:, TIME], ticks[:, POSITION][:, 2] - start[2]
    speed = np.linalg.norm(ticks[:, VELOCITY], axis=1)
    off, free = _rail_exit(model, ticks, start)
    top = int(height.argmax())
    passed = free < top < len(ticks) - 1
    up = ticks[: top + 1]
    pressure, mach = _air(model, up)
    climb = up[free:]
    # a tick past the highest point has a parachute's opening in it
    acceleration = _accelerations(up[:-1] if passed and up[-1, VELOCITY][2] < 0 else up)
    east, north = (ticks[-1, POSITION] - start)[:2].tolist()
    burnt = bool(time[-1] > burnout)
    burning = ticks[time <= burnout]
    at = _at(burnout, time, height), _at(burnout, time, speed)
    if len(burning) > 1:
        before = np.column_stack([burning[-2:, c] for c in (TIME, POSITION, VELOCITY)])
        place, velocity = at_burnout(np.ascontiguousarray(before), burnout)
        at = float(place[2] - start[2]), float(np.linalg.norm(velocity))
    return Figures(
        rail_exit_s=off,
        rail_exit_speed_m_s=None if off is None else _at(off, time, speed),
        rail_exit_angle_of_attack_deg=None
        if off is None
        else _largest_degrees(ticks[free : free + 1, ATTACK]),
        burnout_s=burnout if burnt else None,
        burnout_height_m=at[0] if burnt else None,
        burnout_speed_m_s=at[1] if burnt else None,
        apogee_m=float(height[top]) if passed else None,
        apogee_s=float(time[top]) if passed else None,
        max_ascent_speed_m_s=float(speed[: top + 1].max()),
        max_acceleration_m_s2=float(acceleration.max()) if acceleration.size else None,
        max_mach=float(mach.max()),
        max_dynamic_pressure_pa=float(pressure.max()),
        max_angle_of_attack_deg=_largest_degrees(climb[fast(climb[:, AIRSPEED]), ATTACK]),
        gimbal_saturation=_saturation(burning, track.limit) if gimballed else None,
        control_margin=_margin(burning, track.limit) if gimballed else None,
        turn_radius_m=_turn_radius(ticks[free:][time[free:] <= burnout]) if gimballed else None,
        downrange_m=math.hypot(east, north),
        end_east_m=east,
        end_north_m=north,
        impact_speed_m_s=float(speed[-2]) if landed else None,
    )


def notes(track: Track, *, landed: bool) -> tuple[str, ...]:
    """What is odd about the launch, one line each."""
    model, ticks = track.plant.model, track.ticks
    found = []
    off, free = _rail_exit(model, ticks, _launch(model))
    if off is not None and free < len(ticks):
        angle = math.degrees(ticks[free, ATTACK])
        speed = np.linalg.norm(ticks[:, VELOCITY], axis=1)
        if angle > STEEP:
            found.append(
                f"angle of attack {angle:.0f}° off the rail: it leaves the rail at"
                f" {_at(off, ticks[:, TIME], speed):.1f} m/s, slow for this wind; give a"
                " longer rail or more thrust"
            )
    if (mach := float(_air(model, ticks)[1].max())) > SUBSONIC:
        found.append(
            f"Mach {mach:.2f}: normal forces hold below Mach {SUBSONIC:g}; they do not depend"
            " on the Mach number"
        )
    ended = float(ticks[-1, TIME])
    if landed and ended < SHORT:
        elevation = numeric(model, "ramp_elevation")
        raised = "" if elevation is None else f" from {math.degrees(elevation[0]):.0f}°"
        found.append(f"reached the ground {ended:.2f} s after time zero{raised} of elevation")
    return tuple(found)


def _rail_exit(model: mujoco.MjModel, ticks: Array, start: Array) -> tuple[float | None, int]:
    """Time at which the lower lug left the rail [s], None without; first tick in free flight.

    That tick is past the last one where it is still on the rail.
    """
    length = numeric(model, "ramp_length")
    if length is None or length[0] <= 0.0:
        return None, 0
    away = np.linalg.norm(ticks[:, POSITION] - start, axis=1)
    off = np.flatnonzero(away > length[0])
    if not off.size:
        return None, len(ticks)
    k = int(off[0])
    return float(np.interp(length[0], away[k - 1 : k + 1], ticks[k - 1 : k + 1, TIME])), k


def _launch(model: mujoco.MjModel) -> Array:
    """Launch point of the pivot (3,) [m]."""
    q = int(model.joint("vehicle").qposadr[0])
    return np.array(model.qpos0[q : q + 3])


def _air(model: mujoco.MjModel, ticks: Array) -> tuple[Array, Array]:
    """Dynamic pressure [Pa] and Mach number at each tick; zero in a vacuum."""
    enabled, altitude = numeric(model, "air_enabled"), numeric(model, "air_altitude")
    if enabled is None or altitude is None or not enabled[0]:
        return np.zeros(len(ticks)), np.zeros(len(ticks))
    z = np.ascontiguousarray(ticks[:, POSITION][:, 2])
    profile = numeric(model, "air_profile")
    if profile is None:
        rho, sound = _standard_air(z, altitude[0])
    else:
        _check_top(profile, float(z.max()))
        rho, sound = _profile_air(z, profile)
    return 0.5 * rho * ticks[:, AIRSPEED] ** 2, ticks[:, AIRSPEED] / sound


def _saturation(burning: Array, limit: float) -> float | None:
    if not len(burning):
        return None
    return float((np.abs(burning[:, COMMAND]) >= limit - AT_LIMIT).any(axis=1).mean())


def _margin(burning: Array, limit: float) -> float | None:
    if not len(burning):
        return None
    largest = np.abs(burning[:, COMMAND]).max(axis=1)
    return float(1.0 - np.quantile(largest, 0.95) / limit)


def _turn_radius(flown: Array) -> float | None:
    """Smallest radius of the turns of a path over `TURN` [m]; very large where it is straight."""
    time = flown[:, TIME]
    first = np.flatnonzero(time <= time[-1] - TURN) if len(time) else np.empty(0, np.int64)
    if not first.size:
        return None
    last = np.searchsorted(time, time[first] + TURN - HALF_NS)
    speed = np.linalg.norm(flown[:, VELOCITY], axis=1)
    way = np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]) * np.diff(time))])
    a, b = flown[first, VELOCITY], flown[last, VELOCITY]
    angle = np.arctan2(np.linalg.norm(np.cross(a, b), axis=1), np.einsum("ij,ij->i", a, b))
    return float(((way[last] - way[first]) / np.maximum(angle, 1e-9)).min())


@njit()
def _standard_air(z: Array, altitude: float) -> tuple[Array, Array]:
    """Density [kg/m³] and speed of sound [m/s] at heights above ground [m]."""
    rho, sound = np.empty_like(z), np.empty_like(z)
    for k in range(z.size):
        rho[k], sound[k] = density(z[k] + altitude), speed_of_sound(z[k] + altitude)
    return rho, sound


@njit()
def _profile_air(z: Array, profile: Array) -> tuple[Array, Array]:
    """The same in a profile of the air."""
    rho, speed = np.empty_like(z), np.empty_like(z)
    for k in range(z.size):
        rho[k] = profile_at(profile, DENSITY, z[k])
        speed[k] = sound(profile_at(profile, TEMPERATURE, z[k]))
    return rho, speed


def _at(time: float, times: Array, values: Array) -> float:
    return float(np.interp(time, times, values))


def _check_top(profile: Array, highest: float) -> None:
    """Refuse a flight that leaves its wind and temperature profile.

    Raises
    ------
    TwinError : both heights
    """
    top = float(profile.reshape(COLUMNS, -1)[0, -1])
    if highest > top:
        raise TwinError(
            f"launch.profile: ends at {top:g} m above the ground and the flight reached"
            f" {highest:.0f} m; must cover it: add higher levels"
        )


def _accelerations(ticks: Array) -> Array:
    """Mean acceleration between ticks [m/s²]."""
    change = np.linalg.norm(np.diff(ticks[:, VELOCITY], axis=0), axis=1)
    return np.asarray(change / np.diff(ticks[:, TIME]))


def _largest_degrees(angle: Array) -> float | None:
    defined = angle[np.isfinite(angle)]
    return math.degrees(float(defined.max())) if defined.size else None
