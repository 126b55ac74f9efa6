"""`twin converge`: orders observed on a flight of this twin, and the step real time allows here."""

from twin.experiments.convergence.converge import converge
from twin.experiments.convergence.result import ConvergenceResult

__all__ = ["ConvergenceResult", "converge"]
