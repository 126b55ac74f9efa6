"""What to record for a parameter that a record does not determine: by what that record lacks."""

from dataclasses import dataclass

import numpy as np

from analysis.identify.evidence.evidence import ChannelFit
from analysis.identify.problem.problem import Problem
from analysis.identify.servo.starts import reverses

SIZES = 1.5  # largest over smallest step; of less, a limit shows in the shape of one motion only
_COUNTED = 0.02  # of the largest change of the command; smaller ones are no steps
_SLOW = 0.2  # sampling periods per lag of the poles; beyond, readings tell little of them
_SMALL = 8.0  # dead bands or plays to a step in which one shows well
NOMINAL = 0.01  # of the command's range: what intervals of smaller dead bands and plays are over
_MOST = 30.0  # times as many steps; beyond, nobody records them


@dataclass(frozen=True, slots=True)
class Content:
    """What the record of one axis holds.

    Attributes
    ----------
    range : of the command
    gain : output per command
    sizes : largest over smallest step of the command
    smallest : step of the command
    turns : whether the command ever turns back
    coarse : sampling period over the lag of the poles
    gyro : whether rates were measured
    undated : commands have no stamps of their own
    doubt : error of all stamps together [s], rms
    fewer : poles that explain the readings as well as those asked for, else 0
    limited : the record reaches a limit of speed, which a linear model lacks
    """

    range: float
    gain: float
    sizes: float
    smallest: float
    turns: bool
    coarse: float
    gyro: bool
    undated: bool
    doubt: float
    fewer: int
    limited: bool = False

    @classmethod
    def of(cls, problem: Problem, channel: ChannelFit, simpler: bool) -> "Content":
        """The content of the records of one axis, whose linear fit is known."""
        parts = problem.parts
        step = np.abs(np.concatenate([np.diff(p.input[:, 0]) for p in parts]))
        step = step[step > _COUNTED * step.max(initial=0.0)]
        lag = channel.den[-2] / channel.den[-1]
        return cls(
            max(float(np.ptp(p.input)) for p in parts),
            channel.num[-1] / channel.den[-1],
            float(step.max() / step.min()) if len(step) else 1.0,
            float(step.min()) if len(step) else 0.0,
            reverses(problem, 0),
            min(float(np.median(np.diff(p.time))) for p in parts) / lag,
            bool(problem.is_rate.any()),
            any(p.slack > 0.0 for p in parts),
            problem.doubt,
            len(channel.den) - 2 if simpler else 0,
        )


def advice(what: str, value: float, half: float, bar: float, has: Content) -> str:
    """What would bring the half width of an interval down to its bar."""
    if np.isnan(value):
        return "fit with --poles 2: bounds of a servo are fitted with 1 or 2 poles"
    linear = what in ("delay", "natural frequency", "damping", "time constant")
    if linear and has.limited:
        return "rate-limited, fit the servo (--servo)"
    if linear and has.fewer:
        return f"fit with --poles {has.fewer}, which explains the readings as well"
    if what == "delay" and 1.96 * has.doubt > 0.5 * half:
        if has.undated:
            return "give commands stamps of their own (--commands), or say --input-stamps"
        return "record more steps, which meet more phases of the pulse frame, or fit --from-pulses"
    lacks = []
    if linear and has.coarse > _SLOW:
        lacks.append("at a higher rate" if has.gyro else "at a higher rate or with the gyro")
    if what in ("rate limit", "backlash") and has.sizes < SIZES:
        lacks.append("steps of several sizes")
    elif what == "rate limit" and not np.isfinite(half):
        lacks.append("larger steps")
    if what in ("dead band", "backlash"):
        lacks += _of_play(value / (abs(has.gain) if what == "backlash" else 1.0), has)
    if lacks:
        return f"record {' and '.join(lacks)}"
    more = (half / bar) ** 2
    if more < _MOST:
        return f"record about {max(np.ceil(more), 2.0):.0f} times as many steps"
    return "record larger steps, or with a sensor of less noise"


def _of_play(size: float, has: Content) -> list[str]:
    """What the steps lack to show a dead band or a play of some size, on the command's side."""
    found = [] if has.turns else ["steps in both directions"]
    if has.smallest > _SMALL * max(size, NOMINAL * has.range):
        found.append("smaller steps")
    return found
