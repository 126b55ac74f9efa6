"""Components for the gimbal, attitude and controller seats when everything is simulated."""

import math
from collections.abc import Mapping
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from analysis.compiled import njit
from hardware.frames import GimbalCommand, GimbalState, Pair
from twin.control import AttitudeController, Setpoint
from twin.control.attitude import Loop, from_vertical, update
from twin.control.guidance import Aim, FixedPoint, directions
from twin.control.setpoint import Hold
from twin.plant.plant import Plant, VehicleState

Array = NDArray[np.float64]


class SimulatedGimbal:
    """The gimbal of the plant itself: servos and rods, or an identified model."""

    def __init__(self, plant: Plant) -> None:
        self._plant = plant

    def send(self, command: GimbalCommand) -> None:
        """Set the actuators; a fixed motor has none."""
        self._plant.drive(command.angle)

    def poll(self) -> GimbalState:
        """Exact joint angles and rates of this instant."""
        return self._plant.gimbal()


class Attitude(Protocol):
    """The attitude seat: attitude and rate of the vehicle as the controller sees them.

    Attributes
    ----------
    attitude, rate : body to world (4,) wxyz, and in body axes (3,) [rad/s]
    """

    attitude: Array
    rate: Array

    def update(self) -> None:
        """Update both, once a tick."""


class Truth:
    """The simulated attitude without errors."""

    def __init__(self, plant: Plant) -> None:
        self.attitude, self.rate = plant.attitude, plant.rate

    def update(self) -> None:
        """Do nothing: both are views of the plant's state."""


class Steering(NamedTuple):
    """A pilot for compiled code, with arrays of one row.

    Attributes
    ----------
    period : of the loop [s]
    attitude, rate, position, velocity : views of the vehicle's state
    nose, angle : written: wanted direction (1, 3), gimbal angle (1, 2)
    values, error, thrust : of `Pilot.derive`
    loop : the attitude loop
    aim : the guidance; empty where the programme is one over time
    """

    period: float
    attitude: Array
    rate: Array
    position: Array
    velocity: Array
    nose: Array
    angle: Array
    values: Array
    error: Array
    thrust: Array
    loop: Loop
    aim: Aim


@njit(nogil=True)
def steer(s: Steering, time: float, planned: Array) -> None:
    """`Pilot.update` at `time` [s]; `planned` (3,) is the direction without guidance."""
    if s.aim.fixed.size:
        directions(time, s.position, s.velocity, s.aim, s.nose)
    else:
        s.nose[0] = planned
    update(time, s.period, s.attitude, s.rate, s.nose, s.loop, s.angle)


class Pilot:
    """Attitude loop in the controller seat: setpoint programme and PID.

    Parameters
    ----------
    attitude : source of attitude and rate; the simulated ones if omitted

    Attributes
    ----------
    direction : (3,) wanted nose direction in the world
    error : (2,) rotation still missing about body x and y [rad]
    signals : setpoint, as rotation of the nose from the vertical, and error; NaN without thrust,
        since nothing steers then
    """

    def __init__(
        self,
        plant: Plant,
        controller: AttitudeController,
        setpoint: Setpoint,
        period: float,
        attitude: Attitude | None = None,
    ) -> None:
        self._plant, self._controller, self._setpoint = plant, controller, setpoint
        self._period = period
        self._seen: Attitude = attitude or Truth(plant)
        self.direction: Array = np.zeros(3)
        self.error: Array = controller.error[0]
        self._angle: Array = np.zeros(2)
        self._values: Array = np.zeros(4)
        self.signals: Mapping[str, Array] = {
            "control/setpoint": self._values[0:2],
            "control/error": self._values[2:4],
        }

    def update(self, time: float, gimbal: GimbalState) -> Pair:  # noqa: ARG002  the seat's signature
        """Return the gimbal angle that turns the nose towards the setpoint [rad]."""
        plant, seen = self._plant, self._seen
        seen.update()
        self.direction[:] = self._setpoint.direction(time, plant.position, plant.velocity)
        self._controller.update(
            time, self._period, seen.attitude, seen.rate, self.direction, self._angle
        )
        return float(self._angle[0]), float(self._angle[1])

    def native(self) -> Steering | None:
        """For compiled code, which calls `steer`; None where it cannot take this seat."""
        plant, programme = self._plant, self._setpoint
        if not isinstance(self._seen, Truth) or not isinstance(programme, FixedPoint | Hold):
            return None
        nothing = Aim(np.empty(0), np.empty((2, 0)), np.empty((3, 0)))
        aim = programme.aim if isinstance(programme, FixedPoint) else nothing
        return Steering(
            self._period, plant.attitude[None], plant.rate[None], plant.position[None],
            plant.velocity[None], self.direction[None], self._angle[None], self._values,
            self.error, plant.thrust, self._controller.loop, aim,
        )  # fmt: skip

    def planned(self, times_ns: range) -> Array:
        """Directions of a programme over time (n, 3), for `steer`; zeros with guidance."""
        out: Array = np.zeros((len(times_ns), 3))
        programme = self._setpoint
        if isinstance(programme, Hold):
            at = self._plant.position, self._plant.velocity
            changes = type(programme) is not Hold
            for k, time_ns in enumerate(times_ns if changes else times_ns[:1]):
                out[k] = programme.direction(time_ns * 1e-9, *at)
            if not changes:
                out[:] = out[0]
        return out

    def vehicle(self) -> VehicleState:
        """Copy of the vehicle's state with the attitude and rate that the loop sees."""
        plant, seen = self._plant, self._seen
        return VehicleState(
            plant.position.copy(), plant.velocity.copy(), seen.attitude.copy(), seen.rate.copy()
        )

    def derive(self, time_ns: int) -> None:  # noqa: ARG002  the recorder's signature
        """Compute the signals; the plant must have derived its thrust before."""
        steering(self._values, self.direction, self.error, self._plant.thrust)


@njit()
def steering(out: Array, nose: Array, error: Array, thrust: Array) -> None:
    """`Pilot.derive`: setpoint and error, NaN without thrust."""
    if thrust[0] > 0.0:
        out[0], out[1] = from_vertical(nose[0], nose[1], nose[2])
        out[2], out[3] = error[0], error[1]
    else:
        out[:] = math.nan


class Sequence:
    """Open-loop command sequence in the controller seat.

    Parameters
    ----------
    times : (n,) start of each angle [s], ascending from 0
    angles : (n, 2) gimbal angles [rad]
    """

    def __init__(self, times: Array, angles: Array) -> None:
        self._times, self._angles = times, angles

    def update(self, time: float, gimbal: GimbalState) -> Pair:  # noqa: ARG002  the seat's signature
        """Return the angle of the sequence at `time` [rad]."""
        # half a nanosecond more: times are rounded, a tick must not miss its own change
        k = int(np.searchsorted(self._times, time + 5e-10, side="right")) - 1
        x, y = self._angles[max(k, 0)]
        return float(x), float(y)
