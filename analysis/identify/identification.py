"""From records to an identified model."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from analysis.identify import channels, checks
from analysis.identify.diagnostics import Saturation, residual_tests, saturation
from analysis.identify.errors import IdentificationError
from analysis.identify.fit import AxisFit, search
from analysis.identify.layout import Layout
from analysis.identify.model import AxisEvidence, ChannelFit, IdentifiedModel
from analysis.identify.prediction import nrmse_fit
from analysis.identify.problem import Part, Problem, assemble
from analysis.identify.segments import step_of_row
from analysis.identify.servo import ServoFit, search_servo
from analysis.identify.servo_response import Structure
from analysis.identify.uncertainty import bootstrap, covariance, whole_jacobian
from analysis.recording.record import Record

Array = NDArray[np.float64]

_POOR = 80.0  # percent of fit: below, a figure is a guess
_COLOURED = 0.15  # autocorrelation that matters, however many samples prove it
_FOLLOWS = 0.15  # correlation with the command's changes that matters, likewise
_SPREAD = 1.5  # bootstrap over Jacobian: beyond, the Jacobian is wrong
_MOST_POLES = 6
LONGEST_DELAY = 10.0  # s


def identify(
    records: Sequence[Record],
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
        (`speed`, `command`) asks for that one instead of the better
    denominators : every channel has its own poles, or those into one axis share theirs
    offsets : the angle sensor's offset is each record's own, or one for all
    max_delay : longest delay searched [s]; 0.1 s or ten samples if left out

    Raises
    ------
    IdentificationError
        for records no model can come from, and orders that are not possible.
    """
    check_order(poles, zeros, delay)
    checks.check_records(records)
    first = records[0]
    longest = longest_delay(records, max_delay)
    layout = layout_of(records, poles, zeros, delay, own=denominators == "channel")
    problems = [
        assemble(records, i, layout, shared_offset=offsets == "shared")
        for i in range(len(first.outputs))
    ]
    if servo:
        return _bounded(problems, records, longest, None if servo is True else servo)
    return _linear(problems, records, longest)


def longest_delay(records: Sequence[Record], asked: float | None) -> float:
    """The longest delay to search [s]: as asked, or 0.1 s, or ten samples where that is more.

    Raises
    ------
    IdentificationError
        for what is no delay to be searched.
    """
    if asked is None:
        return max(0.1, 10.0 * max(r.period for r in records))
    if not 0.0 < asked <= LONGEST_DELAY:
        raise IdentificationError(
            f"longest delay is {asked:g} s; more than 0 s, and {LONGEST_DELAY:g} s at most"
        )
    return asked


def layout_of(
    records: Sequence[Record],
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
    IdentificationError
        with what is possible.
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


def _pace(records: Sequence[Record]) -> float:
    """A frequency in the middle of what the records can tell [rad/s]."""
    fast = 1.0 / min(r.period for r in records)
    slow = 4.0 / max(r.duration for r in records)
    return float(np.sqrt(fast * max(slow, fast / 100.0)))


def _linear(
    problems: Sequence[Problem], records: Sequence[Record], longest: float
) -> IdentifiedModel:
    first = records[0]
    rows, axes, warnings = [], [], []
    for i, problem in enumerate(problems):
        fit = search(problem, max_delay=longest)
        cov, spread = _covariance(whole_jacobian(fit.solution), fit.solution.weighted, fit.problem)
        searched = problem.layout.groups * problem.layout.poles
        delays = slice(searched, searched + len(problem.layout.free_delays))
        _doubt(cov, delays, problem.doubt)
        row = channels.linear(fit, cov, first.outputs[i], first.inputs)
        checked = saturation(fit.problem, fit.problem.measured - fit.solution.residual)
        rows.append(row)
        axes.append(_evidence(fit, first.outputs[i], checked, spread, i))
        if first.angle is not None or first.rate is not None:
            k = min(i, len(first.inputs) - 1)
            checks.check_gain(row[k].num[-1] / row[k].den[-1], first.inputs[k], first.outputs[i])
        warnings += _warnings(axes[-1], row, longest, problem.doubt)
    warnings += _sampled(records)
    return IdentifiedModel(
        first.inputs, first.outputs, tuple(rows), None, tuple(axes), tuple(warnings)
    )


def _bounded(
    problems: Sequence[Problem],
    records: Sequence[Record],
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
        fit = search_servo(alone, i, max_delay=longest, structure=structure)
        cov, spread = _covariance(fit.jacobian, fit.residual * fit.problem.weight, fit.problem)
        if problem.layout.free_delays:
            _doubt(cov, slice(problem.layout.poles, problem.layout.poles + 1), problem.doubt)
        channel, limits = channels.bounded(fit, cov, first.outputs[i], first.inputs[i])
        rows.append(
            tuple(channel if j == i else channels.nothing(channel) for j in range(len(problems)))
        )
        bounds.append(limits)
        none = Saturation(float("nan"), float("nan"), 0, 1.0, None)
        axes.append(_evidence(fit, first.outputs[i], none, spread))
        checks.check_gain(fit.gain, first.inputs[i], first.outputs[i])
        warnings += _warnings(axes[-1], (channel,), longest, problem.doubt)
    warnings += _sampled(records)
    return IdentifiedModel(
        first.inputs, first.outputs, tuple(rows), tuple(bounds), tuple(axes), tuple(warnings)
    )


def _covariance(jacobian: Array, weighted: Array, problem: Problem) -> tuple[Array, float]:
    """Covariance of all parameters, and how much larger the bootstrap's deviations are."""
    cov = covariance(jacobian)
    drawn = bootstrap(jacobian, weighted, step_of_row(problem))
    if drawn is None:
        return cov, float("nan")
    searched = problem.layout.size
    ratio = np.sqrt(np.diag(drawn)[:searched] / np.maximum(np.diag(cov)[:searched], 1e-300))
    spread = float(np.median(ratio[np.isfinite(ratio)])) if np.isfinite(ratio).any() else np.nan
    return (drawn if spread > _SPREAD else cov), spread


def _doubt(cov: Array, delays: slice, doubt: float) -> None:
    """Widen the variances of delays by what the commands' own stamps leave open."""
    cov[delays, delays] += doubt**2  # the stamps of all commands are off alike


def _sampled(records: Sequence[Record]) -> list[str]:
    late = max((r for r in records if r.doubt), key=lambda r: r.slack, default=None)
    if late is None:
        return []
    way = "too short" if late.stamps == "shown" else "too short or too long"
    told = f"{late.name}: commands have no stamps of their own: delays may be "
    told += (
        f"{1e3 * late.slack:.3g} ms {way}, which their intervals cover; give stamps (--commands)"
    )
    return [told]


def _asked(part: Part, own: int) -> bool:
    """Whether a record moved an axis: where it was to stand still, there is nothing to fit."""
    command = part.input[:, own] if part.input.shape[1] > own else part.input
    return part.free or bool(np.any(np.diff(command, axis=0)))


def _evidence(
    fit: AxisFit | ServoFit, name: str, checked: Saturation, spread: float, own: int = 0
) -> AxisEvidence:
    """What speaks for a fit; `own` is the column of the axis' own command."""
    problem = fit.problem
    residual = fit.residual if isinstance(fit, ServoFit) else fit.solution.residual
    spikes = 0 if isinstance(fit, ServoFit) else int(fit.spikes.sum())
    counted = problem.weight > 0.0
    fits: list[list[float]] = [[], []]
    for is_rate in (False, True):
        for index in range(len(problem.parts)):
            rows = counted & (problem.owner == index) & (problem.is_rate == is_rate)
            measured = problem.measured[rows]
            fits[int(is_rate)].append(
                nrmse_fit(measured, measured - residual[rows])
                if rows.any() and _asked(problem.parts[index], own)
                else float("nan")
            )
    weighted = residual * problem.weight
    tests = [
        residual_tests(problem, weighted, is_rate) if (problem.is_rate == is_rate).any() else None
        for is_rate in (False, True)
    ]
    return AxisEvidence(
        name, int(counted.sum()), spikes, fit.noise, tuple(fits[0]), tuple(fits[1]),
        tests[0], tests[1], checked, fit.converged, spread,
    )  # fmt: skip


def _std(channel: ChannelFit, figure: str) -> float:
    return next((e.std for e in channel.estimates if e.name.endswith(figure)), 0.0)


def _warnings(
    axis: AxisEvidence, row: tuple[ChannelFit, ...], longest: float, doubt: float
) -> list[str]:
    """One line for everything a reader must know before quoting a figure."""
    found = []
    name = f"axis '{axis.name}'"
    both = {
        what: [f for f in fits if np.isfinite(f)]
        for what, fits in (("angle", axis.fit_angle), ("rate", axis.fit_rate))
    }
    fit = float(np.median([f for fits in both.values() for f in fits] or [np.nan]))
    if not axis.converged:
        found.append(f"{name}: the search did not settle; treat the figures as a guess")
    if not fit >= _POOR:
        told = ", ".join(f"{what} {np.median(fits):.0f} %" for what, fits in both.items() if fits)
        found.append(f"{name}: poor fit ({told}); another order, or something unmodelled")
    if axis.saturation.saturated:
        found.append(
            f"{name}: rate-limited, the speed grows with the amplitude to the power "
            f"{axis.saturation.exponent:.2f}, not 1; a linear natural frequency means little, "
            "fit the servo"
        )
    elif axis.saturation.saturated is None and axis.saturation.steps >= 4:
        found.append(f"{name}: steps of one size only; saturation cannot be told from slowness")
    for what, tests in (("angle", axis.residual_angle), ("rate", axis.residual_rate)):
        if tests and tests.autocorrelation > _COLOURED and tests.whiteness < 1e-3:
            found.append(
                f"{name}: the {what} residual is not white (autocorrelation "
                f"{tests.autocorrelation:.2f}); there is motion the model lacks"
            )
        if tests and tests.cross_correlation > max(tests.bound, _FOLLOWS):
            found.append(
                f"{name}: the {what} residual follows the command (correlation "
                f"{tests.cross_correlation:.2f} with its changes, noise stays below "
                f"{tests.bound:.2f}); the model lacks an answer to it"
            )
    if axis.spread > _SPREAD:
        found.append(
            f"{name}: steps disagree {axis.spread:.1f} times more than their noise; "
            "intervals are from the bootstrap"
        )
    if axis.spikes:
        found.append(f"{name}: {axis.spikes} readings set aside as spikes")
    for channel in row:
        if channel.delay > 0.98 * longest:
            found.append(f"{name}: delay at the longest searched, {longest:g} s; search further")
        std = _std(channel, "delay")
        if channel.delay + 1.96 * np.sqrt(max(std**2 - doubt**2, 0.0)) < 0.0:
            found.append(
                f"{name}: delay {1e3 * channel.delay:.1f} ms: the command came before the sample "
                "that first shows it; give commands stamps of their own"
            )
    return found
