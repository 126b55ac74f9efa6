"""A vehicle let go by hand: speed, attitude and rates at time zero."""

from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
STREAM = 11  # of the run's seed, so that gusts and throw are independent


@dataclass(frozen=True)
class Release:
    """Motion at time zero.

    Attributes
    ----------
    speed : along the nose [m/s]
    tilt : rotation vector about body x and y, off the launch direction [rad]
    rate : angular velocity in the body frame [rad/s]
    """

    speed: float
    tilt: tuple[float, float]
    rate: tuple[float, float, float]

    @classmethod
    def thrown(
        cls, seed: int, speed: tuple[float, float], attitude: float, rate: float
    ) -> "Release":
        """A throw of the run's seed, all errors normally distributed and independent.

        Parameters
        ----------
        speed : mean and standard deviation [m/s]; a sample below zero counts as zero
        attitude : standard deviation about each of body x and y [rad]
        rate : standard deviation about each body axis [rad/s]
        """
        a, b, c, d, e, f = np.random.default_rng([seed, STREAM]).standard_normal(6).tolist()
        mean, spread = speed
        return cls(
            max(0.0, mean + spread * a),
            (attitude * b, attitude * c),
            (rate * d, rate * e, rate * f),
        )

    def apply(self, attitude: Array, velocity: Array, rate: Array) -> None:
        """Write the motion into a vehicle's state at its launch pose; its pivot stays in place.

        Parameters are views of the state, as `Plant` has them.
        """
        turned, tilt = np.empty(4), np.empty(4)
        angle = float(np.hypot(*self.tilt))
        axis = np.array([*self.tilt, 0.0]) / angle if angle > 0.0 else np.array([1.0, 0.0, 0.0])
        mujoco.mju_axisAngle2Quat(tilt, axis, angle)
        mujoco.mju_mulQuat(turned, attitude, tilt)
        attitude[:] = turned
        mujoco.mju_rotVecQuat(velocity, np.array([0.0, 0.0, self.speed]), turned)
        rate[:] = self.rate
