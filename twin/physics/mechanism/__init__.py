"""The gimbal mechanism: mobility, kinematics and servo parameters."""

from twin.physics.mechanism.frame import check_frame
from twin.physics.mechanism.kinematics import Kinematics, Workspace
from twin.physics.mechanism.mobility import Mobility, mobility
from twin.physics.mechanism.names import MechanismError
from twin.physics.mechanism.response import check_response, closure_limit
from twin.physics.mechanism.servo import apply_servo, insert_backlash

__all__ = [
    "Kinematics",
    "MechanismError",
    "Mobility",
    "Workspace",
    "apply_servo",
    "check_frame",
    "check_response",
    "closure_limit",
    "insert_backlash",
    "mobility",
]
