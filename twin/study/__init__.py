"""`twin converge`: orders observed on a flight of this twin, and the step real time allows here."""

from twin.study.converge import converge
from twin.study.result import ConvergenceResult

__all__ = ["ConvergenceResult", "converge"]
