"""What each command can be told; the command line is derived from these.

>>> Fly(programme="step").real_time
False
"""

from twin.config.evaluation import (
    Columns,
    Compare,
    Converge,
    Doctor,
    Identify,
    Replay,
    Report,
    View,
)
from twin.config.rig import Calibrate, Mirror, Rig
from twin.config.runs import Fly, Run, Step, as_properties, heeded, with_model
from twin.config.types import LARGEST_DT, TURNTABLE, Integrator, OnFault, Programme, Signal

__all__ = [
    "LARGEST_DT",
    "TURNTABLE",
    "Calibrate",
    "Columns",
    "Compare",
    "Converge",
    "Doctor",
    "Fly",
    "Identify",
    "Integrator",
    "Mirror",
    "OnFault",
    "Programme",
    "Replay",
    "Report",
    "Rig",
    "Run",
    "Signal",
    "Step",
    "View",
    "as_properties",
    "heeded",
    "with_model",
]
