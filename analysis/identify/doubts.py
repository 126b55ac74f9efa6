"""The reasons to doubt the figures of a fit, as its evidence has them."""

import math
from collections.abc import Sequence

import numpy as np

from analysis.identify.channels import SHOWN
from analysis.identify.evidence.diagnostics import Residuals
from analysis.identify.evidence.evidence import AxisEvidence, ChannelFit, Estimate, ServoBounds
from analysis.identify.linear.selection import Choice
from analysis.identify.problem.problem import Problem
from analysis.recording.measurements import Measurement

_POOR = 80.0  # percent of fit: below, a figure is a guess
_COLOURED = 0.15  # autocorrelation that matters, however many samples prove it
_COARSE = 1.2  # rad of a pole between two readings: its motion is over within one or two
_SAME = 0.1  # of a frequency: below, a change between sizes of steps is taken for none
# residual of the start over any other: of records from rest at most 1.2 (60 linear gimbals) and 2.1
# (30 rate-limited ones), of five that begin in motion 3.5 to 17
_BEGINS = 3.0
_ANSWER = 0.1  # share of the residual's power that another linear model would take; chance: 0


def stamp_warnings(records: Sequence[Measurement]) -> list[str]:
    """What was left out of files, and whether commands were only sampled: then delays are open."""
    left = [f"{r.name}: {r.note}" for r in records if r.note]
    late = max((r for r in records if r.doubt), key=lambda r: r.slack, default=None)
    if late is None:
        return left
    way = "too short" if late.stamps == "shown" else "too short or too long"
    text = f"{late.name}: commands have no stamps of their own: delays may be "
    text += (
        f"{1e3 * late.slack:.3g} ms {way}, which their intervals cover; give stamps"
        " (--commands), or say when they were taken (--input-stamps)"
    )
    return [*left, text]


def selection_warnings(
    problem: Problem,
    choice: Choice,
    row: tuple[ChannelFit, ...],
    inputs: tuple[str, ...],
    output: str,
) -> list[str]:
    """One line for each channel and zero that was asked for and is not in the readings."""
    found = []
    layout = choice.fit.problem.layout
    for j, name in enumerate(inputs):
        if j not in choice.columns:
            most = 196.0 * row[j].estimates[0].std
            found.append(
                f"{output}/{name}: axis '{output}' shows no answer to command '{name}', gain "
                f"within ± {most:.2g} %; the channel is left out"
            )
        elif (zeros := layout.zeros_of(choice.columns.index(j))) < problem.layout.zeros:
            found.append(
                f"{output}/{name}: the readings show {zeros or 'no'} zeros of the "
                f"{problem.layout.zeros} asked for; the others are left out"
            )
    return found


def warnings_of(
    axis: AxisEvidence,
    row: tuple[ChannelFit, ...],
    longest: float,
    problem: Problem,
    own: int = 0,
) -> list[str]:
    """One line for everything a reader must know before quoting a figure.

    What a model lacks is one where it changes a figure by more than its interval, where the
    intervals do not allow for it, or where another linear model would have it. Otherwise it is
    noise or scatter, which the intervals are made of.

    Parameters
    ----------
    own : place in `row` of the channel from the axis' own command
    """
    name = f"axis '{axis.name}'"
    found = []
    if not axis.converged:
        found.append(f"{name}: the search did not settle; treat the figures as a guess")
    limited = _limited(axis, row[own], name)
    if axis.simpler and not limited:  # a limit of speed hides a pole
        poles = len(row[own].den) - 1
        explain = "1 pole explains" if poles == 2 else f"{poles - 1} poles explain"
        found.append(
            f"{name}: {explain} the readings as well as {poles}; fit with --poles {poles - 1}"
        )
    found += [*_begin_warnings(axis, name), *_fit_warnings(axis, name), *limited]
    found += [*_static_warnings(axis, name), *_residual_warnings(axis, name)]
    found += _smear_warnings(axis, name, row[own])
    if axis.spikes:
        found.append(f"{name}: {axis.spikes} readings set aside as spikes")
    for channel in row:
        found += _channel_warnings(channel, longest, problem, name)
    return found


def effective_warnings(axis: AxisEvidence, bounds: ServoBounds) -> list[str]:
    """What the figures of a servo are where its structure leaves more than noise.

    Their intervals are of repeats of this measurement by this structure: of emulated rigs, whose
    gimbal crosses the play of its gears, none of eight held the motor's own limit.
    """
    tests = [t for t in (axis.residual_angle, axis.residual_rate) if t is not None]
    if _noise_alone(axis) or not (axis.repeats > _ANSWER or any(map(_coloured, tests))):
        return []
    text = f"axis '{axis.name}': the structure '{bounds.structure}' leaves more than noise; "
    text += "its delay, poles, limits, dead band and backlash are effective values, those of "
    return [text + "the servo may lie outside their intervals"]


def _fits(axis: AxisEvidence) -> dict[str, list[float]]:
    """Of each sensor those of the records that show any."""
    return {
        what: [f for f in fits if np.isfinite(f)]
        for what, fits in (("angle", axis.fit_angle), ("rate", axis.fit_rate))
    }


def _fit(axis: AxisEvidence) -> float:
    """Median over records and sensors [%]."""
    return float(np.median([f for fits in _fits(axis).values() for f in fits] or [np.nan]))


def _begin_warnings(axis: AxisEvidence, name: str) -> list[str]:
    if axis.beginning < _BEGINS:
        return []
    text = f"{name}: the gimbal already moves when a record begins (the residual there is"
    text += f" {axis.beginning:.1f} times that of any time after it): let it begin at rest, give"
    text += " the command before it (--before), or fit the start as well (--initial free)"
    return [text]


def _fit_warnings(axis: AxisEvidence, name: str) -> list[str]:
    found = []
    if not _fit(axis) >= _POOR and not _noise_alone(axis):
        both = _fits(axis).items()
        text = ", ".join(f"{what} {np.median(fits):.0f} %" for what, fits in both if fits)
        found.append(f"{name}: poor fit ({text}); another order, or something unmodelled")
    if axis.saturation.saturated is None and axis.saturation.steps >= 4:
        found.append(f"{name}: steps of one size only; cannot distinguish saturation from slowness")
    return found


def _static_warnings(axis: AxisEvidence, name: str) -> list[str]:
    s = axis.statics
    if s is None:
        return []
    where = "subtract it, or record again"
    if s.drift:
        return [
            f"{name}: the offset of the angle drifts by {s.drift:.1%} of its motion per s; {where}"
        ]
    if s.jump:
        said = f"{name}: the offset of the angle jumps by {s.jump:.0%} of its motion near"
        return [f"{said} {s.jumped:.3g} s; {where}"]
    if not s.bent:
        return []
    gains = ""
    if np.isfinite([s.small, s.large]).all():
        gains = f" (small steps {s.small:.3g}, large ones {s.large:.3g})"
    text = f"{name}: the gain depends on the amplitude{gains}: the angles at rest lie"
    text += f" {100.0 * s.scatter:.0f} % of their spread off a line over the commands; dead band,"
    return [f"{text} play, friction or stops: fit the servo (--servo)"]


def _limited(axis: AxisEvidence, channel: ChannelFit, name: str) -> list[str]:
    if not axis.saturation.saturated or (changed := _changed(axis, channel)) is None:
        return []
    power = f"the speed grows with the amplitude to the power {axis.saturation.exponent:.2f}, not 1"
    return [f"{name}: rate-limited, {power}{changed}; fit the servo (--servo)"]


def _changed(axis: AxisEvidence, channel: ChannelFit) -> str | None:
    """Poles and delay that the sizes of the steps change; None where they are shown to change none.

    Empty where the steps cannot tell.
    """
    found = [
        f"{e.name} {_short(e.value, e.unit)}"
        for e in axis.sizes
        if not abs(e.value) <= 1.96 * e.std
    ]
    if found:
        return f" (from the smallest to the largest: {', '.join(found)})"
    own = {_figure(e, channel): abs(e.value) for e in channel.estimates}
    shares = [
        (abs(e.value) + 1.96 * e.std) / own[e.name]
        for e in axis.sizes
        if e.name.startswith(("natural frequency", "time constant"))
    ]
    return None if shares and max(shares) <= _SAME else ""


def _figure(estimate: Estimate, channel: ChannelFit) -> str:
    """What a channel's estimate is of: its name without the channel's, which may have spaces."""
    return estimate.name.removeprefix(channel.estimates[0].name.removesuffix("gain"))


def _short(value: float, unit: str) -> str:
    return f"{1e3 * value:+.2g} ms" if unit == "s" else f"{value:+.2g} {unit}".removesuffix(" 1")


def _noise_alone(axis: AxisEvidence) -> bool:
    """Whether what is left is white: then no model of this axis fits better."""
    tests = [t for t in (axis.residual_angle, axis.residual_rate) if t is not None]
    return axis.repeats < _ANSWER and all(t.autocorrelation < _COLOURED for t in tests)


def _coloured(tests: Residuals) -> bool:
    """Whether a residual has a colour that matters and that chance does not give."""
    return tests.autocorrelation > _COLOURED and tests.whiteness < 1e-3


def _residual_warnings(axis: AxisEvidence, name: str) -> list[str]:
    found = []
    for what, tests in (("angle", axis.residual_angle), ("rate", axis.residual_rate)):
        if tests and _coloured(tests) and not axis.allowed:
            found.append(
                f"{name}: the {what} residual is not white (autocorrelation "
                f"{tests.autocorrelation:.2f}); intervals do not allow for it, record more steps"
            )
    if axis.repeats > _ANSWER:
        share = f"{100 * axis.repeats:.0f} % of it"
        found.append(
            f"{name}: the residual follows the command, and another order, zero or delay explains"
            f" {share}; of a servo with a limit of speed or a dead band it does so too (--servo)"
        )
    return found


def _smear_warnings(axis: AxisEvidence, name: str, channel: ChannelFit) -> list[str]:
    found = []
    for e in channel.estimates:
        change = axis.smear.get(_figure(e, channel), 0.0)
        if abs(change) > 1.96 * e.std:
            found.append(f"{e.name} {_short(change, e.unit)}")
    if not found:
        return []
    text = f"{name}: steps come {1e3 * axis.stamps:.2g} ms (rms) before or after their commands' "
    return [f"{text}stamps, which changes {', '.join(found)}; give stamps (--commands)"]


def _channel_warnings(
    channel: ChannelFit, longest: float, problem: Problem, name: str
) -> list[str]:
    if not any(channel.num):
        return []
    found = []
    delay = next((e for e in channel.estimates if e.name.endswith("delay")), None)
    shown = channel.estimates[0].name.removesuffix(" gain")
    lost = [e.name for e in channel.estimates if not e.determined]
    gain = channel.estimates[0]
    if abs(gain.value) <= SHOWN * gain.std:
        most = 100.0 * (abs(gain.value) + 1.96 * gain.std)
        found.append(f"{shown}: no answer beyond the noise, gain within ± {most:.2g} %")
    if lost:
        found.append(f"{', '.join(lost)}: not determined by these readings")
    period = min(float(np.median(np.diff(p.time))) for p in problem.parts)
    fastest = float(np.abs(np.roots(channel.den)).max())
    bare = problem.layout.inputs > 1 and problem.layout.zeros == 0
    if fastest * period > _COARSE:
        rate = f"at {math.ceil(fastest)} Hz or more" if fastest * period < 20.0 else "faster"
        found.append(
            f"{shown}: its motion of {fastest:.3g} rad/s lies beyond the sampling"
            f" ({1e3 * period:.3g} ms between readings): frequency, damping and delay are not"
            f" determined by its shape, whatever their intervals; record {rate}"
            + (", or fit a zero (--zeros 1), without which a coupling looks so" if bare else "")
        )
    if channel.delay > 0.98 * longest:
        found.append(f"{name}: delay at the longest searched, {longest:g} s; search further")
    std = delay.std if delay else 0.0
    slack = max(p.slack for p in problem.parts)
    if channel.delay + 1.96 * np.sqrt(max(std**2 - problem.doubt**2, 0.0)) < 0.0:
        found.append(
            f"{name}: delay {1e3 * channel.delay:.1f} ms: the command came before the sample "
            "that first shows it; give commands stamps of their own"
        )
    elif std > 0.0 and channel.delay < 1e-5 - slack:
        found.append(
            f"{shown}: delay at its lower bound, {-1e3 * slack:.3g} ms: the gimbal answers no "
            "later than commanded; are commands dated late, or is the order too high?"
        )
    return found
