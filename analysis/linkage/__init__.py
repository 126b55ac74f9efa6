"""Physical parameters of a simulated gimbal, fitted to a recording."""

from analysis.linkage.fit import LinkageFit, fit_linkage
from analysis.linkage.problem import DELAY, Build, Knob, LinkageError, Moves

__all__ = ["DELAY", "Build", "Knob", "LinkageError", "LinkageFit", "Moves", "fit_linkage"]
