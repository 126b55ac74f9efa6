"""Drag of parachutes and streamers, without state: time and motion decide what is open."""

from twin.physics import aerodynamics as air
from twin.physics.native.cache import jit
from twin.physics.native.index import VEHICLE, slot, value, values
from twin.physics.native.layout import DATA, MODEL, floats, number, size
from twin.physics.native.rigid_body import Array, Vector, apply_force, turn, vector, velocity_at

_TIME, _XPOS, _XMAT, _NBODY = DATA["time"], DATA["xpos"], DATA["xmat"], MODEL["nbody"]
_AREA, _DELAY, _HEIGHT, _Z = (slot(f"chute_{n}") for n in ("drag_area", "delay", "height", "z"))
_CURVE, _IGNITION, _ALTITUDE = slot("motor_time"), slot("motor_ignition"), slot("air_altitude")
_WIND, _WIND_AZIMUTH, _EXPONENT = slot("wind_speed"), slot("wind_azimuth"), slot("wind_exponent")
_REFERENCE, _TURBULENCE = slot("wind_reference_height"), slot("wind_turbulence")
_MODES, _PROFILE = slot("wind_modes"), slot("air_profile")


@jit
def wind_of(d: int, data: Array, index: Array, point: Vector) -> Vector:
    """Velocity of the air at a point, world frame."""
    speed = value(data, index, _WIND)
    if speed == 0.0 and index[_PROFILE] < 0:
        return 0.0, 0.0, 0.0
    return air.wind(
        point[0],
        point[1],
        point[2],
        number(d, _TIME),
        speed,
        value(data, index, _WIND_AZIMUTH),
        value(data, index, _EXPONENT),
        value(data, index, _REFERENCE),
        value(data, index, _TURBULENCE),
        values(data, index, _MODES),
        values(data, index, _PROFILE),
    )


@jit
def density_at(data: Array, index: Array, height: float) -> float:
    """Density of the air at a height above ground: the profile's, else the standard one."""
    if index[_PROFILE] >= 0:
        return float(air.profile_at(values(data, index, _PROFILE), air.DENSITY, height))
    return float(air.density(height + value(data, index, _ALTITUDE)))


@jit
def sound_at(data: Array, index: Array, height: float) -> float:
    """Speed of sound at a height above ground, likewise."""
    if index[_PROFILE] >= 0:
        profile = values(data, index, _PROFILE)
        return float(air.sound(air.profile_at(profile, air.TEMPERATURE, height)))
    return float(air.speed_of_sound(height + value(data, index, _ALTITUDE)))


@jit
def is_open(after: float, rise: float, height: float, delay: float, below: float) -> bool:
    """Whether a parachute is open.

    `after` burnout [s], `rise` velocity up [m/s], `height` above the ground [m]; it opens `delay`
    after burnout, and on the way down `below` a height; either is off where negative.
    """
    if after < 0.0:
        return False
    return (delay >= 0.0 and after >= delay) or (rise < 0.0 and height <= below)


@jit
def recover(m: int, d: int, data: Array, index: Array) -> bool:
    """Add the drag of every open parachute at its place on the axis; whether there is one."""
    body, nbody = int(index[VEHICLE]), size(m, _NBODY)
    areas, delays = values(data, index, _AREA), values(data, index, _DELAY)
    heights, stations = values(data, index, _HEIGHT), values(data, index, _Z)
    curve = values(data, index, _CURVE)
    after = number(d, _TIME) - value(data, index, _IGNITION) - curve[curve.size - 1]
    hangs = False
    if after < 0.0:
        return hangs
    origin = vector(floats(d, _XPOS, 3 * nbody), body)
    rotation = floats(d, _XMAT, 9 * nbody)[9 * body : 9 * body + 9]
    for k in range(areas.size):
        arm = turn(rotation, (0.0, 0.0, stations[k]))
        point = (origin[0] + arm[0], origin[1] + arm[1], origin[2] + arm[2])
        velocity, _ = velocity_at(m, d, body, point)
        if areas[k] <= 0.0 or not is_open(after, velocity[2], point[2], delays[k], heights[k]):
            continue
        wind = wind_of(d, data, index, point)
        u = (velocity[0] - wind[0], velocity[1] - wind[1], velocity[2] - wind[2])
        rho = density_at(data, index, point[2])
        speed = (u[0] * u[0] + u[1] * u[1] + u[2] * u[2]) ** 0.5
        drag = -0.5 * rho * areas[k] * speed
        apply_force(m, d, body, point, (drag * u[0], drag * u[1], drag * u[2]), (0.0, 0.0, 0.0))
        hangs = True
    return hangs
