"""An identified model, or what records can determine of one, as a table."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from analysis.identify import AxisEvidence, Estimate, Expectation, IdentifiedModel, OrderScore
from analysis.plain import plain
from analysis.transfer_function import Margins
from twin.config.result import Result, Rows
from twin.evaluation.words import below, estimated, quantity


@dataclass(frozen=True)
class IdentifyResult(Result):
    """An identified model, its file, and how well it predicts runs it was not fitted to.

    Attributes
    ----------
    checks : file → NRMSE fit of each axis [%] of a run that was held back, NaN where it was not
        commanded or nothing moved
    orders : scores on held-out steps, where the order was chosen
    margins : of the reference vehicle's attitude loop with this gimbal
    flies : whether the file has both axes, as `twin fly` needs
    """

    model: IdentifiedModel
    file: Path
    sources: tuple[str, ...]
    checks: dict[str, tuple[float, ...]]
    orders: tuple[OrderScore, ...]
    margins: tuple[Margins, ...]
    warnings: tuple[str, ...]
    wall_s: float
    flies: bool = True

    def as_dict(self) -> dict[str, object]:
        """JSON values in SI."""
        return {
            **self.model.to_dict(),
            "file": str(self.file),
            "sources": list(self.sources),
            "checks": plain(self.checks),
            "orders": plain(self.orders),
            "margins": plain(self.margins),
            "warnings": list(self.warnings),
            "wall_s": self.wall_s,
        }

    def rows(self) -> Rows:
        """Order, figures, fit, checks, margins, warnings and the file."""
        rows = [("identified from", ", ".join(self.sources))]
        rows += [
            (f"order {s.poles}, {s.zeros}", f"{s.fit:.2f} % on held-out steps, error {s.error:.3f}")
            for s in self.orders
        ]
        if self.model.servo:
            rows.append(("servo structure", self.model.servo[0].structure))
        rows += [(e.name, estimated(e)) for e in self.model.estimates]
        for a in self.model.axes:
            fits = [
                f"{what} {_percent(fits)}"
                for what, fits in (("angle", a.fit_angle), ("rate", a.fit_rate))
                if np.isfinite(fits).any()
            ]
            text = f"{'; '.join(fits) or 'unknown'}; {a.samples} readings"
            if a.outside:
                text += f" ({a.outside} more than 1 s before or after its own commands left out)"
            rows.append((f"{a.name} fit", text))
            rows += _unexplained(a)
        rows += [(f"fit to {Path(k).name}", self._check(v)) for k, v in self.checks.items()]
        rows += [(f"{m.axis} margins at {m.loop}", m.text()) for m in self.margins]
        rows += [("WARNING", w) for w in self.warnings]
        rows += [("computing", f"{self.wall_s:.1f} s"), ("model", str(self.file))]
        if self.flies:
            rows.append(("", f"twin fly --gimbal transfer-function --model {self.file}"))
        return rows

    def _check(self, fits: tuple[float, ...]) -> str:
        known = [
            f"{name} {_percent([f])}"
            for name, f in zip(self.model.outputs, fits, strict=True)
            if np.isfinite(f)
        ]
        return "; ".join(known) or "unknown, its readings are constant"


@dataclass(frozen=True)
class InformationResult(Result):
    """What records can determine, before a model is made of them."""

    expected: tuple[Expectation, ...]
    sources: tuple[str, ...]
    warnings: tuple[str, ...]

    def as_dict(self) -> dict[str, object]:
        """JSON values in SI; a half width is None where the records show nothing of a parameter."""
        return {
            "parameters": [{**e.to_dict(), "enough": e.enough} for e in self.expected],
            "sources": list(self.sources),
            "warnings": list(self.warnings),
        }

    def rows(self) -> Rows:
        """Each parameter with its expected interval, and what to record where that is wide."""
        rows = [("can determine", ", ".join(self.sources))]
        if any(e.name.endswith(" rate limit") for e in self.expected):
            rows.append(("servo structure", "speed; bounds of others are not searched"))
        for e in self.expected:
            scale, unit = (1e3, "ms") if e.name.endswith("delay") else (100.0, "%")
            text = "not determined"
            if e.at_least:
                text = estimated(Estimate(e.name, e.size, math.nan, e.unit, False, True))
            elif np.isfinite(e.below):
                text = below(e.below, e.unit)
            elif np.isfinite(e.half):
                value = quantity(e.size, math.nan, e.unit).partition(",")[0]
                text = f"± {scale * e.half:.2g} {unit} of {value}"
                if not e.enough:
                    text += f", not determined (± {scale * e.bar:.2g} {unit} is)"
            if not e.enough:
                text += f": {e.advice}"
            rows.append((e.name, text))
        return rows + [("WARNING", w) for w in self.warnings]


def _percent(fits: Sequence[float]) -> str:
    return ", ".join(f"{f:.2f}" for f in fits if np.isfinite(f)) + " %"


def _unexplained(a: AxisEvidence) -> Rows:
    """How the figures change with the step, what the residual is, and the scatter of steps."""
    rows = []
    s = a.saturation
    if np.isfinite(s.exponent):
        law = f"step to the power {s.exponent:.2f} ± {1.96 * s.std:.2f} (linear: 1)"
        rows.append((f"{a.name} speed", f"{law}, {s.steps} steps"))
    if a.sizes:
        changes = ", ".join(f"{e.name} {quantity(e.value, 1.96 * e.std, e.unit)}" for e in a.sizes)
        rows.append((f"{a.name} largest step", f"against the smallest: {changes}"))
    for what, tests in (("angle", a.residual_angle), ("rate", a.residual_rate)):
        if tests and tests.whiteness < 1e-3:
            text = f"not white, autocorrelation {tests.autocorrelation:.2f}"
            if a.allowed:  # by its colour or the scatter of steps, both as if it were noise
                text += "; the intervals allow for coloured noise, not for a wrong structure"
            rows.append((f"{a.name} {what} residual", text))
    if a.repeats >= 0.005:
        text = f"another linear model explains {100 * a.repeats:.0f} % of it"
        rows.append((f"{a.name} residual", text))
    if a.disagree and not a.simpler:  # a pole too many has a deviation that means nothing
        value = f"scatter {a.spread:.1f} times more than noise"
        if a.stamps > 0.0:
            value += f", as if commands were dated {1e3 * a.stamps:.2g} ms off"
        rows.append((f"{a.name} steps", f"{value}; the intervals are of that scatter"))
    return rows
