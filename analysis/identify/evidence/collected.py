"""The evidence for the fit of one axis, gathered from its residuals."""

import numpy as np

from analysis.identify.evidence.diagnostics import Saturation, beginning, residual_tests
from analysis.identify.evidence.evidence import AxisEvidence, Estimate
from analysis.identify.evidence.statics import statics
from analysis.identify.evidence.uncertainty import Uncertainty
from analysis.identify.evidence.unexplained import repeatable
from analysis.identify.linear.fit import AxisFit
from analysis.identify.prediction import nrmse_fit
from analysis.identify.problem.states import Part
from analysis.identify.servo.fit import ServoFit


def commanded(part: Part, own: int) -> bool:
    """Whether a record moved an axis: where it was to stand still, there is nothing to fit."""
    command = part.input[:, own] if part.input.shape[1] > own else part.input
    return part.free or bool(np.any(np.diff(command, axis=0)))


def evidence(
    fit: AxisFit | ServoFit,
    name: str,
    checked: Saturation,
    known: Uncertainty,
    stamps: float,
    sizes: tuple[Estimate, ...],
    smear: dict[str, float],
    own: int = 0,
    simpler: bool = False,
) -> AxisEvidence:
    """What speaks for a fit; `own` is the column of the axis' own command.

    Parameters
    ----------
    sizes, smear : what the sizes and the scattered times of the steps change poles and delay by
    simpler : one pole less explains the readings as well
    """
    problem = fit.problem
    residual = fit.residual if isinstance(fit, ServoFit) else fit.solution.residual
    counted = problem.weight > 0.0
    spikes = int((~counted if isinstance(fit, ServoFit) else fit.spikes).sum())
    fits: list[list[float]] = [[], []]
    for is_rate in (False, True):
        for index in range(len(problem.parts)):
            rows = counted & (problem.owner == index) & (problem.is_rate == is_rate)
            measured = problem.measured[rows]
            fits[int(is_rate)].append(
                nrmse_fit(measured, measured - residual[rows])
                if rows.any() and commanded(problem.parts[index], own)
                else float("nan")
            )
    weighted = residual * problem.weight
    column = min(own, problem.parts[0].input.shape[1] - 1)
    tests = [
        residual_tests(problem, weighted, is_rate) if (problem.is_rate == is_rate).any() else None
        for is_rate in (False, True)
    ]
    return AxisEvidence(
        name, int(counted.sum()), spikes, fit.noise, tuple(fits[0]), tuple(fits[1]),
        tests[0], tests[1], checked, fit.converged, known.spread, stamps, known.disagree,
        known.disagree or known.colour is not None,
        repeatable(problem, residual, column), sizes, smear,
        simpler, beginning(problem, residual),
        statics=None if isinstance(fit, ServoFit) else statics(problem, residual, column),
    )  # fmt: skip
