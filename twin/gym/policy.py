"""A trained policy in the controller seat of a flight."""

from collections.abc import Callable

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from hardware.frames import GimbalState, Pair
from twin.gym.observation import Observation, Observer
from twin.plant.plant import VehicleState


class Policy:
    """An own controller that asks a policy; for `twin.fly(controller=...)`, also with a rig.

    Parameters
    ----------
    act : gives an action (2,) for an observation, as in the environment
    """

    def __init__(self, act: Callable[[Observation], ArrayLike]) -> None:
        self._act = act

    def start(self, model: mujoco.MjModel, period: float) -> None:  # noqa: ARG002
        """Prepare the observations of a vehicle."""
        self._observer = Observer(model)

    def update(
        self,
        time: float,
        gimbal: GimbalState,
        vehicle: VehicleState,
        setpoint: NDArray[np.float64],
    ) -> Pair:
        """Gimbal angle of the policy's action [rad]."""
        observation = self._observer.observe(time, gimbal, vehicle, setpoint)
        return self._observer.angle(self._act(observation))
