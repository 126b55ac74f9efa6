"""Centre of pressure and moment of the air over the angle of attack, and the static margin."""

from copy import copy
from dataclasses import dataclass

import mujoco
import numpy as np
import scipy  # its part `optimize` takes a quarter of a second and is loaded where it is used
from numpy.typing import NDArray

from twin.errors import TwinError
from twin.physics import aerodynamics as air
from twin.physics.aerodynamics.body import Load
from twin.physics.motor import Depletion

Array = NDArray[np.float64]

ROOT = 1e-4  # rad; angle of attack at which the air's slope is taken


class Stability:
    """Air across one vehicle, as its numerics have it, with the propellant of an instant.

    Attributes
    ----------
    station : of the centre of mass on the axis, from the gimbal pivot [m]
    diameter : of the reference area [m]
    """

    def __init__(self, model: mujoco.MjModel, time: float = 0.0) -> None:
        self._model, self._data = model, mujoco.MjData(model)  # half a millisecond each
        self._depletion = Depletion(model)
        names = ("strip_z", "strip_area", "crossflow_drag", "reference_area")
        self._z, self._area, (self._drag, *_), (self._reference, *_) = (
            np.array(model.numeric(f"air_{n}").data) for n in names
        )
        self._parts = [
            [np.array(model.numeric(f"air_{part}_{what}").data) for what in ("slope", "z")]
            for part in ("nose", "fin")
        ]
        self.diameter = float(np.sqrt(4 * self._reference / np.pi))
        self.at(time)

    def at(self, time: float) -> "Stability":
        """The same vehicle with the propellant left at a simulation time [s]."""
        self._depletion.update(time)
        data = self._data
        mujoco.mj_kinematics(self._model, data)
        mujoco.mj_comPos(self._model, data)
        body = data.body("vehicle")
        axis = body.xmat.reshape(3, 3)[:, 2]
        self.station = float(axis @ (data.subtree_com[body.id] - body.xpos))
        return self

    def load(self, v: Array, w: Array, density: float) -> tuple[Load, Load]:
        """Crossflow, and nose with fins: force [N] and moment about the centre of mass [N m].

        Velocity `v` (3,) [m/s] through the air and rate `w` (3,) [rad/s], body frame.
        """
        scale, q = 0.5 * density * self._drag, 0.5 * density * self._reference
        cross = air.crossflow(v[0], v[1], w[0], w[1], scale, self._z, self._area, self.station)
        linear = np.zeros(4)
        # a nose lifts only while it leads; fins do both ways
        for (slopes, stations), axial in zip(self._parts, (max(v[2], 0.0), abs(v[2])), strict=True):
            for slope, z in zip(slopes, stations, strict=True):
                r = z - self.station
                linear += air.normal_force(v[0], v[1], axial, w[0], w[1], q * slope, r)
        a, b, c, d = linear.tolist()
        return cross, (a, b, c, d)

    def moment(self, angle: float, pressure: float = 1.0) -> tuple[float, float]:
        """Crossflow's and Barrowman's moment at an angle of attack [rad], positive if it rights.

        In N m at a dynamic `pressure` [Pa]; per pascal by default.
        """
        v = np.array([np.sin(angle), 0.0, np.cos(angle)])
        cross, linear = self.load(v, np.zeros(3), 2.0 * pressure)
        return cross[3], linear[3]

    def centre_of_pressure(self, angle: float) -> float:
        """Station at which all that acts across the axis acts [m], at an angle of attack [rad]."""
        v = np.array([np.sin(angle), 0.0, np.cos(angle)])
        cross, linear = self.load(v, np.zeros(3), 2.0)
        return float(self.station + (cross[3] + linear[3]) / (cross[0] + linear[0]))

    def neutral_angle(self) -> float:
        """Angle of attack beyond which the air turns the nose away [rad]; π/2 if it never does."""
        angles = np.linspace(ROOT, np.pi / 2, 200)
        righting = np.array([sum(self.moment(a)) for a in angles]) > 0
        if not righting[0]:
            return 0.0
        if righting[:-1].all():
            return float(angles[-1])
        first = int(np.argmin(righting))
        return float(
            scipy.optimize.brentq(lambda a: sum(self.moment(a)), angles[first - 1], angles[first])
        )


@dataclass(frozen=True)
class StaticMargin:
    """Static stability of a vehicle, loaded and with the propellant burnt.

    Attributes
    ----------
    centre_of_mass : (loaded, empty) stations, from the gimbal pivot towards the nose [m]
    centre_of_pressure : at a vanishing angle of attack, from the gimbal pivot [m]
    calibres : (loaded, empty) distance of the centre of mass ahead of the centre of pressure, in
        diameters; positive is stable
    limit : (loaded, empty) angle of attack beyond which the air turns the nose away; 0 where it
        always does, π/2 where it never does [rad]
    """

    centre_of_mass: tuple[float, float]
    centre_of_pressure: float
    calibres: tuple[float, float]
    limit: tuple[float, float]

    @property
    def text(self) -> str:
        """One line."""
        return "; ".join(
            f"{margin:+.2f} calibres {state}, {_limit_text(limit)}"
            for state, margin, limit in zip(
                ("loaded", "empty"), self.calibres, self.limit, strict=True
            )
        )


def _limit_text(limit: float) -> str:
    if limit <= 0.0:
        return "unstable"
    if limit >= np.pi / 2:
        return "stable at any angle of attack"
    return f"stable up to {np.degrees(limit):.1f}° of angle of attack"


def margins(model: mujoco.MjModel) -> tuple[float, float]:
    """Static margin at a vanishing angle of attack, loaded and empty [calibres]; model unchanged.

    Raises
    ------
    TwinError : the model lacks numerics of air or motor
    """
    vehicle, burnout = _loaded(copy(model))
    pressure = vehicle.centre_of_pressure(ROOT)
    full, empty = (vehicle.at(t).station - pressure for t in (0.0, burnout))
    return full / vehicle.diameter, empty / vehicle.diameter


def _loaded(model: mujoco.MjModel) -> tuple[Stability, float]:
    """A vehicle before ignition, and the time of burnout [s]."""
    try:
        burnout = float(model.numeric("motor_time").data.max())
        return Stability(model), burnout + float(model.numeric("motor_ignition").data[0])
    except KeyError as error:
        raise TwinError(f"no static margin: {' '.join(str(error).split())[:200]}") from None


def static_margin(model: mujoco.MjModel) -> StaticMargin:
    """Static margin of a vehicle with all that acts across it: nose, fins and crossflow.

    Raises
    ------
    TwinError : the model lacks numerics of air or motor
    """
    loaded, burnout = _loaded(model)
    pressure = loaded.centre_of_pressure(ROOT)
    stations, limits = [], []
    for time in (0.0, burnout):
        stations.append(loaded.at(time).station)
        limits.append(loaded.neutral_angle())
    loaded.at(0.0)
    full, empty = (float((station - pressure) / loaded.diameter) for station in stations)
    return StaticMargin((stations[0], stations[1]), pressure, (full, empty), (limits[0], limits[1]))
