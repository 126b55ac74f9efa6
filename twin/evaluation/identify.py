"""`twin identify`: recordings and tables in, a model file and one screen out."""

import math
import time
import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np

from analysis.identify import (
    AxisEvidence,
    Estimate,
    Expectation,
    IdentifiedModel,
    OrderScore,
    expectations,
    fit_to,
    identify_gimbal,
)
from analysis.identify.progress import reported_to
from analysis.plain import plain
from analysis.recording import Measurement
from analysis.transfer_function import Margins, TransferFunctionModel, margins
from twin import status
from twin.config import Identify
from twin.config.paths import named, point_latest
from twin.config.result import Result, Rows
from twin.errors import TwinError
from twin.evaluation.inputs import Given, given
from twin.evaluation.words import below, estimated, quantity
from twin.plant.loops import attitude_loops

if TYPE_CHECKING:
    from twin.evaluation.linkage import PhysicsResult


@dataclass(frozen=True)
class IdentifyResult(Result):
    """An identified model, its file, and how well it predicts runs it was not fitted to.

    Attributes
    ----------
    checks : file → NRMSE fit of each axis [%] of a run that was held back, NaN where it was not
        commanded or nothing moved
    orders : scores on held-out steps, where the order was chosen
    margins : of the reference vehicle's attitude loop with this gimbal
    """

    model: IdentifiedModel
    file: Path
    sources: tuple[str, ...]
    checks: dict[str, tuple[float, ...]]
    orders: tuple[OrderScore, ...]
    margins: tuple[Margins, ...]
    warnings: tuple[str, ...]
    wall_s: float

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
            rows.append((f"{a.name} fit", f"{'; '.join(fits) or 'unknown'}; {a.samples} readings"))
            rows += _unexplained(a)
        rows += [(f"fit to {Path(k).name}", self._check(v)) for k, v in self.checks.items()]
        rows += [(f"{m.axis} margins at {m.loop}", m.text()) for m in self.margins]
        rows += [("WARNING", w) for w in self.warnings]
        rows += [("computing", f"{self.wall_s:.1f} s"), ("model", str(self.file))]
        if len(self.model.inputs) == 2:
            rows.append(("", f"twin fly --gimbal transfer-function --model {self.file}"))
        return rows

    def _check(self, fits: tuple[float, ...]) -> str:
        known = [
            f"{name} {_percent([f])}"
            for name, f in zip(self.model.outputs, fits, strict=True)
            if np.isfinite(f)
        ]
        return "; ".join(known) or "unknown, its readings are constant"


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


def identify(config: Identify) -> "IdentifyResult | PhysicsResult | InformationResult":
    """Identify a gimbal from recordings or tables and write the model file.

    Raises
    ------
    TwinError, AnalysisError : invalid input, in one line
    """
    if not config.sources:
        raise TwinError("identify: name a recording (.rrd) or a table (.csv, .mat)")
    if config.linkage:
        from twin.evaluation.linkage import identify_linkage

        return identify_linkage(config)
    if config.check_only:
        return _information(config)
    began = time.perf_counter()
    out = named(config.out, "model", ".json", force=config.force)
    source = given(config, config.sources)
    runs = source.runs
    held_back = [given(config, (file,)).runs[0] for file in config.check]
    with warnings.catch_warnings(), reported_to(status.say):
        warnings.simplefilter("ignore", RuntimeWarning)  # of figures that are reported as unknown
        poles, zeros, scores = _order(config, runs)
        model = identify_gimbal(
            runs, poles, zeros, _delay(config.delay),
            servo=(config.structure == "best" or config.structure) if config.servo else False,
            coupling=config.coupling,
            max_delay=longest(config),
        )  # fmt: skip
        fits = [fit_to(model, [r])[0] for r in held_back]
    still = [
        f"{r.name}: its readings are constant while it was commanded; it checks nothing"
        for r, f in zip(held_back, fits, strict=True)
        if not np.isfinite(f).any()
    ]
    notes = (*model.warnings, *_notes(config, source), *still)
    flown = _flown(config, model, notes)
    flown.write(out)
    point_latest(out)
    return IdentifyResult(
        model,
        out,
        tuple(r.name for r in runs),
        {r.name: tuple(f.tolist()) for r, f in zip(held_back, fits, strict=True)},
        scores,
        margins(attitude_loops(), flown),
        notes,
        time.perf_counter() - began,
    )


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


def _information(config: Identify) -> InformationResult:
    source = given(config, config.sources)
    with warnings.catch_warnings(), reported_to(status.say):
        warnings.simplefilter("ignore", RuntimeWarning)
        found = expectations(source.runs, config.poles, max_delay=longest(config))
    notes = tuple(f"{r.name}: {r.note}" for r in source.runs if r.note)
    return InformationResult(found, tuple(r.name for r in source.runs), source.doubts + notes)


def _delay(text: str) -> Literal["free"] | float:
    if text == "free":
        return "free"
    try:
        return float(text)
    except ValueError:
        raise TwinError(f"--delay {text}: must be 'free', or seconds") from None


def longest(config: Identify) -> float | None:
    """The longest delay that is searched [s]; None for that of the search."""
    return None if config.max_delay_ms is None else 1e-3 * config.max_delay_ms


def _order(config: Identify, runs: list[Measurement]) -> tuple[int, int, tuple[OrderScore, ...]]:
    """Order from the settings, or the largest any axis needs, with the scores of that axis."""
    if not config.select_order:
        return config.poles, config.zeros, ()
    from analysis.identify import own_records, select_order

    chosen = [
        select_order(own_records(runs, k), delay=_delay(config.delay), max_delay=longest(config))
        for k in range(len(runs[0].outputs))
    ]
    (poles, zeros), scores = max(chosen, key=lambda c: (sum(c[0]), c[0]))
    return poles, zeros, scores


def _notes(config: Identify, source: Given) -> list[str]:
    notes = list(source.doubts)
    if source.simulated:
        notes.append("simulated angles are exact; noise of 0.01° was added to them")
    if config.from_pulses:
        notes.append(
            "delays count from the pulses; the wait of a command for its pulse frame, 10 ms on"
            " average, is not in this model"
        )
    inputs = source.runs[0].inputs
    if len(inputs) == 1 and not config.both:
        notes.append(
            f"only {inputs[0]} was commanded; a flight needs both axes (--both uses it for x and y)"
        )
    return notes


def _flown(
    config: Identify, model: IdentifiedModel, notes: tuple[str, ...]
) -> TransferFunctionModel:
    """The model as a flight uses it, with how it was made."""
    flown = model.to_transfer_function()
    source: dict[str, object] = {
        "made_by": "twin identify",
        "files": [p.name for p in config.sources],
        "warnings": list(notes),
        "input": "pulses" if config.from_pulses else "commands",
    }
    if config.both and len(model.inputs) == len(model.outputs) == 1:
        one = flown.channels[0][0]
        none = type(one)((0.0,), (1.0,))
        flown = replace(
            flown, channels=((one, none), (none, one)), inputs=("x", "y"), outputs=("x", "y"),
            servo=flown.servos * 2 or None,
            covariance=None,  # that of one axis; two equal ones vary as one
        )  # fmt: skip
        source["both"] = f"axis {model.inputs[0]} is used for x and y"
    return replace(flown, source=source)
