"""From records to an identified model."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Literal

import numpy as np

from analysis.identify import channels, checks, progress
from analysis.identify.doubts import (
    effective_warnings,
    selection_warnings,
    stamp_warnings,
    warnings_of,
)
from analysis.identify.errors import IdentificationError
from analysis.identify.evidence.collected import evidence
from analysis.identify.evidence.diagnostics import Saturation, saturation
from analysis.identify.evidence.uncertainty import whole_jacobian
from analysis.identify.frozen import without_frozen
from analysis.identify.linear.fit import search
from analysis.identify.linear.selection import one_pole_less, select
from analysis.identify.model import IdentifiedModel
from analysis.identify.problem.assemble import assemble
from analysis.identify.problem.layout import Layout
from analysis.identify.problem.problem import Problem
from analysis.identify.servo.known import known_of, known_of_servo
from analysis.identify.servo.reached import idle_warnings, left_out, rival_warnings
from analysis.identify.servo.search import search_servo
from analysis.recording.measurements import Measurement
from analysis.transfer_function.file import LONGEST_DELAY
from analysis.transfer_function.servo import Structure

_MOST_POLES = 6


def identify(
    records: Sequence[Measurement],
    poles: int = 2,
    zeros: int = 0,
    delay: Literal["free"] | float = "free",
    *,
    servo: bool | Structure = False,
    denominators: Literal["channel", "axis"] = "channel",
    offsets: Literal["record", "shared"] = "record",
    max_delay: float | None = None,
) -> IdentifiedModel:
    """Identify a gimbal from steps (or any held commands) and what its sensors saw.

    Parameters
    ----------
    records : one or several runs with the same commands and axes
    poles, zeros : of every transfer function
    delay : `free`, or the known transport delay [s]
    servo : fit a servo with bounded speed, dead band and backlash, each axis by itself; a structure
        (`speed`, `clipped`, `command`, `set-point`) asks for that one instead of the best
    denominators : every channel has its own poles, or those into one axis share theirs
    offsets : the angle sensor's offset is each record's own, or one for all
    max_delay : longest delay searched [s]; 0.1 s or ten samples if left out

    Raises
    ------
    IdentificationError : records no model can come from, and orders that are not possible
    """
    check_order(poles, zeros, delay)
    records, still = without_frozen(records)
    checks.check_records(records)
    first = records[0]
    longest = longest_delay(records, max_delay)
    layout = layout_of(records, poles, zeros, delay, own=denominators == "channel")
    problems = [
        assemble(records, i, layout, shared_offset=offsets == "shared")
        for i in range(len(first.outputs))
    ]
    if servo:
        model = _bounded(problems, records, longest, None if servo is True else servo)
    else:
        model = _linear(problems, records, longest)
    model = replace(model, warnings=(*still, *model.warnings))
    return model.per_command(first.command.unit)


def longest_delay(records: Sequence[Measurement], asked: float | None) -> float:
    """The longest delay to search [s]: as asked, or 0.1 s, or ten samples where that is more.

    Raises
    ------
    IdentificationError : what is no delay to be searched
    """
    if asked is None:
        return max(0.1, 10.0 * max(r.period for r in records))
    if not 0.0 < asked <= LONGEST_DELAY:
        raise IdentificationError(
            f"longest delay is {asked:g} s; more than 0 s, and {LONGEST_DELAY:g} s at most"
        )
    return asked


def layout_of(
    records: Sequence[Measurement],
    poles: int,
    zeros: int,
    delay: Literal["free"] | float = "free",
    *,
    own: bool = True,
) -> Layout:
    """Structure of the model of one axis for these records."""
    fixed = np.nan if delay == "free" else float(delay)
    inputs = len(records[0].inputs)
    return Layout(poles, zeros, inputs, own, (fixed,) * inputs, _pace(records))


def check_order(poles: int, zeros: int, delay: Literal["free"] | float) -> None:
    """Refuse an order or a delay that no gimbal has.

    Raises
    ------
    IdentificationError : with what is possible
    """
    if not 1 <= poles <= _MOST_POLES:
        raise IdentificationError(f"{poles} poles; 1 to {_MOST_POLES} are possible")
    if not 0 <= zeros < poles:
        raise IdentificationError(
            f"{zeros} zeros with {poles} poles; a gimbal moves only after its command: "
            f"0 to {poles - 1} zeros"
        )
    if delay != "free" and not 0.0 <= float(delay) <= LONGEST_DELAY:
        raise IdentificationError(f"delay is {delay} s; 'free', or 0 to {LONGEST_DELAY:g} s")


def _pace(records: Sequence[Measurement]) -> float:
    """A frequency in the middle of what the records can tell [rad/s]."""
    fast = 1.0 / min(r.period for r in records)
    slow = 4.0 / max(r.duration for r in records)
    return float(np.sqrt(fast * max(slow, fast / 100.0)))


def _linear(
    problems: Sequence[Problem], records: Sequence[Measurement], longest: float
) -> IdentifiedModel:
    first = records[0]
    rows, axes, warnings = [], [], []
    for i, problem in enumerate(problems):
        output = first.outputs[i]
        progress.say(f"axis {output}, linear model")
        choice = select(problem, longest)
        fit, jacobian = choice.fit, whole_jacobian(choice.fit.solution)
        known, stamps = known_of(
            fit,
            jacobian,
            fit.solution.weighted,
            fit.problem.layout.size + fit.problem.layout.numerators,
            _delay_places(fit.problem),
        )
        found = channels.linear(
            fit, known, output, tuple(first.inputs[j] for j in choice.columns), longest
        )
        row = tuple(
            found[choice.columns.index(j)] if j in choice.columns
            else channels.absent(fit, problem, j, found[0], f"{output}/{name}")
            for j, name in enumerate(first.inputs)
        )  # fmt: skip
        checked = saturation(fit.problem, fit.problem.measured - fit.solution.residual)
        rows.append(row)
        k = min(i, len(first.inputs) - 1)
        place = choice.columns.index(k) if k in choice.columns else -1
        shown = checked.saturated and place >= 0
        sizes = channels.changes(fit, jacobian, place) if shown else ()
        smear = channels.smear(fit, jacobian, place, stamps)
        simpler = one_pole_less(fit, longest)
        axes.append(evidence(fit, output, checked, known, stamps, sizes, smear, i, simpler))
        warnings += selection_warnings(problem, choice, row, first.inputs, output)
        warnings += warnings_of(axes[-1], row, longest, problem, k)
        if k in choice.columns:
            gain = row[k].num[-1] / row[k].den[-1]
            warnings += checks.check_gain(gain, first, first.inputs[k], output)
    warnings = checks.exchanged(rows, first.inputs, first.outputs) + warnings
    warnings += stamp_warnings(records)
    return IdentifiedModel(
        first.inputs, first.outputs, tuple(rows), None, tuple(axes), tuple(warnings)
    )


def _bounded(
    problems: Sequence[Problem],
    records: Sequence[Measurement],
    longest: float,
    structure: Structure | None,
) -> IdentifiedModel:
    first = records[0]
    if len(first.inputs) != len(first.outputs):
        raise IdentificationError(
            f"servo: {len(first.inputs)} commands for {len(first.outputs)} axes; "
            "each servo needs its own command and axis"
        )
    rows, axes, bounds, warnings = [], [], [], []
    for i, problem in enumerate(problems):
        alone = problem.with_layout(
            replace(problem.layout, inputs=1, delays=problem.layout.delays[:1])
        )
        linear = search(problem.channels((i,), (0,)), max_delay=longest)
        with progress.about(f"axis {first.outputs[i]}, "):
            fit = search_servo(
                alone, i, max_delay=longest, structure=structure, keep=~linear.spikes
            )
        simpler = not problem.layout.zeros and one_pole_less(linear, longest)
        known, stamps = known_of_servo(fit)
        most = left_out(fit, i, longest, known.excess)
        channel, limits = channels.bounded(
            fit, known, first.outputs[i], first.inputs[i], longest, most
        )
        rows.append(
            tuple(channel if j == i else channels.nothing(channel) for j in range(len(problems)))
        )
        bounds.append(limits)
        none = Saturation(float("nan"), float("nan"), 0, 1.0, None)
        simpler = simpler and limits.idle  # a limit of speed hides a pole
        axes.append(evidence(fit, first.outputs[i], none, known, stamps, (), {}, i, simpler))
        warnings += warnings_of(axes[-1], (channel,), longest, problem)
        warnings += checks.check_gain(fit.gain, first, first.inputs[i], first.outputs[i])
        warnings += idle_warnings(limits, first.outputs[i])
        warnings += rival_warnings(fit, limits, known, first.outputs[i])
        warnings += effective_warnings(axes[-1], limits)
    warnings += stamp_warnings(records)
    return IdentifiedModel(
        first.inputs, first.outputs, tuple(rows), tuple(bounds), tuple(axes), tuple(warnings)
    )


def _delay_places(problem: Problem) -> list[int]:
    return [problem.layout.delay_place(j) for j in problem.layout.free_delays]
