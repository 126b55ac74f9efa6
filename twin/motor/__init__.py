"""Solid motors: thrust curves of RASP `.eng` files, and the propellant that burns away."""

from twin.motor.apply import apply_motor
from twin.motor.curve import Motor, MotorError
from twin.motor.depletion import Depletion
from twin.motor.eng import parse, read

__all__ = ["Depletion", "Motor", "MotorError", "apply_motor", "parse", "read"]
