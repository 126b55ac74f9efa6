"""The figures a TVC engineer quotes, from raw records and from identified models."""

from analysis.response.figure import Figure, disagreements, over_repeats
from analysis.response.metrics import Step, StepMetrics, measure, step_metrics
from analysis.response.model import (
    bandwidth,
    frequency_figures,
    model_figures,
    model_step_metrics,
    phase_frequency,
    step_response,
)
from analysis.response.slew import slew_figures, slew_points
from analysis.response.static import (
    cosine_loss,
    cross_coupling,
    hysteresis,
    linearity,
    repeatability,
    staircase_figures,
)
from analysis.response.steps import cut_steps, step_figures

__all__ = [
    "Figure",
    "Step",
    "StepMetrics",
    "bandwidth",
    "cosine_loss",
    "cross_coupling",
    "cut_steps",
    "disagreements",
    "frequency_figures",
    "hysteresis",
    "linearity",
    "measure",
    "model_figures",
    "model_step_metrics",
    "over_repeats",
    "phase_frequency",
    "repeatability",
    "slew_figures",
    "slew_points",
    "staircase_figures",
    "step_figures",
    "step_metrics",
    "step_response",
]
