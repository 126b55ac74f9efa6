"""Result of a convergence study: numbers for machines, rows for people."""

import math
from dataclasses import dataclass

from analysis.convergence import Series, Study
from twin.config.result import Result, Rows
from twin.experiments.convergence.budget import Budget


@dataclass(frozen=True)
class RealTime:
    """One integrator at the step that real time allows.

    Attributes
    ----------
    budget : as measured
    error : position error there [m]: flown, or expected from the observed order
    flown : whether it was flown
    """

    budget: Budget
    error: float
    flown: bool


@dataclass(frozen=True)
class InUse:
    """What `twin fly` takes unless told otherwise, flown here without its divisions of steps.

    Attributes
    ----------
    error : of the position [m]; NaN where its step does not fit into the study's intervals
    """

    integrator: str
    step: float
    error: float


@dataclass(frozen=True)
class ConvergenceResult(Result):
    """Orders, errors, and whether the solution has converged at the step real time allows.

    Attributes
    ----------
    study : of the flight asked for
    jitter : of steps of unequal length, with variable and with fixed coefficients
    real_time : by integrator
    in_use : method and step of `twin fly`
    integrator : of the figure and of the verdict
    tolerance : position error that counts as converged [m]
    """

    flight: str
    study: Study
    jitter: Study | None
    real_time: tuple[RealTime, ...]
    in_use: InUse
    integrator: str
    tolerance: float
    page: str
    wall_s: float

    @property
    def chosen(self) -> RealTime:
        """The figure's integrator in real time."""
        return next(r for r in self.real_time if r.budget.integrator == self.integrator)

    @property
    def converged(self) -> bool:
        """Whether the error at the real-time step stays within the tolerance."""
        return self.chosen.error <= self.tolerance

    def as_dict(self) -> dict[str, object]:
        """JSON values in SI; None where nothing could be measured."""
        reference = self.study.reference
        return {
            "flight": self.flight,
            "reference": {
                "integrator": reference.integrator,
                "dt_s": reference.step,
                "order": _number(reference.order),
                "uncertainty_m": _number(reference.uncertainty.position),
            },
            "integrators": [_series(s) for s in self.study.series],
            "jittered": [] if self.jitter is None else [_series(s) for s in self.jitter.series],
            "real_time": [
                {
                    "integrator": r.budget.integrator,
                    "dt_s": _number(r.budget.step),
                    "step_cost_s": r.budget.step_cost,
                    "tick_cost_p99_s": r.budget.tick_cost,
                    "position_error_m": _number(r.error),
                    "flown": r.flown,
                }
                for r in self.real_time
            ],
            "in_use": {
                "integrator": self.in_use.integrator,
                "dt_s": self.in_use.step,
                "position_error_m": _number(self.in_use.error),
                "converged": self.in_use.error <= self.tolerance,
            },
            "integrator": self.integrator,
            "tolerance_m": self.tolerance,
            "converged": self.converged,
            "page": self.page,
            "wall_s": self.wall_s,
        }

    def rows(self) -> Rows:
        """The study as a table."""
        reference = self.study.reference
        order, step = reference.order, _ms(reference.step)
        observed = "" if math.isnan(order) else f", order {order:.2f} observed"
        uncertainty = f"± {reference.uncertainty.position:.1e} m"
        rows = [
            ("flight", self.flight),
            (
                "reference",
                f"{reference.integrator} at {step}, {uncertainty}{observed}",
            ),
            *_table("position error [m]", self.study),
        ]
        if self.jitter is not None:
            rows += [("", ""), ("steps jittered", "by ± 80 %, vehicle without gimbal")]
            rows += _table("position error [m]", self.jitter)
        rows += [("", ""), ("in real time", f"{'finest step':>12}{'error':>12}{'one step':>12}")]
        for r in self.real_time:
            error = "unknown" if math.isnan(r.error) else f"{r.error:.1e} m"
            finest = "none" if math.isnan(r.budget.step) else _ms(r.budget.step)
            cost = f"{r.budget.step_cost * 1e6:>9.1f} µs"
            rows.append((r.budget.integrator, f"{finest:>12}{error:>12}{cost}"))
        rows += [("", ""), ("twin fly's default", self.judged_in_use())]
        rows.append(("in real time", self._verdict()))
        return [*rows, ("report", self.page)]

    def judged_in_use(self) -> str:
        """Verdict on the method and step of `twin fly`."""
        used = self.in_use
        name = f"{used.integrator} at {_ms(used.step)}"
        if math.isnan(used.error):
            return f"{name}: not flown, it does not fit into the intervals of this study"
        verdict = "converged" if used.error <= self.tolerance else "NOT converged"
        return f"{verdict} with {name}: {used.error:.1e} m, tolerance {self.tolerance:g} m"

    def _verdict(self) -> str:
        step = self.chosen.budget.step
        if math.isnan(step):
            return f"no time step of {self.integrator} keeps up with real time on this machine"
        verdict = "converged" if self.converged else "NOT converged"
        return (
            f"{verdict} with {self.integrator} at {_ms(step)}:"
            f" {self.chosen.error:.1e} m, tolerance {self.tolerance:g} m"
        )


def _table(name: str, study: Study) -> Rows:
    head = "".join(f"{_ms(h):>11}" for h in study.series[0].steps)
    rows = [(name, f"{head}{'order':>8}{'attitude':>10}")]
    for series in study.series:
        errors = "".join(
            f"{'diverged':>11}" if math.isnan(e.position) else f"{e.position:>11.1e}"
            for e in series.errors
        )
        orders = [_order(series.order[q]) for q in ("position", "attitude")]
        rows.append((series.integrator, f"{errors}{orders[0]:>8}{orders[1]:>10}"))
    return rows


def _series(series: Series) -> dict[str, object]:
    return {
        "integrator": series.integrator,
        "dt_s": [float(h) for h in series.steps],
        "position_error_m": [_number(e.position) for e in series.errors],
        "attitude_error_rad": [_number(e.attitude) for e in series.errors],
        "order_position": _number(series.order["position"]),
        "order_attitude": _number(series.order["attitude"]),
    }


def _order(order: float) -> str:
    return "–" if math.isnan(order) else f"{order:.2f}"


def _ms(seconds: float) -> str:
    return f"{seconds * 1e3:.4g} ms"


def _number(value: float) -> float | None:
    return value if math.isfinite(value) else None
