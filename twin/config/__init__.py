"""Settings of every verb; the command line and the Python functions are derived from them.

>>> Fly(programme="step").real_time
False
"""

from twin.config.base import Settings
from twin.config.demo import Demo
from twin.config.derived import Converge, Replay, added, with_model, without_ineffective
from twin.config.evaluation import Columns, Compare, History, Identify, Report
from twin.config.options import Run
from twin.config.rig import Calibrate, Mirror, Rig
from twin.config.runs import OBJECT, Fly, Step
from twin.config.tools import Doctor, Export, View
from twin.config.types import LARGEST_DT, TURNTABLE, Integrator, OnFault, Programme, Signal
from twin.config.vehicle import ListParameters

__all__ = [
    "LARGEST_DT",
    "OBJECT",
    "TURNTABLE",
    "Calibrate",
    "Columns",
    "Compare",
    "Converge",
    "Demo",
    "Doctor",
    "Export",
    "Fly",
    "History",
    "Identify",
    "Integrator",
    "ListParameters",
    "Mirror",
    "OnFault",
    "Programme",
    "Replay",
    "Report",
    "Rig",
    "Run",
    "Settings",
    "Signal",
    "Step",
    "View",
    "added",
    "with_model",
    "without_ineffective",
]
