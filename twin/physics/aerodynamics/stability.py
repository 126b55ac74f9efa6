"""Centre of pressure and moment of the air over the angle of attack, with all that acts.

`python -m twin.physics.aerodynamics.stability [FILE.xml]` prints the first table of
docs/aerodynamics.md.
"""

import argparse
from importlib.resources import files

import mujoco
import numpy as np
from numpy.typing import NDArray

from twin.errors import TwinError
from twin.physics import aerodynamics as air
from twin.physics.aerodynamics.body import Load
from twin.physics.motor import Depletion

Array = NDArray[np.float64]

ANGLES = (0.5, 1.0, 2.0, 3.0, 5.0, 8.0, 12.0, 16.0, 20.0, 25.0)  # degrees
ROOT = 1e-4  # rad; angle of attack at which the air's slope is taken


class Stability:
    """Air across one vehicle, as its numerics have it, with the propellant of an instant.

    Attributes
    ----------
    station : of the centre of mass on the axis, from the gimbal pivot [m]
    diameter : of the reference area [m]
    """

    def __init__(self, model: mujoco.MjModel, time: float = 0.0) -> None:
        self._model = model
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
        data = mujoco.MjData(self._model)
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
        return self.station + (cross[3] + linear[3]) / (cross[0] + linear[0])

    def neutral_angle(self) -> float:
        """Angle of attack beyond which the air turns the nose away [rad]; π/2 if it never does."""
        angles = np.linspace(ROOT, np.pi / 2, 20_000)
        righting = np.array([sum(self.moment(a)) for a in angles]) > 0
        return 0.0 if not righting[0] else float(angles[np.argmin(np.append(righting[:-1], False))])


def table(model: mujoco.MjModel, end: float) -> str:
    """Markdown: centre of pressure and moments over the angle of attack, before and after burn."""
    head = "| angle of attack | centre of pressure | margin, loaded | margin, empty |"
    head += " M / q [cm³]: crossflow | Barrowman | sum, loaded | sum, empty |"
    lines = [head, "|" + "---|" * 8]
    full = Stability(model)
    rows = [(full.centre_of_pressure(a), full.station, full.moment(a)) for a in _radians()]
    empty = full.at(end)
    for degrees, (centre, station, (cross, linear)) in zip(ANGLES, rows, strict=True):
        a = np.radians(degrees)
        margins = [(s - centre) / full.diameter for s in (station, empty.station)]
        values = (cross * 1e6, linear * 1e6, (cross + linear) * 1e6, sum(empty.moment(a)) * 1e6)
        lines.append(
            f"| {degrees:g}° | {centre:.3f} m | {margins[0]:+.2f} | {margins[1]:+.2f} | "
            + " | ".join(f"{v:+.1f}" for v in values)
            + " |"
        )
    full.at(0.0)
    return "\n".join(lines)


def _radians() -> list[float]:
    return [float(a) for a in np.radians(ANGLES)]


def main() -> None:
    """Print the table of a vehicle and the angles at which it loses its stability."""
    parser = argparse.ArgumentParser(description=__doc__)
    default = str(files("mjcf") / "vehicle.xml")
    parser.add_argument("vehicle", nargs="?", default=default, help="MJCF file")
    path = parser.parse_args().vehicle
    try:
        model = mujoco.MjModel.from_xml_path(path)
        end = float(model.numeric("motor_time").data.max())
        found = [(name, Stability(model, time)) for name, time in (("loaded", 0.0), ("empty", end))]
    except (ValueError, KeyError, TwinError) as error:
        reason = " ".join(str(error).split())
        parser.error(f"{path} is no vehicle with air and motor: {reason[:200]}")
    print(table(model, end))
    for name, stability in found:
        print(
            f"{name}: centre of mass {stability.station:.4f} m, turned away beyond "
            f"{np.degrees(stability.neutral_angle()):.2f}°"
        )


if __name__ == "__main__":
    main()
