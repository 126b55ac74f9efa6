"""One flight: what it is to do, when it is over, and what it amounted to."""

import math
from collections.abc import Callable
from pathlib import Path

import mujoco
import numpy as np
from numpy.typing import NDArray

from twin.config import Fly
from twin.control import PROGRAMMES, Setpoint
from twin.errors import TwinError
from twin.experiments.summary import FlightResult
from twin.loop.loop import Outcome
from twin.plant.authority import fixed_point, launch_of, steer_to
from twin.plant.plant import Plant

Array = NDArray[np.float64]
Vector = tuple[float, float, float]
PASSED_NS = 1_000_000_000  # a point counts as passed when it has been receding this long
STUCK_NS = 1_000_000_000  # a vehicle at rest on its ramp for so long after burnout stays there
AT_REST = 0.1  # m/s


def setpoint(config: Fly, model: mujoco.MjModel) -> tuple[Setpoint, Vector | None]:
    """Setpoint programme of a flight, and the world point it steers to if any [m].

    Raises
    ------
    TwinError : numbers that make no programme, a point outside the cone, or no gimbal to steer with
    """
    _refuse_steering_without_gimbal(config, model)
    if config.target is None and config.programme != "point":
        launch, _ = launch_of(model)
        axis = _body_x(model) if config.turns_about == "x" else None
        if config.programme == "hold":
            return PROGRAMMES["hold"](launch=launch, axis=axis), None
        angle = math.radians(config.amplitude_deg)
        kind = PROGRAMMES[config.programme]
        found = kind(launch=launch, axis=axis, amplitude=angle, begin=config.at_s)  # type: ignore[call-arg]
        return found, None
    if config.target is not None:
        start = _start(model)
        x, y, z = (o + t for o, t in zip(start, config.target, strict=True))
        steering = steer_to(model, (x, y, z))
    else:
        if not config.target_range_m > 0:
            raise TwinError(f"--target-range-m {config.target_range_m}: must be greater than zero")
        right, up = (math.radians(angle) for angle in config.off_axis_deg)
        steering = fixed_point(model, right, up, config.target_range_m)
    return steering, steering.target


def _refuse_steering_without_gimbal(config: Fly, model: mujoco.MjModel) -> None:
    if mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, "gimbal_x") >= 0:
        return
    if config.target is not None or config.programme != "hold":
        what = "--target" if config.target is not None else f"--programme {config.programme}"
        raise TwinError(
            f"{what}: this vehicle's motor is fixed (it has no joint 'gimbal_x'), so it can only"
            " fly as it is launched, --programme hold"
        )


def _start(model: mujoco.MjModel) -> Vector:
    q = int(model.joint("vehicle").qposadr[0])
    x, y, z = model.qpos0[q : q + 3]
    return float(x), float(y), float(z)


def _body_x(model: mujoco.MjModel) -> Vector:
    """The vehicle's x axis at the launch, in the world."""
    q = int(model.joint("vehicle").qposadr[0])
    matrix = np.empty(9)
    mujoco.mju_quat2Mat(matrix, model.qpos0[q + 3 : q + 7])
    return float(matrix[0]), float(matrix[3]), float(matrix[6])


def _numeric(model: mujoco.MjModel, name: str) -> Array:
    return np.asarray(model.numeric(name).data)


class Flight:
    """Watches a flight tick by tick; decides when it is over and sums it up.

    Attributes
    ----------
    announce : told time [ns] and text of what happens
    burnout_ns : when the motor has burned out [ns]
    """

    def __init__(self, plant: Plant, error: Array, target: Vector | None) -> None:
        self._plant, self._error = plant, error
        self._start = _start(plant.model)
        self._target = None if target is None else np.array(target)
        self.burnout_ns = round(_burnout(plant.model) * 1e9)
        self._ignition_ns = round(float(_numeric(plant.model, "motor_ignition")[0]) * 1e9)
        self._ramp = float(_numeric(plant.model, "ramp_length")[0])
        self._mass = float(plant.model.body_subtreemass[plant.model.body("vehicle").id])
        self._position: list[Vector] = []
        self._speed = 0.0
        self._errors: list[float] = []
        self._closure = 0.0
        self._closest = math.inf
        self._closest_ns: int | None = None  # when last nearer the point than ever since the launch
        self._moved_ns = self.burnout_ns
        self._burnout_range: float | None = None
        self._on_ramp = True
        self.announce: Callable[[int, str], None] = lambda *_: None

    def watch(self, time_ns: int) -> None:
        """Take note of the plant's state at this tick."""
        plant = self._plant
        x, y, z = plant.position.tolist()
        self._position.append((x, y, z))
        vx, vy, vz = plant.velocity.tolist()
        speed = vx * vx + vy * vy + vz * vz
        self._speed = max(self._speed, speed)
        if plant.closure[0] > self._closure or plant.closure[1] > self._closure:
            self._closure = float(plant.closure.max())
        if time_ns <= self.burnout_ns:
            ex, ey = self._error.tolist()
            self._errors.append(ex * ex + ey * ey)
        elif self._burnout_range is None:
            self._burnout_range = math.dist((x, y, z), self._start)
            self._tell(time_ns, "burnout", self._burnout_range, vx, vy, vz)
        away = math.dist((x, y, z), self._start)
        if self._on_ramp and away > self._ramp and time_ns >= self._ignition_ns:
            self._on_ramp = False
            self._tell(time_ns, "left the ramp", self._ramp, vx, vy, vz)
        if self._on_ramp and speed > AT_REST**2:
            self._moved_ns = max(time_ns, self.burnout_ns)
        if self._target is not None:
            distance = math.dist((x, y, z), self._target)
            if self._on_ramp:
                self._closest = distance
            elif distance < self._closest:
                self._closest, self._closest_ns = distance, time_ns

    def _tell(self, time_ns: int, what: str, distance: float, *velocity: float) -> None:
        speed = math.hypot(*velocity)
        self.announce(time_ns, f"{what} at {speed:.1f} m/s, {distance:.1f} m from the launch point")

    def over(self) -> str | None:
        """Why the flight is over, or None while it is not."""
        plant = self._plant
        if plant.landed:
            return "reached the ground"
        if self._closest_ns is not None and plant.time_ns > self._closest_ns + PASSED_NS:
            return "passed the point"
        held = self._ramp > 0.0 and self._on_ramp
        if held and plant.time_ns > self._moved_ns + STUCK_NS:
            return "never left the ramp"
        return None

    def result(self, recording: Path, outcome: Outcome, wall_s: float) -> FlightResult:
        """Sum the flight up."""
        plant = self._plant
        track = np.array(self._position)
        target = None if self._target is None else self._target - self._start
        closest = None if self._target is None else _closest(track, self._target)
        return FlightResult(
            recording=str(recording),
            ended=outcome.ended,
            mass_kg=self._mass,
            flight_time_s=plant.time_ns * 1e-9,
            max_speed_m_s=math.sqrt(self._speed),
            powered_slant_range_m=self._burnout_range,
            max_height_m=float((track[:, 2] - self._start[2]).max()),
            target_m=None
            if target is None
            else (float(target[0]), float(target[1]), float(target[2])),
            closest_approach_m=closest,
            attitude_error_rms_deg=math.degrees(math.sqrt(float(np.mean(self._errors)))),
            loop_closure_max_um=self._closure * 1e6 or None,
            physics_steps=plant.steps,
            physics_s=plant.computing_s,
            wall_s=wall_s,
            warnings=plant.warnings(),
        )


def _burnout(model: mujoco.MjModel) -> float:
    """When the motor has burned out [s]: the last point of its curve with thrust before it."""
    time, thrust = _numeric(model, "motor_time"), _numeric(model, "motor_thrust")
    last = int(np.flatnonzero(thrust > 0)[-1]) + 1 if (thrust > 0).any() else 0
    return float(time[min(last, time.size - 1)] + _numeric(model, "motor_ignition")[0])


def _closest(track: Array, point: Array) -> float:
    """Distance of a point (3,) from the polyline through `track` (n, 3) [m]."""
    if len(track) == 1:
        return float(np.linalg.norm(track[0] - point))
    a, b = track[:-1], track[1:]
    along = b - a
    length = np.maximum(np.einsum("ij,ij->i", along, along), 1e-30)
    share = np.clip(np.einsum("ij,ij->i", point - a, along) / length, 0.0, 1.0)
    nearest = a + share[:, None] * along
    return float(np.linalg.norm(nearest - point, axis=1).min())
