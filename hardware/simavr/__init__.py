"""The firmware on a simulated ATmega328P; libsimavr is loaded when a `SimulatedNano` is made."""

from hardware.simavr.nano import SimulatedNano, SimulatedNanoError, missing

__all__ = ["SimulatedNano", "SimulatedNanoError", "missing"]
