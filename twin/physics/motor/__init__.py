"""Solid motors: thrust curves of motor files, and the propellant that burns away."""

from twin.physics.motor.apply import adapter_note, apply_motor, figures_of, fit_stated_motor
from twin.physics.motor.curve import Motor
from twin.physics.motor.depletion import Depletion
from twin.physics.motor.eng import parse
from twin.physics.motor.figures import MotorError
from twin.physics.motor.files import load, read, split_name

__all__ = [
    "Depletion",
    "Motor",
    "MotorError",
    "adapter_note",
    "apply_motor",
    "figures_of",
    "fit_stated_motor",
    "load",
    "parse",
    "read",
    "split_name",
]
