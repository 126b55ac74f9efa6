"""Commands to the gimbal of a model; the only code that writes its actuators."""

from collections.abc import Callable

import mujoco

from hardware.frames import AXES, Pair
from twin.physics.mechanism import Kinematics
from twin.plant.model import TwinModel

ACTUATORS = {
    "linkage": "gimbal_servo_{}",
    "transfer-function": "gimbal_{}",
    "follow": "gimbal_{}",
}


class Actuation:
    """The two gimbal actuators of a model; a fixed motor has none.

    Servos of a linkage are commanded through the exact kinematic solution of the mechanism, as a
    calibrated rig is.

    Raises
    ------
    MechanismError : the linkage does not fit together
    """

    def __init__(self, twin: TwinModel, data: mujoco.MjData) -> None:
        self._ctrl = data.ctrl
        self._map: Callable[[float, float], Pair] | None = None
        pattern = ACTUATORS.get(twin.gimbal)
        self._present = pattern is not None
        if pattern is not None:
            self._x, self._y = (int(twin.mj.actuator(pattern.format(a)).id) for a in AXES)
        if twin.gimbal == "linkage":
            self._map = Kinematics(twin.mj).servo_from_gimbal_fast

    def drive(self, angle: Pair) -> None:
        """Command a gimbal angle [rad]."""
        if not self._present:
            return
        x, y = angle if self._map is None else self._map(*angle)
        self._ctrl[self._x], self._ctrl[self._y] = x, y
