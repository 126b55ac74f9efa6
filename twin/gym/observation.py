"""What a policy sees: one vector, the same in an environment and in the controller seat."""

import math
from collections.abc import Mapping
from types import MappingProxyType

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from hardware.frames import GimbalState
from twin.control.attitude import interpolate, missing_rotation
from twin.errors import TwinError
from twin.plant.authority import control_config, thrust_curve
from twin.plant.plant import VehicleState

Array = NDArray[np.float64]
Observation = NDArray[np.float32]
_TURN, _FAST = math.pi, 100.0

COMPONENTS: Mapping[str, tuple[float, float]] = MappingProxyType(
    {
        "error_x": (-_TURN, _TURN),
        "error_y": (-_TURN, _TURN),
        "rate_x": (-_FAST, _FAST),
        "rate_y": (-_FAST, _FAST),
        "rate_z": (-_FAST, _FAST),
        "gimbal_x": (-_TURN, _TURN),
        "gimbal_y": (-_TURN, _TURN),
        "gimbal_rate_x": (-_FAST, _FAST),
        "gimbal_rate_y": (-_FAST, _FAST),
        "speed": (0.0, 5e3),
        "thrust": (0.0, 1e4),
        "action_x": (-1.0, 1.0),
        "action_y": (-1.0, 1.0),
    }
)
"""Components of an observation with their bounds, in order: rotation missing about body x and y
[rad], body rates [rad/s], gimbal angles [rad] and rates [rad/s], speed [m/s], thrust [N], and the
previous action [1]. Values beyond the bounds are clipped."""

LOW, HIGH = (np.array(bounds, np.float32) for bounds in zip(*COMPONENTS.values(), strict=True))


class Observer:
    """Computes observations from what an own controller is given.

    Parameters
    ----------
    model : of the vehicle; gives thrust over time

    Attributes
    ----------
    limit : gimbal angle of an action of 1, the largest that the attitude loop commands [rad]
    action : (2,) previous action, part of the observation
    """

    def __init__(self, model: mujoco.MjModel) -> None:
        self.limit = control_config(model).limit
        self.action: Array = np.zeros(2)
        self._times, self._thrust = thrust_curve(model) or (np.zeros(1), np.zeros(1))
        self._values: Array = np.zeros(len(COMPONENTS))

    def observe(
        self, time: float, gimbal: GimbalState, vehicle: VehicleState, setpoint: Array
    ) -> Observation:
        """Observation (13,); parameters as those of an own controller's `update`."""
        v = self._values
        v[0:2] = missing_rotation(vehicle.attitude, setpoint)
        v[2:5] = vehicle.rate
        v[5:7], v[7:9] = gimbal.angle, gimbal.rate
        v[9] = math.sqrt(vehicle.velocity @ vehicle.velocity)
        v[10] = interpolate(time, self._times, self._thrust)
        v[11:13] = self.action
        return np.clip(v.astype(np.float32), LOW, HIGH)

    def angle(self, action: ArrayLike) -> tuple[float, float]:
        """Gimbal angle of an action [rad], which becomes the previous one; clipped to -1 … 1.

        Raises
        ------
        TwinError : it is not two numbers
        """
        try:
            x, y = (float(c) for c in np.asarray(action, np.float64).ravel())
        except (TypeError, ValueError):
            raise TwinError(f"action {action!r}: must be two numbers from -1 to 1") from None
        if math.isnan(x) or math.isnan(y):
            raise TwinError(f"action {action!r}: must be two numbers from -1 to 1")
        self.action[0], self.action[1] = min(max(x, -1.0), 1.0), min(max(y, -1.0), 1.0)
        return float(self.action[0]) * self.limit, float(self.action[1]) * self.limit
