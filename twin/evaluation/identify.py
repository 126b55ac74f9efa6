"""The assembly of `twin identify`: records in, a model file and one screen out."""

import time
import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np

from analysis.identify import (
    AxisEvidence,
    IdentifiedModel,
    OrderScore,
    fit_to,
    identify_gimbal,
)
from analysis.recording import Measurement
from twin.config import Identify
from twin.config.paths import writable
from twin.config.result import Result, Rows
from twin.errors import TwinError
from twin.evaluation.inputs import Given, given
from twin.evaluation.words import quantity

if TYPE_CHECKING:
    from twin.evaluation.linkage import PhysicsResult


@dataclass(frozen=True)
class IdentifyResult(Result):
    """An identified model, the file it went to, and how well it predicts what it was not fitted to.

    Attributes
    ----------
    checks : file → NRMSE fit of each axis [%] of a record that was held back, NaN where it was not
        commanded or nothing moved
    orders : scores on held-out steps, where the order was chosen
    """

    model: IdentifiedModel
    file: Path
    sources: tuple[str, ...]
    checks: dict[str, tuple[float, ...]]
    orders: tuple[OrderScore, ...]
    warnings: tuple[str, ...]
    wall_s: float

    def as_dict(self) -> dict[str, object]:
        """JSON values in SI."""
        return {
            **self.model.to_dict(),
            "file": str(self.file),
            "sources": list(self.sources),
            "checks": {
                k: [f if np.isfinite(f) else None for f in v] for k, v in self.checks.items()
            },
            "orders": [s.to_dict() for s in self.orders],
            "warnings": list(self.warnings),
            "wall_s": self.wall_s,
        }

    def rows(self) -> Rows:
        """The result as a table."""
        rows = [("identified from", ", ".join(self.sources))]
        rows += [
            (f"order {s.poles}, {s.zeros}", f"{s.fit:.2f} % on held-out steps, error {s.error:.3f}")
            for s in self.orders
        ]
        rows += [(e.name, quantity(e.value, 1.96 * e.std, e.unit)) for e in self.model.estimates]
        for a in self.model.axes:
            told = [
                f"{what} {_percent(fits)}"
                for what, fits in (("angle", a.fit_angle), ("rate", a.fit_rate))
                if np.isfinite(fits).any()
            ]
            rows.append((f"{a.name} fit", f"{'; '.join(told) or 'unknown'}; {a.samples} readings"))
            rows += _left_over(a)
        rows += [(f"predicts {Path(k).name}", self._check(v)) for k, v in self.checks.items()]
        rows += [("WARNING", w) for w in self.warnings]
        rows.append(("computing", f"{self.wall_s:.1f} s"))
        rows.append(("model", str(self.file)))
        if len(self.model.inputs) == 2:
            rows.append(("", f"twin fly --gimbal transfer-function --model {self.file}"))
        return rows

    def _check(self, fits: tuple[float, ...]) -> str:
        told = [
            f"{name} {_percent([f])}"
            for name, f in zip(self.model.outputs, fits, strict=True)
            if np.isfinite(f)
        ]
        return "; ".join(told) or "unknown, its readings stand still"


def _percent(fits: Sequence[float]) -> str:
    return ", ".join(f"{f:.2f}" for f in fits if np.isfinite(f)) + " %"


def _left_over(a: AxisEvidence) -> list[tuple[str, str]]:
    """How the speed grows with the step, and what of the command is left in the residual."""
    rows = []
    s = a.saturation
    if np.isfinite(s.exponent):
        told = f"step to the power {s.exponent:.2f} ± {1.96 * s.std:.2f} (linear: 1)"
        rows.append((f"{a.name} speed", f"{told}, {s.steps} steps"))
    for what, tests in (("angle", a.residual_angle), ("rate", a.residual_rate)):
        if tests and tests.cross_correlation > tests.bound:
            told = f"follows the command by {tests.cross_correlation:.3f}"
            rows.append((f"{a.name} {what} residual", f"{told} (noise: below {tests.bound:.3f})"))
    return rows


def identify(config: Identify) -> "IdentifyResult | PhysicsResult":
    """Identify a gimbal from recordings or tables and write what was found.

    Raises
    ------
    TwinError, AnalysisError : something the user asked for cannot be done, in one line
    """
    if not config.sources:
        raise TwinError("identify: name a recording (.rrd) or a table (.csv, .mat)")
    if config.linkage:
        from twin.evaluation.linkage import identify_linkage

        return identify_linkage(config)
    began = time.perf_counter()
    out = writable(config.out or Path("runs/model.json"), ".json")
    source = given(config, config.sources)
    runs = source.runs
    held_back = [given(config, (file,)).runs[0] for file in config.check]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # of figures that are then told as unknown
        poles, zeros, scores = _order(config, runs)
        model = identify_gimbal(
            runs, poles, zeros, _delay(config.delay),
            servo=(config.structure == "best" or config.structure) if config.servo else False,
            coupling=config.coupling,
            max_delay=_longest(config),
        )  # fmt: skip
        fits = [fit_to(model, [r])[0] for r in held_back]
    still = [
        f"{r.name}: its readings stand still where it was commanded; it checks nothing"
        for r, f in zip(held_back, fits, strict=True)
        if not np.isfinite(f).any()
    ]
    notes = (*model.warnings, *_notes(config, source), *still)
    _write(config, model, notes, out)
    return IdentifyResult(
        model,
        out,
        tuple(r.name for r in runs),
        {r.name: tuple(f.tolist()) for r, f in zip(held_back, fits, strict=True)},
        scores,
        notes,
        time.perf_counter() - began,
    )


def _delay(text: str) -> Literal["free"] | float:
    if text == "free":
        return "free"
    try:
        return float(text)
    except ValueError:
        raise TwinError(f"--delay {text}: 'free', or seconds") from None


def _longest(config: Identify) -> float | None:
    return None if config.max_delay_ms is None else 1e-3 * config.max_delay_ms


def _order(config: Identify, runs: list[Measurement]) -> tuple[int, int, tuple[OrderScore, ...]]:
    """Order asked for, or the largest that any axis needs, with the scores of that axis."""
    if not config.select_order:
        return config.poles, config.zeros, ()
    from analysis.identify import own_records, select_order

    chosen = [
        select_order(own_records(runs, k), delay=_delay(config.delay), max_delay=_longest(config))
        for k in range(len(runs[0].outputs))
    ]
    (poles, zeros), scores = max(chosen, key=lambda c: (sum(c[0]), c[0]))
    return poles, zeros, scores


def _notes(config: Identify, source: Given) -> list[str]:
    notes = list(source.doubts)
    if source.simulated:
        notes.append("simulated angles are exact; they were read as by a sensor of 0.01° noise")
    if config.from_pulses:
        notes.append(
            "delays count from the pulses; a command waits 10 ms more on average for its pulse"
            " frame, which a flight with this model lacks"
        )
    inputs = source.runs[0].inputs
    if len(inputs) == 1 and not config.both:
        notes.append(
            f"only {inputs[0]} was commanded; a flight needs both axes (--both takes it for both)"
        )
    return notes


def _write(config: Identify, model: IdentifiedModel, notes: tuple[str, ...], out: Path) -> None:
    flown = model.to_transfer_function()
    source: dict[str, object] = {
        "made_by": "twin identify",
        "files": [p.name for p in config.sources],
        "warnings": list(notes),
        "input": "pulses" if config.from_pulses else "commands",
        "servo_structure": [b.structure for b in model.servo] if model.servo else None,
    }
    if config.both and len(model.inputs) == len(model.outputs) == 1:
        one = flown.channels[0][0]
        none = type(one)((0.0,), (1.0,))
        flown = replace(
            flown, channels=((one, none), (none, one)), inputs=("x", "y"), outputs=("x", "y")
        )
        source["both"] = f"axis {model.inputs[0]} stands for x and y"
    replace(flown, source=source).write(out)
