"""What the air and the motor do to a vehicle at one instant, for the recording."""

import math
from collections.abc import Mapping
from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from analysis.compiled import njit
from twin.control.attitude import from_vertical, interpolate
from twin.physics.aerodynamics import wind as wind_at
from twin.physics.native.layout import number
from twin.plant.authority import numeric, thrust_curve

Array = NDArray[np.float64]
Integers = NDArray[np.int64]
STILL = 0.5  # m/s; an angle of attack is not defined below this airspeed
# position, velocity, attitude, rate, centres of mass and masses of all bodies
_POSITION, _VELOCITY, _ATTITUDE, _RATE, _CENTRES, _MASS = range(6)


class Air(NamedTuple):
    """What `blow` reads, and the values that it writes.

    Attributes
    ----------
    values : (8,) tilt x and y, airspeed, angle of attack, thrust and wind
    addresses : of position, velocity, attitude, rate, centres of mass and masses of all bodies
    members : bodies of the vehicle
    wind, modes, profile : parameters of the wind, gust modes, and profile over the height
    times, thrust : thrust curve [s, N]
    """

    values: Array
    addresses: Integers
    members: Integers
    wind: Array
    modes: Array
    profile: Array
    times: Array
    thrust: Array


class Flow:
    """Attitude to the vertical and to the air, airspeed and thrust of a vehicle.

    Wind is taken at the station of the centre of mass on the vehicle's axis, as the forces are.

    Parameters
    ----------
    position, velocity, attitude, rate : views of the vehicle's state, as `Plant` has them

    Attributes
    ----------
    air : for compiled code, which calls `blow`
    thrust : (1,) at the last `derive` [N]; zero without a motor
    signals : views by name of `analysis.schema`
    """

    def __init__(
        self, model: mujoco.MjModel, data: mujoco.MjData,
        position: Array, velocity: Array, attitude: Array, rate: Array,
    ) -> None:  # fmt: skip
        self._sources = (position, velocity, attitude, rate, data.xipos, model.body_mass)
        addresses = np.array([a.ctypes.data for a in self._sources], np.int64)
        vehicle = int(model.body("vehicle").id)
        members = np.flatnonzero(model.body_rootid == model.body_rootid[vehicle])
        profile = numeric(model, "air_profile")
        times, curve = thrust_curve(model) or (np.zeros(1), np.zeros(1))
        values = np.zeros(8)
        self.air = Air(
            values, addresses, members, *_wind(model),
            np.zeros(0) if profile is None else profile, times, curve,
        )  # fmt: skip
        self.thrust: Array = values[4:5]
        self.signals: Mapping[str, Array] = {
            "vehicle/tilt": values[0:2],
            "vehicle/airspeed": values[2:3],
            "vehicle/angle_of_attack": values[3:4],
            "vehicle/thrust": self.thrust,
            "vehicle/wind": values[5:8],
        }

    def derive(self, time_ns: int) -> None:
        """Compute all of it from the model's present state, at `time_ns` [ns]."""
        blow(self.air, time_ns * 1e-9)


def _wind(model: mujoco.MjModel) -> tuple[Array, Array]:
    """Wind parameters (5,) and gust modes; still air where the model has none."""
    names = ("speed", "azimuth", "exponent", "reference_height", "turbulence")
    values = [numeric(model, f"wind_{name}") for name in names]
    modes = numeric(model, "wind_modes")
    if modes is None or any(v is None for v in values):
        return np.array([0.0, 0.0, 0.0, 1.0, 0.0]), np.zeros(0)
    return np.array([v[0] for v in values if v is not None]), modes


@njit(nogil=True)
def blow(air: Air, time: float) -> None:
    """`Flow.derive` at `time` [s]."""
    out, addresses, members, wind, modes, profile, curve_time, curve_thrust = air
    speed, azimuth, exponent, reference, turbulence = wind
    p, v, q, r = addresses[_POSITION], addresses[_VELOCITY], addresses[_ATTITUDE], addresses[_RATE]
    x, y, z = number(p, 0), number(p, 8), number(p, 16)
    qw, qx, qy, qz = number(q, 0), number(q, 8), number(q, 16), number(q, 24)
    # body axes in the world: columns of the rotation matrix
    xx, xy, xz = (
        1.0 - 2.0 * (qy * qy + qz * qz),
        2.0 * (qx * qy + qw * qz),
        2.0 * (qx * qz - qw * qy),
    )
    yx, yy, yz = (
        2.0 * (qx * qy - qw * qz),
        1.0 - 2.0 * (qx * qx + qz * qz),
        2.0 * (qy * qz + qw * qx),
    )
    zx, zy = 2.0 * (qx * qz + qw * qy), 2.0 * (qy * qz - qw * qx)
    zz = 1.0 - 2.0 * (qx * qx + qy * qy)
    # the forces of the air act on the axis, at the station of the centre of mass
    moment, total = 0.0, 0.0
    for k in range(members.size):
        centre, mass = addresses[_CENTRES] + 24 * members[k], addresses[_MASS] + 8 * members[k]
        ahead = (
            (number(centre, 0) - x) * zx
            + (number(centre, 8) - y) * zy
            + (number(centre, 16) - z) * zz
        )
        moment, total = moment + number(mass, 0) * ahead, total + number(mass, 0)
    station = moment / total
    air_x, air_y, air_z = wind_at(
        x + station * zx, y + station * zy, z + station * zz,
        time, speed, azimuth, exponent, reference, turbulence, modes, profile,
    )  # fmt: skip
    # ω × r of that point: station (ω_y, -ω_x, 0) in body axes
    sx, sy = station * number(r, 8), -station * number(r, 0)
    rx = number(v, 0) + sx * xx + sy * yx - air_x
    ry = number(v, 8) + sx * xy + sy * yy - air_y
    rz = number(v, 16) + sx * xz + sy * yz - air_z
    airspeed = math.sqrt(rx * rx + ry * ry + rz * rz)
    out[0], out[1] = from_vertical(zx, zy, zz)
    out[2] = airspeed
    cosine = (zx * rx + zy * ry + zz * rz) / airspeed if airspeed > STILL else math.nan
    out[3] = math.acos(min(1.0, max(-1.0, cosine))) if airspeed > STILL else math.nan
    out[5], out[6], out[7] = air_x, air_y, air_z
    out[4] = interpolate(time, curve_time, curve_thrust)
