"""What a record can determine, by its Fisher information, before a model is made of it.

Poles, gain and delay as a linear fit of the record has them; the bounds of the servo from a short
search of one structure: its residual has the colour of the noise, the lag of the sensor and what no
servo explains, and its derivatives hold the bounds against all other parameters.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from analysis.identify import channels, progress
from analysis.identify.advice import NOMINAL, SIZES, Content, advice
from analysis.identify.evidence.evidence import Estimate
from analysis.identify.frozen import without_frozen
from analysis.identify.gimbal import own_records
from analysis.identify.identification import identify, layout_of, longest_delay
from analysis.identify.model import IdentifiedModel
from analysis.identify.problem.assemble import assemble
from analysis.identify.problem.basis import parameters_of
from analysis.identify.problem.problem import Problem
from analysis.identify.servo.known import known_of_servo
from analysis.identify.servo.reached import left_out
from analysis.identify.servo.short_search import short_search
from analysis.plain import Plain
from analysis.recording.measurements import Measurement

_BARS = {  # half widths of 95 % intervals; relative but for the delay [s]
    "gain": 0.01,
    "delay": 1e-3,
    "natural frequency": 0.03,
    "damping": 0.06,
    "time constant": 0.03,
    "rate limit": 0.03,
    "dead band": 0.3,
    "backlash": 0.3,
}
_OF_SERVO = ("rate limit", "dead band", "backlash")
_ONE_SIZE = 2.0  # of a limit that shows in the shape of one motion only


@dataclass(frozen=True, slots=True)
class Expectation(Plain):
    """How well a record can determine one parameter.

    Attributes
    ----------
    name : as in a model's estimates
    half : expected half width of its 95 % interval, over `size` (of a delay in s); infinite where
        the record shows nothing of it
    size, unit : the value that the record suggests; of a dead band or backlash 1 % of the command's
        range or more
    at_least : `size` is a limit that the record does not reach
    below : upper end of the interval of a dead band or backlash that may be zero, else NaN
    bar : half width that counts as determined
    advice : what to record where it is not, by what this record lacks
    """

    name: str
    half: float
    size: float
    unit: str
    at_least: bool
    below: float
    bar: float
    advice: str

    @property
    def enough(self) -> bool:
        """Whether the record determines the parameter."""
        return self.half <= self.bar

    @property
    def limit_reached(self) -> bool:
        """Whether it is a limit of speed that the record reaches."""
        found = self.name.endswith("rate limit") and np.isfinite(self.half)
        return bool(found) and not self.at_least


def expectations(
    records: Sequence[Measurement], poles: int = 2, *, max_delay: float | None = None
) -> tuple[Expectation, ...]:
    """What records can determine of every axis with a command of its own.

    Raises
    ------
    IdentificationError : records that no model can come from
    """
    found: list[Expectation] = []
    records = without_frozen(records)[0]
    for k in range(min(len(records[0].inputs), len(records[0].outputs))):
        own, axis = own_records(records, k), records[0].outputs[k]
        model = identify(own, poles, max_delay=max_delay)
        simpler = model.axes[0].simpler
        start = identify(own, poles - 1, max_delay=max_delay) if simpler else model
        progress.say(f"axis {axis}, servo")
        problem = assemble(
            own, 0, layout_of(own, poles - 1 if simpler else poles, 0), shared_offset=False
        )
        bounds = _bounds(problem, start, longest_delay(own, max_delay))
        has = Content.of(problem, model.channels[0][0], simpler)
        of_servo = [_expected(e, has) for e in bounds]
        if any(e.limit_reached for e in of_servo):
            has = replace(has, fewer=0, limited=True)  # a limit of speed hides a pole
        found += [_expected(e, has) for e in model.channels[0][0].estimates]
        found += of_servo
    return tuple(found)


def _expected(e: Estimate, has: Content) -> Expectation:
    what = next(n for n in _BARS if e.name.endswith(f" {n}"))  # the channel's may have spaces
    least = {"dead band": has.range, "backlash": has.range * abs(has.gain)}.get(what, 0.0)
    size = max(abs(e.value), NOMINAL * least, 1e-300)
    half = 1.96 * e.std / (1.0 if what == "delay" else size)
    if what == "rate limit" and has.sizes < SIZES:
        half *= _ONE_SIZE
    known = (has.turns or what != "backlash") and np.isfinite(half) and half > 0.0
    half = half if known else np.inf
    open_below = what in ("dead band", "backlash") and 1.96 * e.std >= e.value
    below = e.value + 1.96 * e.std if known and open_below else np.nan
    bar = _BARS[what]
    return Expectation(
        e.name, half, size, e.unit, e.at_least, below, bar, advice(what, e.value, half, bar, has)
    )


def _bounds(problem: Problem, model: IdentifiedModel, longest: float) -> list[Estimate]:
    """Of rate limit, dead band and backlash."""
    axis, (command,) = model.outputs[0], model.inputs
    if problem.layout.poles > 2:
        return [Estimate(f"{axis} {what}", np.nan, np.nan, "") for what in _OF_SERVO]
    channel = model.channels[0][0]
    fit = short_search(
        problem, 0, parameters_of(np.roots(channel.den)), channel.delay, max_delay=longest
    )
    known = known_of_servo(fit)[0]
    most = left_out(fit, 0, longest, known.excess)
    _, servo = channels.bounded(fit, known, axis, command, longest, most)
    return list(servo.estimates)
