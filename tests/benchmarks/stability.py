"""Gimbal against air through flights: `python -m tests.benchmarks.stability`."""

from dataclasses import dataclass

import mujoco
import numpy as np

from hardware.frames import GimbalCommand
from twin.control import AttitudeController, Hold
from twin.control.attitude import interpolate
from twin.loop.seats import Pilot, SimulatedGimbal
from twin.physics import aerodynamics as air
from twin.physics import native
from twin.physics.aerodynamics.stability import Stability
from twin.plant.authority import control_config, fixed_point, launch_of, thrust_curve
from twin.plant.model.model import ModelConfig, load
from twin.plant.plant import Plant

PERIOD, STEPS = 0.004, 4
EVERY = 25  # ticks between the instants looked at
LARGEST = np.radians(90.0)
FLIGHTS = {"hold": None, "point, +30° right": (30, 0), "point, 30° up": (0, 30)}
FLIGHTS |= {"point, 30° down": (0, -30)}


@dataclass(frozen=True)
class Instant:
    """One instant of a flight: time [s], thrust [N], speed [m/s], dynamic pressure [Pa].

    Attributes
    ----------
    angle : of attack [rad]
    station : of the centre of mass, above the gimbal pivot [m]
    air, gimbal : moments about the centre of mass, the air's now and the most a gimbal has [N m]
    holds : angle of attack at which the air would turn the nose away with as much [rad]
    """

    time: float
    thrust: float
    speed: float
    pressure: float
    angle: float
    station: float
    air: float
    gimbal: float
    holds: float


def fly(off: tuple[float, float] | None, end: float = 15.2, every: int = EVERY) -> list[Instant]:
    """Instants of a flight of the reference vehicle, off the rail until the motor goes out.

    One in `every` ticks.
    """
    twin = load(ModelConfig(scene="flight", gimbal="transfer-function"))
    model = twin.mj
    programme = (
        Hold(launch=launch_of(model)[0]) if off is None else fixed_point(model, *np.radians(off))
    )
    plant, seen = Plant(twin), []
    pilot = Pilot(plant, AttitudeController(control_config(model)), programme, PERIOD)
    gimbal, stability, curve = SimulatedGimbal(plant), Stability(model), thrust_curve(model)
    assert curve is not None
    with native.installed():
        while plant.time_ns < end * 1e9:
            time = plant.time_ns * 1e-9
            angle = pilot.update(time, gimbal.poll())
            gimbal.send(GimbalCommand(plant.time_ns, angle))
            plant.advance(STEPS)
            if time > 1.0 and plant.steps // STEPS % every == 0:
                thrust = float(interpolate(time, *curve))
                seen.append(instant(plant, stability.at(time), time, thrust))
    return seen


def instant(plant: Plant, stability: Stability, time: float, thrust: float) -> Instant:
    """What acts now, in still air; the gimbal at its 8° in the plane of the air's moment."""
    rotation = np.empty(9)
    mujoco.mju_quat2Mat(rotation, plant.attitude)
    turn = rotation.reshape(3, 3)
    arm = np.array([0.0, 0.0, stability.station])
    v = turn.T @ plant.velocity + np.cross(plant.rate, arm)
    density = air.density(float(plant.position[2]))
    cross, linear = stability.load(v, plant.rate, density)
    speed = float(np.linalg.norm(v))
    pressure = 0.5 * density * speed**2
    most = thrust * np.sin(np.radians(8.0)) * stability.station
    away = np.linspace(0.0, LARGEST, 361)
    turned = np.array([-sum(stability.moment(a, pressure)) for a in away])
    beaten = np.flatnonzero(turned > most)
    return Instant(
        time, thrust, speed, pressure, float(np.arccos(min(1.0, v[2] / speed))), stability.station,
        float(np.hypot(cross[2] + linear[2], cross[3] + linear[3])), most,
        float(away[beaten[0]]) if beaten.size else float("inf"),
    )  # fmt: skip


def main() -> None:
    """Print the table of a held flight, and the least margin of each flight."""
    flights = {name: fly(off) for name, off in FLIGHTS.items()}
    print("| time | thrust | speed | q | centre of mass | gimbal at 8° | holds the nose up to |")
    print("|---|---|---|---|---|---|---|")
    for i in flights["hold"]:
        if abs(i.time - round(i.time)) < 0.05 and round(i.time) in (2, 3, 4, 6, 8, 10, 12, 14, 15):
            holds = f"{np.degrees(i.holds):.0f}°" if np.isfinite(i.holds) else "any angle"
            print(
                f"| {i.time:.1f} s | {i.thrust:.1f} N | {i.speed:.0f} m/s | {i.pressure:.0f} Pa |"
                f" {i.station:.3f} m | {i.gimbal:.2f} N m | {holds} |"
            )
    print("\n| flight | largest angle of attack | largest air moment | least gimbal / air, at |")
    print("|---|---|---|---|")
    for name, seen in flights.items():
        attack, moment = max(seen, key=lambda i: i.angle), max(i.air for i in seen)
        least = min(seen, key=lambda i: i.gimbal / i.air)
        degrees = np.degrees(attack.angle)
        print(
            f"| {name} | {degrees:.1f}° at {attack.time:.1f} s | {moment:.2f} N m |"
            f" {least.gimbal / least.air:.1f} at {least.time:.1f} s |"
        )


if __name__ == "__main__":
    main()
