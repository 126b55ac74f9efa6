"""Solid motors: thrust curves of RASP `.eng` files, and the propellant that burns away."""

from twin.physics.motor.apply import apply_motor
from twin.physics.motor.curve import Motor, MotorError
from twin.physics.motor.depletion import Depletion
from twin.physics.motor.eng import load, parse, read

__all__ = ["Depletion", "Motor", "MotorError", "apply_motor", "load", "parse", "read"]
