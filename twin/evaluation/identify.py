"""`twin identify`: recordings and tables in, a model file and one screen out."""

import time
import warnings
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np

from analysis.identify import (
    IdentifiedModel,
    OrderScore,
    expectations,
    fit_to,
    identify_gimbal,
    without_frozen,
)
from analysis.identify.progress import reported_to
from analysis.recording import Measurement
from analysis.recording.loader import is_table
from analysis.transfer_function import TransferFunctionModel, margins
from hardware.frames import AXES
from twin import status
from twin.config import Identify
from twin.config.paths import named, point_latest
from twin.errors import TwinError
from twin.evaluation.identify_result import IdentifyResult, InformationResult
from twin.evaluation.inputs import Given, given, not_independent
from twin.evaluation.words import quantity
from twin.plant.loops import attitude_loops

if TYPE_CHECKING:
    from twin.evaluation.linkage import PhysicsResult


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
    held_back = [_held_back(config, file) for file in config.check]
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
    same = not_independent(config, source, held_back)
    notes = (*model.warnings, *_notes(config, source), *still, *same)
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
        set(flown.inputs) == set(flown.outputs) == set(AXES),
    )


def _held_back(config: Identify, file: Path) -> Measurement:
    """A file to check by, with commands of its own."""
    if is_table(file) and config.commands is not None and config.check_commands is None:
        raise TwinError(
            f"--check {file}: has other commands than those of --commands {config.commands};"
            " give them as --check-commands"
        )
    return given(replace(config, commands=config.check_commands), (file,)).runs[0]


def _information(config: Identify) -> InformationResult:
    source = given(config, config.sources)
    with warnings.catch_warnings(), reported_to(status.say):
        warnings.simplefilter("ignore", RuntimeWarning)
        found = expectations(source.runs, config.poles, max_delay=longest(config))
    notes = tuple(f"{r.name}: {r.note}" for r in source.runs if r.note)
    notes += tuple(without_frozen(source.runs)[1])
    notes += tuple(
        f"axis '{e.name.removesuffix(' rate limit')}': rate-limited, the record reaches"
        f" {quantity(e.size, e.half * e.size, e.unit)}; fit the servo (--servo)"
        for e in found
        if e.limit_reached
    )
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
    """Order from the settings, or the largest any axis needs, with the scores of that axis.

    Each axis is tried with its own command; where another's moves it too, with all commands.
    """
    if not config.select_order:
        return config.poles, config.zeros, ()
    from analysis.identify import own_records, select_order

    delay, most = _delay(config.delay), longest(config)
    axes = range(len(runs[0].outputs))
    chosen = [select_order(own_records(runs, k), delay=delay, max_delay=most) for k in axes]
    if config.coupling != "none" and not config.servo:
        (poles, zeros), _ = _largest(chosen)
        model = identify_gimbal(runs, poles, zeros, delay, coupling=config.coupling, max_delay=most)
        rows = enumerate(model.channels)
        if any(any(c.num) for i, row in rows for j, c in enumerate(row) if i != j):
            chosen = [select_order(runs, delay=delay, axis=k, max_delay=most) for k in axes]
    (poles, zeros), scores = _largest(chosen)
    return poles, zeros, scores


def _largest(
    chosen: list[tuple[tuple[int, int], tuple[OrderScore, ...]]],
) -> tuple[tuple[int, int], tuple[OrderScore, ...]]:
    return max(chosen, key=lambda c: (sum(c[0]), c[0]))


def _notes(config: Identify, source: Given) -> list[str]:
    notes = list(source.doubts)
    if source.simulated:
        notes.append("simulated angles are exact; noise of 0.01° was added to them")
    if config.from_pulses:
        notes.append(
            "delays count from the pulses; the wait of a command for its pulse frame, 10 ms on"
            " average, is not in this model"
        )
    inputs, outputs = source.runs[0].inputs, source.runs[0].outputs
    if len(inputs) == 1 and not config.both:
        notes.append(
            f"only {inputs[0]} was commanded; a flight needs both axes (--both uses it for x and y)"
        )
    elif len(inputs) > len(outputs) == 1:
        notes.append(f"only {outputs[0]} was measured; a flight needs both axes")
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
