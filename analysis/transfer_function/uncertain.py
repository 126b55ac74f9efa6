"""The covariance of an identified model's figures, and the model that has other figures."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from analysis.array import Array
from analysis.transfer_function.channel import Channel
from analysis.transfer_function.covariance import Covariance
from analysis.transfer_function.file import ModelFileError
from analysis.transfer_function.model import TransferFunctionModel
from analysis.transfer_function.servo import Servo

_POLES = re.compile(r"(natural frequency|damping|time constant)( \d+)?")
_SERVO = {
    "rate limit": "rate_limit",
    "rate limit back": "rate_limit_back",
    "slew of the set point": "slew",
    "dead band": "dead_band",
    "backlash": "backlash",
}
_PLAY = ("dead_band", "backlash")
_TURNED = {"rate_limit": "rate_limit_back", "rate_limit_back": "rate_limit"}


def distribution(model: TransferFunctionModel) -> tuple[Covariance, Array]:
    """The covariance of a model's figures, and its lower triangular root (n, n).

    Raises
    ------
    ModelFileError : there is none, it is not positive definite, or its values are not the model's
    """
    if (known := model.covariance) is None:
        raise ModelFileError(
            "has no covariance; `twin identify` writes one for uncoupled axes, without --both"
        )
    same = with_figures(model, dict(zip(known.names, known.values, strict=True)))
    a, b = (
        [n for row in m.channels for c in row for n in (*c.num, *c.den, c.delay)]
        for m in (model, same)
    )
    for m, numbers in ((model, a), (same, b)):
        numbers += [getattr(s, name) or 0.0 for s in m.servos for name in _SERVO.values()]
    if not np.allclose(a, b, rtol=1e-6, atol=1e-9):
        raise ModelFileError("covariance.values are not those of the channels and the servo")
    return known, _root(np.array(known.matrix))


def _root(matrix: Array) -> Array:
    scale = np.sqrt(np.clip(np.diag(matrix), 0.0, None))
    try:
        if not (scale > 0.0).all():
            raise np.linalg.LinAlgError
        one = matrix / np.outer(scale, scale)  # figures of very different units
        if not np.allclose(one, one.T, rtol=0.0, atol=1e-6):
            raise np.linalg.LinAlgError
        return np.asarray(scale[:, None] * np.linalg.cholesky(one))
    except np.linalg.LinAlgError:
        raise ModelFileError("covariance must be symmetric and positive definite") from None


def with_figures(
    model: TransferFunctionModel, figures: Mapping[str, float]
) -> TransferFunctionModel:
    """The model with other figures, named as in its covariance; all others stay.

    A delay, dead band or backlash below zero becomes zero. One servo for all axes has their means,
    as files had in which its speeds are not those ahead of the gain.

    Raises
    ------
    ModelFileError : a name that is none of the model, or a value that no model can have
    """
    left = dict(figures)
    rows = tuple(
        tuple(
            _channel(channel, f"{output}/{command} ", left)
            for command, channel in zip(model.inputs, row, strict=True)
        )
        for output, row in zip(model.outputs, model.channels, strict=True)
    )
    servo = model.servo
    if isinstance(servo, tuple):
        servo = tuple(
            _servo(s, (o,), left, _gain(row))
            for s, o, row in zip(servo, model.outputs, rows, strict=True)
        )
    elif servo is not None:
        servo = _servo(servo, model.outputs, left)
    elif of_servo := {f"{o} {what}" for o in model.outputs for what in _SERVO} & set(left):
        raise ModelFileError(f"{of_servo.pop()}: the model has no servo")
    if left:
        raise ModelFileError(f"{next(iter(left))!r} is no figure of the model")
    return replace(model, channels=rows, servo=servo)


def _gain(row: Sequence[Channel]) -> float:
    """Gain of the first channel of an axis that has one, else 1."""
    return next((c.num[-1] / c.den[-1] for c in row if c.num[-1] and c.den[-1]), 1.0)


def _servo(servo: Servo, axes: Sequence[str], left: dict[str, float], gain: float = 1.0) -> Servo:
    """A servo with the means of its axes' figures in `left`, which are taken from there."""
    for what, name in _SERVO.items():
        given = [left.pop(f"{axis} {what}") for axis in axes if f"{axis} {what}" in left]
        if not given:
            continue
        value = float(np.mean(given))
        if name in _PLAY:
            value = max(0.0, value)
        elif value <= 0.0:  # zero would be no limit
            raise ModelFileError(f"{what} is {value:g}; it must be positive")
        else:  # of the output
            value /= abs(gain)
            turned = gain < 0.0 and servo.structure == "set-point"
            name = _TURNED.get(name, name) if turned else name
        servo = replace(servo, **{name: value})  # type: ignore[arg-type]
    return servo


def _channel(channel: Channel, name: str, left: dict[str, float]) -> Channel:
    """A channel with its figures of `left`, which are taken from there."""
    own = {k.removeprefix(name): left.pop(k) for k in list(left) if k.startswith(name)}
    if not own:
        return channel
    if channel.num[-1] == 0.0 or own.get("zero") == 0.0:
        raise ModelFileError(f"{name.strip()}: a channel without gain has no figures")
    den = np.array(channel.den) / channel.den[0]
    num = np.array(channel.num) / channel.num[-1]  # of gain 1
    gain = own.pop("gain", channel.num[-1] / channel.den[-1])
    delay = max(0.0, own.pop("delay", channel.delay))
    if (zero := own.pop("zero", None)) is not None:
        num = np.array([-1.0 / zero, 1.0])
    if poles := {k: own.pop(k) for k in list(own) if _POLES.fullmatch(k)}:
        den = _denominator(poles, name)
    if own or len(den) != len(channel.den) or len(num) != len(channel.num):
        raise ModelFileError(f"{name.strip()}: the figures are not those of this channel")
    return Channel(tuple((gain * den[-1] * num).tolist()), tuple(den.tolist()), delay)


def _denominator(poles: dict[str, float], name: str) -> Array:
    """Product of s² + 2ζω s + ω² over the pairs, and of s + 1/T."""
    for what, value in poles.items():
        if not value > 0.0:
            raise ModelFileError(f"{name}{what} is {value:g}; it must be positive")
    den = np.ones(1)
    for what, value in poles.items():
        if what == "time constant":
            den = np.convolve(den, [1.0, 1.0 / value])
        elif what.startswith("natural"):
            damping = poles.get(what.replace("natural frequency", "damping"))
            if damping is None:
                raise ModelFileError(f"{name}{what}: needs the damping beside it")
            den = np.convolve(den, [1.0, 2.0 * damping * value, value * value])
    return den
