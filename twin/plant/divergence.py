"""Where a simulation has diverged: largest speed, stops of the gimbal, gap of the rods."""

import math

import mujoco
import numpy as np

from hardware.frames import AXES
from twin.errors import DivergenceError
from twin.physics.mechanism import closure_limit
from twin.plant.model.model import TwinModel

# Beyond these a small vehicle's state is numerical nonsense, long before it overflows.
LARGEST_SPEED = 5e3  # m/s and rad/s
BEYOND_STOP = math.radians(3.0)  # tolerance; servos at full torque press half a degree into a stop


class Limits:
    """Limits of a model's state, and the errors that name what is beyond them.

    Attributes
    ----------
    stops : gimbal angles beyond which it has diverged: x low, high, y low, high [rad]
    gap : the same of the rod loops [m]
    """

    def __init__(self, twin: TwinModel) -> None:
        self._model = twin.mj
        self.stops = _stops(twin)
        self.gap = closure_limit(twin.mj) if twin.gimbal == "linkage" else math.inf

    def too_fast(self, data: mujoco.MjData, time_ns: int) -> DivergenceError:
        """Error that names the joint with the largest velocity, or one that is not finite."""
        worst = int(np.nanargmax(np.where(np.isfinite(data.qvel), np.abs(data.qvel), np.inf)))
        joint = self._model.joint(int(self._model.dof_jntid[worst]))
        return DivergenceError(
            f"the simulation diverged at {time_ns * 1e-9:.4f} s: velocity of joint"
            f" {joint.name!r} is {data.qvel[worst]:.3g}; a smaller --dt may help"
        )

    def apart(self, x: float, y: float, time_ns: int) -> DivergenceError:
        """Error that gives the gaps of both rod loops [m]."""
        return DivergenceError(
            f"the simulation diverged at {time_ns * 1e-9:.4f} s: the rods are"
            f" {x * 1e3:.3g} mm (x) and {y * 1e3:.3g} mm (y) from their balls, more than the"
            f" gimbal_closure_limit of {self.gap * 1e3:g} mm; stiffer loops or a smaller --dt may"
            " help"
        )

    def past_stop(self, x: float, y: float, time_ns: int) -> DivergenceError:
        """Error that gives the gimbal angle [rad] that is past its stops."""
        axis, angle = ("x", x) if not self.stops[0] <= x <= self.stops[1] else ("y", y)
        low, high = np.degrees(self._model.joint(f"gimbal_{axis}").range)
        return DivergenceError(
            f"the simulation diverged at {time_ns * 1e-9:.4f} s: joint 'gimbal_{axis}' is at"
            f" {math.degrees(angle):.3g}°, past its stops at {low:.3g}° and {high:.3g}°; a smaller"
            " --dt may help"
        )


def _stops(twin: TwinModel) -> tuple[float, float, float, float]:
    stops = [-math.inf, math.inf] * len(AXES)
    # measured angles may exceed the stops of the model
    if twin.gimbal in ("linkage", "transfer-function"):
        for k, axis in enumerate(AXES):
            joint = twin.mj.joint(f"gimbal_{axis}")
            if twin.mj.jnt_limited[joint.id]:
                low, high = twin.mj.jnt_range[joint.id].tolist()
                stops[2 * k : 2 * k + 2] = low - BEYOND_STOP, high + BEYOND_STOP
    return stops[0], stops[1], stops[2], stops[3]
