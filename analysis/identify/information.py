"""What a record can determine, by its Fisher information, before a model is made of it.

Poles, gain and delay as a linear fit of the record has them; the bounds of the servo from a short
search of one structure: its residual has the colour of the noise, the lag of the sensor and what no
servo explains, and its derivatives hold the bounds against all other parameters.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from analysis.identify import channels
from analysis.identify.assemble import assemble
from analysis.identify.basis import parameters_of
from analysis.identify.evidence import Estimate
from analysis.identify.gimbal import own_records
from analysis.identify.identification import identify, layout_of, longest_delay
from analysis.identify.known import known_of_servo
from analysis.identify.model import IdentifiedModel
from analysis.identify.servo_starts import reverses
from analysis.identify.short_search import short_search
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
_ADVICE = {
    "gain": "record longer holds, or larger steps",
    "delay": "date commands by stamps of their own, sample faster, or record more steps",
    "natural frequency": "sample faster, add the gyro, or record more steps",
    "damping": "sample faster, add the gyro, or record more steps",
    "time constant": "sample faster, or record more steps",
    "rate limit": "add steps of several sizes, up to the largest that are flown",
    "dead band": "add steps that are small, in both directions",
    "backlash": "add steps that reverse, in several sizes",
}
_OF_SERVO = ("rate limit", "dead band", "backlash")
_NOMINAL = 0.01  # of the command's range: what intervals of smaller dead bands and plays are over


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
    bar : half width that counts as determined
    advice : what to record where it is not
    """

    name: str
    half: float
    size: float
    unit: str
    at_least: bool
    bar: float
    advice: str

    @property
    def enough(self) -> bool:
        """Whether the record determines the parameter."""
        return self.half <= self.bar


def expectations(
    records: Sequence[Measurement], poles: int = 2, *, max_delay: float | None = None
) -> tuple[Expectation, ...]:
    """What records can determine of every axis with a command of its own.

    Raises
    ------
    IdentificationError : records that no model can come from
    """
    found: list[Expectation] = []
    for k in range(min(len(records[0].inputs), len(records[0].outputs))):
        own = own_records(records, k)
        model = identify(own, poles, max_delay=max_delay)
        found += [_expected(e) for e in model.channels[0][0].estimates]
        found += _bounds(own, model, poles, longest_delay(own, max_delay))
    return tuple(found)


def _expected(e: Estimate, least: float = 0.0, *, shown: bool = True) -> Expectation:
    what = e.name.partition(" ")[2]
    size = max(abs(e.value), least, 1e-300)
    half = 1.96 * e.std / (1.0 if what == "delay" else size)
    known = shown and np.isfinite(half) and half > 0.0
    return Expectation(
        e.name, half if known else np.inf, size, e.unit, e.at_least, _BARS[what], _ADVICE[what]
    )


def _bounds(
    records: Sequence[Measurement], model: IdentifiedModel, poles: int, longest: float
) -> list[Expectation]:
    """Of rate limit, dead band and backlash."""
    axis, (command,) = model.outputs[0], model.inputs
    if poles > 2:
        return [_expected(Estimate(f"{axis} {what}", np.nan, np.nan, "")) for what in _OF_SERVO]
    problem = assemble(records, 0, layout_of(records, poles, 0), shared_offset=False)
    channel = model.channels[0][0]
    fit = short_search(
        problem, 0, parameters_of(np.roots(channel.den)), channel.delay, max_delay=longest
    )
    _, servo = channels.bounded(fit, known_of_servo(fit)[0], axis, command, longest)
    size = _NOMINAL * max(float(np.ptp(p.input)) for p in problem.parts)
    return [
        _expected(servo.rate_limit),
        _expected(servo.dead_band, size),
        _expected(servo.backlash, size * abs(fit.gain), shown=reverses(problem, 0)),
    ]
