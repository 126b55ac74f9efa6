"""Bounds of a servo that the readings do not ask for: how low, or how large, they may be."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from analysis.array import Array
from analysis.identify.evidence.evidence import ServoBounds
from analysis.identify.evidence.uncertainty import Uncertainty
from analysis.identify.linear.starts import thinned
from analysis.identify.servo.descent import descend, fit_at, loss_of
from analysis.identify.servo.fit import ServoFit
from analysis.identify.servo.known import known_of_servo
from analysis.identify.servo.starts import limits, reverses, with_values

_LIFTED = 3.0  # ln: a limit 20 times higher bounds nothing
_CHANCE = 3.84  # of a χ² of one degree of freedom, which is higher in 5 % of all cases
_INTERVAL = 1.96  # deviations
_HALVINGS = 20
_LEAST = 1e-3  # of the highest dead band or backlash
_TRIALS = 5  # halvings of the logarithm: within a quarter
_FAR = 4.0  # times the loss allowed: no descent ends there
_ROWS = 1500  # readings that these see


def without_idle_limits(fit: ServoFit, axis: int, max_delay: float) -> ServoFit:
    """The fit with those limits lifted without which the readings are explained as well.

    A likelihood ratio of 95 %, in units of the residual's scatter over whole steps or by its
    colour. The lowest limit that the readings allow is the lower end of that interval.
    """
    if fit.structure == "command":
        return fit  # every jump of the command becomes a ramp: its limit is always reached
    n, least = fit.poles, {}
    allowed = _CHANCE * known_of_servo(fit)[0].excess
    linear = np.arange(n + 1)
    for name, move in _limits(fit).items():
        now = _loss(fit, axis, fit.theta)
        lifted, _ = descend(
            fit.problem, axis, fit.structure, fit.theta + _LIFTED * move, max_delay, linear
        )
        best = _loss(fit, axis, lifted)
        if best > now + allowed:
            continue
        low, high = -2.0 * _LIFTED, 0.0
        for _ in range(_HALVINGS):
            middle = 0.5 * (low + high)
            bound = _loss(fit, axis, lifted + middle * move) > best + allowed
            low, high = (middle, high) if bound else (low, middle)
        least[name] = _speed(lifted + high * move, n, name)
        fit = fit_at(fit.problem, axis, fit.structure, lifted, fit.noise, fit.converged)
    return replace(fit, idle=least)


def left_out(fit: ServoFit, axis: int, max_delay: float, excess: float) -> dict[str, float]:
    """How large a dead band or backlash of zero may be, on the command's side [rad].

    The upper end of a likelihood interval of 95 %, all other parameters at their best: of two that
    explain the same shortfall each may be as large as both.

    Parameters
    ----------
    excess : variance of the parameters over that of white noise
    """
    n, every = fit.poles, np.arange(len(fit.theta))
    few = replace(fit, problem=thinned(fit.problem, _ROWS))
    share = len(few.problem.measured) / len(fit.problem.measured)
    allowed = _loss(few, axis, fit.theta) + _CHANCE * excess * share
    highest = limits(fit.problem, max_delay, fit.structure)[1]
    found = {}
    for name, place in (("dead band", n + 2), ("backlash", n + 3)):
        if fit.theta[place] > 0.0 or (name == "backlash" and not reverses(fit.problem, axis)):
            continue
        near, low, high = fit.theta, np.log(_LEAST * highest[place]), np.log(highest[place])
        free = np.delete(every, place if reverses(fit.problem, axis) else [place, n + 3])
        for _ in range(_TRIALS):
            middle = 0.5 * (low + high)
            at = with_values(near, [place], np.exp([middle]))
            if _loss(few, axis, at) > allowed:
                if _expected(few, axis, at, free) > _FAR * allowed:
                    high = middle
                    continue
                at, _ = descend(few.problem, axis, fit.structure, at, max_delay, free)
                if _loss(few, axis, at) > allowed:
                    high = middle
                    continue
            low, near = middle, at
        shown = high < np.log(highest[place])  # else nothing speaks against the largest
        found[name] = float(np.exp(high)) if shown else np.inf
    return found


def _expected(fit: ServoFit, axis: int, theta: Array, free: NDArray[np.intp]) -> float:
    """Loss after one Gauss-Newton step of some parameters, as far as the model is linear."""
    at = fit_at(fit.problem, axis, fit.structure, theta, fit.noise, True)
    slope = at.jacobian[:, np.append(free, np.arange(len(theta), at.jacobian.shape[1]))]
    move = np.linalg.lstsq(slope, at.weighted, rcond=1e-10)[0]
    return float(np.sum((at.weighted - slope @ move) ** 2))


def idle_warnings(bounds: ServoBounds, axis: str) -> list[str]:
    """What a model with such a limit is flown with."""
    names = [e.name.removeprefix(f"{axis} ") for e in bounds.estimates if e.at_least]
    if not names:
        return []
    text = f"axis '{axis}': its motion in this record does not reach the {' and the '.join(names)};"
    return [f"{text} the model has the lowest that the record allows; record larger steps"]


def rival_warnings(fit: ServoFit, bounds: ServoBounds, known: Uncertainty, axis: str) -> list[str]:
    """Whether a structure that predicts as well has another delay, poles or limit."""
    if fit.rival is None or bounds.idle:
        return []
    name, change = fit.rival
    places, at = list(range(len(change))), fit.theta[: len(change)]
    std = known.deviations(np.array, at, places, np.zeros(len(change)))
    if not (np.abs(change) > _INTERVAL * std).any():
        return []
    text = f"axis '{axis}': the readings do not tell the structures '{fit.structure}' and '{name}'"
    return [f"{text} apart, whose figures differ (--structure {name}); record steps of more sizes"]


def _limits(fit: ServoFit) -> dict[str, Array]:
    """Directions in θ in which one limit changes alone."""
    n, whole = fit.poles, np.eye(len(fit.theta))
    if fit.structure != "set-point":
        return {"rate limit": whole[n + 1]}
    return {  # the limit downward is a multiple of that upward
        "rate limit": whole[n + 1] - whole[n + 5],
        "rate limit back": whole[n + 5],
        "slew of the set point": whole[n + 4],
    }


def _speed(theta: Array, poles: int, name: str) -> float:
    """A limit in θ, on the command's side of the gain [rad/s]."""
    up = float(np.exp(theta[poles + 1]))
    if name == "rate limit":
        return up
    slew, back = np.exp(theta[poles + 4 : poles + 6])
    return float(slew if name == "slew of the set point" else up * back)


def _loss(fit: ServoFit, axis: int, theta: Array) -> float:
    return loss_of(fit.problem, axis, fit.structure, theta)
