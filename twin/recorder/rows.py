"""One row a tick: the state, and what is derived from it, into the recorder's row."""

import math
import time
from typing import TYPE_CHECKING

import mujoco
import numpy as np
from numpy.typing import NDArray

from analysis.compiled import njit
from twin.control.attitude import interpolate
from twin.control.authority import thrust_curve
from twin.loop.clock import Ledger
from twin.loop.readings import Readings
from twin.loop.seats import Pilot
from twin.physics.aerodynamics import wind as wind_at
from twin.physics.native.layout import number
from twin.plant.model import AXES
from twin.plant.plant import Plant
from twin.recorder import Sink
from twin.recorder.rig_rows import RigRows

if TYPE_CHECKING:
    from twin.hil.turntable import Turntable

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
STILL = 0.5  # m/s; below this airspeed an angle of attack means nothing
GIMBAL = ("gimbal/command", "gimbal/simulated", "gimbal/rate/simulated")
LINKAGE = ("linkage/closure", "linkage/servo")
VEHICLE = (
    "vehicle/position",
    "vehicle/velocity",
    "vehicle/attitude",
    "vehicle/rate",
    "vehicle/mass",
)
FLOW = ("vehicle/tilt", "vehicle/airspeed", "vehicle/angle_of_attack", "vehicle/thrust")
TURNTABLE = ("turntable/simulated", "turntable/measured", "turntable/sigma")
CONTROL = ("control/setpoint", "control/error")


class Rows:
    """Gathers a run's signals from plant, pilot and rig; `write` is called once a tick.

    Attributes
    ----------
    signals : names of what is gathered, for the recorder
    command : (2,) latest commanded gimbal angle, written by the loop [rad]
    closure : (2,) gap of the two rod loops at the last row [m]; zeros without rods
    """

    def __init__(
        self,
        plant: Plant,
        pilot: Pilot | None = None,
        readings: Readings | None = None,
        ledger: Ledger | None = None,
        turntable: "Turntable | None" = None,
    ) -> None:
        self._plant, self._pilot, self._ledger = plant, pilot, ledger
        self._turntable = turntable
        self._rig = None if readings is None else RigRows(readings)
        self.command: Array = np.zeros(2)
        self.closure: Array = np.zeros(2)
        self._servo: Array = np.zeros(2)
        # tilt x y, airspeed, angle of attack, thrust, setpoint x y, error x y
        self._flow: Array = np.zeros(9)
        self._wall_ns = 0
        self._recorder: Sink | None = None
        self._places: Indices = np.empty(0, np.int64)
        self._addresses: Indices = np.empty(0, np.int64)
        self._sources = self._gather()
        self.signals = tuple(self._sources) + (self._rig.signals if self._rig else ())

    def _gather(self) -> dict[str, Array]:
        plant, flow = self._plant, self._flow
        sources = dict(
            zip(GIMBAL, (self.command, plant.gimbal_angle, plant.gimbal_rate), strict=True)
        )
        self._loops = _loops(plant.model)
        if self._loops.size:
            sources |= dict(zip(LINKAGE, (self.closure, self._servo), strict=True))
            self._shafts = np.array(
                [plant.model.joint(f"gimbal_servo_{a}").qposadr[0] for a in AXES], np.int64
            )
        if plant.has_vehicle and self._pilot is not None:
            vehicle = int(plant.model.body("vehicle").id)
            mass = plant.model.body_subtreemass[vehicle : vehicle + 1]
            state = (plant.position, plant.velocity, plant.attitude, plant.rate, mass)
            sources |= dict(zip(VEHICLE, state, strict=True))
            parts = (flow[0:2], flow[2:3], flow[3:4], flow[4:5])
            sources |= dict(zip(FLOW, parts, strict=True))
            sources |= dict(zip(CONTROL, (flow[5:7], flow[7:9]), strict=True))
            self._tables = _tables(plant.model)
            self._members = _members(plant.model, vehicle)
            self._centres, self._mass = plant.data.xipos, plant.model.body_mass
        if self._turntable is not None:
            t = self._turntable
            sources |= dict(zip(TURNTABLE, (t.simulated, t.measured, t.sigma), strict=True))
        if self._ledger is not None:
            sources["timing/lateness"] = self._ledger.latest
        return sources

    def bind(self, recorder: Sink) -> None:
        """Pair every value's address with its place in the row, so that a tick only copies.

        Sources and row stay where they are for life: MuJoCo's arrays by its design, the recorder's
        row by its contract, and the rest are this object's own.
        """
        self._recorder = recorder
        pairs = [
            (place, source.ctypes.data + k * source.itemsize)
            for name, source in self._sources.items()
            for k, place in enumerate(range(*recorder.slices[name].indices(recorder.row.size)))
        ]
        self._places, self._addresses = np.array(pairs, np.int64).T.copy()
        _copy(recorder.row.copy(), self._places, self._addresses)  # its first time takes a tick
        self._wall_ns = time.time_ns()
        if self._rig is not None:
            self._rig.bind(recorder)

    def derive(self, time_ns: int) -> None:
        """Renew what is computed rather than read."""
        plant, data = self._plant, self._plant.data
        if self._loops.size:
            _gaps(self.closure, data.site_xpos, self._loops)
            self._servo[0] = data.qpos[self._shafts[0]]
            self._servo[1] = data.qpos[self._shafts[1]]
        if self._pilot is not None:
            _flow(
                self._flow, time_ns * 1e-9, plant.position, plant.velocity, plant.attitude,
                plant.rate, self._centres, self._mass, self._members,
                self._pilot.direction, self._pilot.error, *self._tables,
            )  # fmt: skip

    def write(self, time_ns: int) -> None:
        """Fill and commit one row; allocates nothing of its own."""
        self.derive(time_ns)
        recorder = self._recorder
        if recorder is None:
            return
        if self._rig is not None:
            self._rig.write(time_ns, self._wall_ns)
        _copy(recorder.row, self._places, self._addresses)
        recorder.commit(time_ns, self._wall_ns + time_ns)
        recorder.commit_pose(time_ns, self._plant.data)


def _loops(model: mujoco.MjModel) -> Indices:
    """Pairs of sites that the rods' loops close, (2, 2), or (0, 2) without rods."""
    pairs = [
        [
            mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_SITE, f"gimbal_rod_{axis}_end"),
            mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_SITE, f"gimbal_holder_{axis}_ball"),
        ]
        for axis in AXES
    ]
    found = np.array(pairs, np.int64)
    return found if (found >= 0).all() else np.empty((0, 2), np.int64)


def _tables(model: mujoco.MjModel) -> tuple[Array, Array, Array, Array]:
    """Wind parameters (5,), gust modes, and the motor's curve over simulation time."""
    wind = ("speed", "azimuth", "exponent", "reference_height", "turbulence")
    time, thrust = thrust_curve(model) or (np.zeros(1), np.zeros(1))
    return (
        np.array([_numeric(model, f"wind_{name}")[0] for name in wind]),
        _numeric(model, "wind_modes"),
        time,
        thrust,
    )


def _members(model: mujoco.MjModel, vehicle: int) -> Indices:
    """Bodies of the vehicle, itself among them."""
    return np.flatnonzero(model.body_rootid == model.body_rootid[vehicle]).astype(np.int64)


def _numeric(model: mujoco.MjModel, name: str) -> Array:
    return np.array(model.numeric(name).data, dtype=np.float64)


@njit()
def _copy(row: Array, places: Indices, addresses: Indices) -> None:
    for k in range(places.size):
        row[places[k]] = number(addresses[k], 0)


@njit()
def _gaps(out: Array, sites: Array, loops: Indices) -> None:
    for k in range(loops.shape[0]):
        a, b = loops[k]
        gap = 0.0
        for i in range(3):
            gap += (sites[a, i] - sites[b, i]) ** 2
        out[k] = math.sqrt(gap)


@njit()
def _flow(
    out: Array, time: float, position: Array, velocity: Array, attitude: Array,
    rate: Array, centres: Array, mass: Array, members: Indices, nose: Array,
    error: Array, wind: Array, modes: Array, curve_time: Array, curve_thrust: Array,
) -> None:  # fmt: skip
    speed, azimuth, exponent, reference, turbulence = wind
    qw, qx, qy, qz = attitude
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
    # where the forces of the air are taken: on the axis, at the station of the centre of mass
    moment, total = 0.0, 0.0
    for k in range(members.size):
        b = members[k]
        ahead = (
            (centres[b, 0] - position[0]) * zx
            + (centres[b, 1] - position[1]) * zy
            + (centres[b, 2] - position[2]) * zz
        )
        moment, total = moment + mass[b] * ahead, total + mass[b]
    station = moment / total
    u, v, w = wind_at(
        position[0] + station * zx, position[1] + station * zy, position[2] + station * zz,
        time, speed, azimuth, exponent, reference, turbulence, modes,
    )  # fmt: skip
    # ω × r of that point: station (ω_y, -ω_x, 0) in body axes
    sx, sy = station * rate[1], -station * rate[0]
    rx = velocity[0] + sx * xx + sy * yx - u
    ry = velocity[1] + sx * xy + sy * yy - v
    rz = velocity[2] + sx * xz + sy * yz - w
    airspeed = math.sqrt(rx * rx + ry * ry + rz * rz)
    out[0], out[1] = math.atan2(-zy, zz), math.atan2(zx, zz)
    out[2] = airspeed
    cosine = (zx * rx + zy * ry + zz * rz) / airspeed if airspeed > STILL else math.nan
    out[3] = math.acos(min(1.0, max(-1.0, cosine))) if airspeed > STILL else math.nan
    out[4] = interpolate(time, curve_time, curve_thrust)
    # without thrust nothing steers, and there is no error to speak of
    steered = out[4] > 0.0
    out[5] = math.atan2(-nose[1], nose[2]) if steered else math.nan
    out[6] = math.atan2(nose[0], nose[2]) if steered else math.nan
    out[7], out[8] = (error[0], error[1]) if steered else (math.nan, math.nan)
