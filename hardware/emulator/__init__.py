"""A simulated rig: the firmware's behaviour and the errors of real sensors, over any plant.

>>> from hardware.emulator import Emulator
>>> rig = Emulator()
>>> rig.advance_us(10_000)
>>> len(rig.read()) > 0
True
"""

from hardware.emulator.bench import Bench, RigParameters, reference_rig, sample_rig
from hardware.emulator.cable import UnpluggedError
from hardware.emulator.emulator import Emulator, identity
from hardware.emulator.injection import FaultNameError, Injection, parse, valid_names
from hardware.emulator.lockstep import LockstepRig
from hardware.emulator.nano import FirmwareRig
from hardware.emulator.plant import AnalyticPlant, Plant, PlantParameters
from hardware.emulator.servo import Drive, Servo, ServoParameters, Wear

__all__ = [
    "AnalyticPlant",
    "Bench",
    "Drive",
    "Emulator",
    "FaultNameError",
    "FirmwareRig",
    "Injection",
    "LockstepRig",
    "Plant",
    "PlantParameters",
    "RigParameters",
    "Servo",
    "ServoParameters",
    "UnpluggedError",
    "Wear",
    "identity",
    "parse",
    "reference_rig",
    "sample_rig",
    "valid_names",
]
