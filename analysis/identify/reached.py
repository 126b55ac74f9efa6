"""Limits of speed that the readings of a record do not ask for."""

from dataclasses import replace

import numpy as np

from analysis.array import Array
from analysis.identify.evidence import ServoBounds
from analysis.identify.known import known_of_servo
from analysis.identify.servo_descent import descend, fit_at, loss_of
from analysis.identify.servo_fit import ServoFit

_LIFTED = 3.0  # ln: a limit 20 times higher bounds nothing
_CHANCE = 3.84  # of a χ² of one degree of freedom, which is higher in 5 % of all cases
_HALVINGS = 20


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


def idle_warnings(bounds: ServoBounds, axis: str) -> list[str]:
    """What a model with such a limit is flown with."""
    names = [e.name.partition(" ")[2] for e in bounds.estimates if e.at_least]
    if not names:
        return []
    text = f"axis '{axis}': its motion in this record does not reach the {' and the '.join(names)};"
    return [f"{text} the model has the lowest that the record allows; record larger steps"]


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
