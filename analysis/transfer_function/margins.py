"""Stability margins of a control loop with an identified gimbal in it."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.array import Array
from analysis.plain import Plain
from analysis.transfer_function.channel import Channel
from analysis.transfer_function.model import TransferFunctionModel

_POINTS = 1000  # of the grid between two of which a crossing is sought
_PADE = 8  # order; its phase is that of the delay to 1e-4 rad over any crossover here


@dataclass(frozen=True, slots=True)
class Loop:
    """A loop without its gimbal, linearised at one instant of a flight.

    Attributes
    ----------
    name : of the instant, for example `ignition`
    num, den : loop gain of controller and vehicle, descending powers of s
    hold : period over which a command is held [s]
    """

    name: str
    num: tuple[float, ...]
    den: tuple[float, ...]
    hold: float

    def response(self, gimbal: Channel, omega: Array) -> NDArray[np.complex128]:
        """Open-loop gain at angular frequencies (n,) [rad/s], hold and delay included."""
        s = 1j * omega
        held = np.sinc(omega * self.hold / (2.0 * np.pi)) * np.exp(-0.5 * s * self.hold)
        own = np.polyval(self.num, s) / np.polyval(self.den, s)
        return np.asarray(own * held * gimbal.frequency_response(omega))


@dataclass(frozen=True, slots=True)
class Margins(Plain):
    """How far one axis of a loop is from instability.

    Attributes
    ----------
    loop, axis : of what
    stable : whether the closed loop is stable
    gain : factor by which the loop gain may rise; infinite without a bound
    lower_gain : factor down to which it may fall; 0 without a bound
    phase : margin at the crossover [rad]
    delay : that may be added to the loop [s]; 0 if it is unstable
    crossover : frequency of unit gain [rad/s]; NaN if the gain never crosses one
    """

    loop: str
    axis: str
    stable: bool
    gain: float
    lower_gain: float
    phase: float
    delay: float
    crossover: float

    def text(self) -> str:
        """One line, in dB, degrees and milliseconds."""
        up, down = (decibels(g) for g in (self.gain, self.lower_gain))
        text = (
            f"gain {up} / {down}, phase {math.degrees(self.phase):.1f}°, "
            f"delay {1e3 * self.delay:.0f} ms, crossover {self.crossover:.1f} rad/s"
        )
        return text if self.stable else f"UNSTABLE: {text}"


def margins(loops: Sequence[Loop], model: TransferFunctionModel) -> tuple[Margins, ...]:
    """Margins of every loop with each axis of a model; cross channels and servo bounds left out."""
    return tuple(
        _margins(loop, name, model.channel(name, name))
        for name in model.outputs
        if name in model.inputs and not model.channel(name, name).zero
        for loop in loops
    )


def _margins(loop: Loop, axis: str, gimbal: Channel) -> Margins:
    fastest = float(np.abs(gimbal.poles).max(initial=1.0))
    high = max(30.0 * fastest, 20.0 / (gimbal.delay + loop.hold))
    omega = np.geomspace(1e-2, high, _POINTS)
    # as python-control's `stability_margins` of the response at these points, which puts splines
    # through them and takes twenty times as long
    opposed = _crossings(lambda w: np.angle(-loop.response(gimbal, w)), omega)
    opposed = opposed[loop.response(gimbal, opposed).real <= 0.0]  # the others are jumps by 2π
    gains = 1.0 / np.abs(loop.response(gimbal, opposed))
    crossovers = _crossings(lambda w: np.abs(loop.response(gimbal, w)) - 1.0, omega)
    phases = np.degrees(np.angle(loop.response(gimbal, crossovers))) % 360.0 - 180.0
    stable = _stable(loop, gimbal)
    if not len(phases):
        phases, crossovers = np.array([np.nan]), np.array([np.nan])
    nearest = int(np.argmin(np.abs(phases)))
    late = np.radians(phases % 360.0) / crossovers
    return Margins(
        loop.name,
        axis,
        stable,
        float(min((g for g in gains if g > 1.0), default=math.inf)),
        float(max((g for g in gains if g < 1.0), default=0.0)),
        math.radians(phases[nearest]),
        float(late.min()) if stable else 0.0,
        float(crossovers[nearest]),
    )


def _crossings(value: Callable[[Array], Array], omega: Array) -> Array:
    """Frequencies at which a function of them changes sign between two points of a grid."""
    from scipy.optimize import brentq

    at = np.flatnonzero(np.diff(np.sign(value(omega))))
    return np.array(
        [brentq(lambda w: float(value(np.array([w]))[0]), *omega[i : i + 2]) for i in at]
    )


def _stable(loop: Loop, gimbal: Channel) -> bool:
    """Whether the closed loop is stable, by its poles with the delays as Padé approximants."""
    import control

    late = control.tf(*control.pade(gimbal.delay + 0.5 * loop.hold, _PADE))
    own = control.tf(list(loop.num), list(loop.den))
    closed = control.feedback(own * gimbal.system() * late, 1)
    return bool((closed.poles().real < 0.0).all())


def decibels(gain: float) -> str:
    """A gain factor in dB; `any` for 0 and infinity, where there is no bound."""
    if gain in (0.0, math.inf):
        return "any"
    return f"{20.0 * math.log10(gain):+.1f} dB"
