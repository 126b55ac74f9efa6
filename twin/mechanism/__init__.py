"""The gimbal's mechanism: how it can move, where its servos put it, what its servos are like."""

from twin.mechanism.frame import check_frame
from twin.mechanism.kinematics import Kinematics, Workspace
from twin.mechanism.mobility import Mobility, mobility
from twin.mechanism.names import MechanismError
from twin.mechanism.servo import apply_servo, insert_backlash

__all__ = [
    "Kinematics",
    "MechanismError",
    "Mobility",
    "Workspace",
    "apply_servo",
    "check_frame",
    "insert_backlash",
    "mobility",
]
