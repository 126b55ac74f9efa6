"""What a record can determine, by its Fisher information, before a model is made of it.

The information is that of a nominal gimbal: poles and delay as a linear fit of the record has them,
a speed limit a fifth below the fastest motion, dead band and play of 1 % of the command's range.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from analysis.array import Array
from analysis.identify.assemble import assemble
from analysis.identify.basis import parameters_of
from analysis.identify.gimbal import own_records
from analysis.identify.identification import identify, layout_of
from analysis.identify.model import IdentifiedModel
from analysis.identify.noise import from_differences, quantisation
from analysis.identify.problem import Problem
from analysis.identify.segments import step_of_row
from analysis.identify.servo import servo_jacobian
from analysis.identify.servo_starts import command_unit, fastest, scaled
from analysis.identify.uncertainty import covariance, few
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
_NOMINAL = 0.01  # of the command's range: dead band and play
_SLOWER = 0.8  # nominal limit over the fastest motion
_ROUGH = 2.0  # intervals of bounds over those of white noise: steps scatter, the loss is rough
_SIZES = 1.5  # largest over smallest step that show a limit


@dataclass(frozen=True, slots=True)
class Expectation(Plain):
    """How well a record can determine one parameter.

    Attributes
    ----------
    name : as in a model's estimates
    half : expected half width of its 95 % interval, over its value (of a delay in s); infinite
        where the record shows nothing of it
    bar : half width that counts as determined
    advice : what to record where it is not
    """

    name: str
    half: float
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
    for k, axis in enumerate(records[0].outputs[: len(records[0].inputs)]):
        own = own_records(records, k)
        model = identify(own, poles, max_delay=max_delay)
        for e in model.channels[0][0].estimates:
            what = e.name.partition(" ")[2]
            size = 1.0 if what == "delay" else max(abs(e.value), 1e-300)
            half = 1.96 * e.std / size if e.determined else np.inf
            found.append(Expectation(e.name, half, _BARS[what], _ADVICE[what]))
        for what, half in _bounds(own, model, poles).items():
            found.append(Expectation(f"{axis} {what}", half, _BARS[what], _ADVICE[what]))
    return tuple(found)


def _bounds(records: Sequence[Measurement], model: IdentifiedModel, poles: int) -> dict[str, float]:
    """Expected relative half widths of rate limit, dead band and backlash."""
    names = ("rate limit", "dead band", "backlash")
    if poles > 2:
        return dict.fromkeys(names, np.inf)
    plain = assemble(records, 0, layout_of(records, poles, 0), shared_offset=False)
    problem = scaled(plain, 0, command_unit(plain, 0))
    # either is too large: the one by motion that these bounds explain, the other by fast motion
    every = np.ones(len(problem.measured), dtype=bool)
    noise = np.fmin(model.axes[0].noise, from_differences(problem, every, quantisation(problem)))
    problem = problem.weighed(1.0 / np.where(problem.is_rate, noise[1], noise[0]))
    channel = model.channels[0][0]
    size = _NOMINAL * max(float(np.ptp(p.input)) for p in problem.parts)
    section = parameters_of(np.roots(channel.den))
    limit = np.log(_SLOWER * fastest(problem))
    theta = np.array([*section, max(channel.delay, 0.0), limit, size, size])
    jacobian = servo_jacobian(problem, 0, "speed", theta)
    std = np.sqrt(np.clip(np.diag(covariance(jacobian)), 0.0, None))
    told = np.linalg.norm(jacobian, axis=0) > 0.0
    wider = _ROUGH * few(len(np.unique(step_of_row(problem))) - 1 - len(theta))
    half = 1.96 * wider * std[poles + 1 : poles + 4] / np.array([1.0, size, size])
    shown = [_sizes(problem) >= _SIZES, True, _turns(problem)]
    return {
        name: float(h) if t and s else np.inf
        for name, h, t, s in zip(names, half, told[poles + 1 : poles + 4], shown, strict=True)
    }


def _steps(problem: Problem) -> Array:
    return np.concatenate([np.diff(p.input[:, 0]) for p in problem.parts])


def _sizes(problem: Problem) -> float:
    """Largest over smallest change of the command; changes of 2 % of the largest do not count."""
    size = np.abs(_steps(problem))
    size = size[size > 0.02 * size.max(initial=0.0)]
    return float(size.max() / size.min()) if len(size) else 1.0


def _turns(problem: Problem) -> bool:
    steps = _steps(problem)
    return bool((steps > 0.0).any() and (steps < 0.0).any())
