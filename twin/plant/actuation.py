"""Commands to the gimbal of a model; the only code that writes its actuators."""

import mujoco
import numpy as np

from hardware.frames import AXES, Pair
from twin.physics.mechanism import Kinematics
from twin.plant.model.model import TwinModel
from twin.plant.steps.stepping import Drive, drive

ACTUATORS = {
    "linkage": "gimbal_servo_{}",
    "transfer-function": "gimbal_{}",
    "follow": "gimbal_{}",
}


class Actuation:
    """The two gimbal actuators of a model; a fixed motor has none.

    Servos of a linkage are commanded through the exact kinematic solution of the mechanism, as a
    calibrated rig is.

    Attributes
    ----------
    native : for compiled code, which calls `stepping.drive`

    Raises
    ------
    MechanismError : the linkage does not fit together
    """

    def __init__(self, twin: TwinModel, data: mujoco.MjData) -> None:
        pattern = ACTUATORS.get(twin.gimbal)
        names = [] if pattern is None else [pattern.format(a) for a in AXES]
        places = np.array([int(twin.mj.actuator(n).id) for n in names], np.int64)
        loops = np.empty((0, 0))
        if twin.gimbal == "linkage":
            kinematics = Kinematics(twin.mj)
            loops = loops if kinematics.direct else kinematics.geometry.copy()
        self.native = Drive(loops, places, data.ctrl)

    def drive(self, angle: Pair) -> None:
        """Command a gimbal angle [rad]."""
        drive(self.native, *angle)
