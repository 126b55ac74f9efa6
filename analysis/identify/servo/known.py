"""The uncertainty of a fit, from its own residual."""

from collections.abc import Sequence

from analysis.array import Array
from analysis.identify.evidence.uncertainty import Uncertainty, stamp_error, uncertainty
from analysis.identify.linear.fit import AxisFit
from analysis.identify.problem.noise import level_errors
from analysis.identify.problem.segments import series_of, step_of_row
from analysis.identify.servo.fit import ServoFit


def known_of_servo(fit: ServoFit) -> tuple[Uncertainty, float]:
    """Uncertainty of all parameters of a bounded servo; error of the stamps [s]."""
    delays = [fit.poles] if fit.problem.layout.free_delays else []
    own = len(fit.theta) + 1
    return known_of(fit, fit.jacobian, fit.weighted, own, delays)


def known_of(
    fit: AxisFit | ServoFit, jacobian: Array, weighted: Array, own: int, delays: Sequence[int]
) -> tuple[Uncertainty, float]:
    """Uncertainty of all parameters, of which `own` are no offsets; error of the stamps."""
    problem = fit.problem
    steps = step_of_row(problem)
    known = uncertainty(
        jacobian, weighted, series_of(problem), steps, range(own),
        level_errors(problem, fit.noise), delays,
    )  # fmt: skip
    late = float("nan")
    if delays and known.disagree:
        late = stamp_error(jacobian[:, delays[0]], weighted, steps)
    return known, late
