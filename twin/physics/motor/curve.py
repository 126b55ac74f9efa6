"""A motor: its thrust curve and the few figures a flight needs."""

from dataclasses import dataclass
from typing import Final, Self

import numpy as np
from numpy.typing import NDArray

from twin.physics.motor.figures import MotorError, check_figures

Array = NDArray[np.float64]

# wide enough for the motors of any model or high-power vehicle, narrow enough to catch wrong units
LONGEST_BURN: Final = 300.0  # s
LARGEST_THRUST: Final = 1e5  # N


@dataclass(frozen=True)
class Motor:
    """Thrust curve and figures of a solid motor.

    Attributes
    ----------
    name : designation, as its file gives it
    time : points of the curve, strictly increasing from 0, (n,) [s]
    thrust : at those times, zero at the last, (n,) [N]
    propellant_mass, loaded_mass : [kg]
    diameter, length : of the casing [m]
    """

    name: str
    time: Array
    thrust: Array
    propellant_mass: float
    loaded_mass: float
    diameter: float
    length: float

    def __post_init__(self) -> None:
        """Refuse figures that cannot be flown.

        Raises
        ------
        MotorError : which one, its value and what would be right
        """
        time, thrust = (np.array(values, dtype=np.float64) for values in (self.time, self.thrust))
        _check_curve(self.name, time, thrust)
        check_figures(
            self.name,
            impulse=float(np.trapezoid(thrust, time)),
            propellant=self.propellant_mass,
            loaded=self.loaded_mass,
            diameter=self.diameter,
            length=self.length,
        )
        for field, values in (("time", time), ("thrust", thrust)):
            values.setflags(write=False)
            object.__setattr__(self, field, values)

    @property
    def impulse(self) -> float:
        """Total impulse [N s]."""
        return float(np.trapezoid(self.thrust, self.time))

    @property
    def burn_time(self) -> float:
        """End of thrust after ignition [s]."""
        return float(self.time[-1])

    def thrust_at(self, t: float | Array) -> Array:
        """Thrust at times after ignition (…,) [N]; zero outside the burn."""
        return np.asarray(np.interp(t, self.time, self.thrust, left=0.0, right=0.0))

    def mass_at(self, t: float | Array) -> Array:
        """Mass of casing and remaining propellant at times after ignition (…,) [kg].

        Propellant goes with the impulse delivered: constant exhaust velocity.
        """
        burnt = impulse_at(self.time, self.thrust, np.asarray(t)) / self.impulse
        return np.asarray(self.loaded_mass - self.propellant_mass * burnt)

    @property
    def figures(self) -> dict[str, float]:
        """Masses [kg] and sizes [m] by the names of their attributes."""
        names = ("propellant_mass", "loaded_mass", "diameter", "length")
        return {name: getattr(self, name) for name in names}

    def simplified(self, count: int) -> Self:
        """The motor with at most `count` points, scaled to the same impulse.

        Points that change the area under the curve least go first
        (Visvalingam & Whyatt 1993, The Cartographic Journal 30, 46-51).
        """
        keep = list(range(self.time.size))
        while len(keep) > count:
            t, f = self.time[keep], self.thrust[keep]
            area = np.abs(
                (t[1:-1] - t[:-2]) * (f[2:] - f[:-2]) - (t[2:] - t[:-2]) * (f[1:-1] - f[:-2])
            )
            del keep[1 + int(np.argmin(area))]
        time, thrust = self.time[keep], self.thrust[keep]
        scale = self.impulse / float(np.trapezoid(thrust, time))
        return type(self)(**(vars(self) | {"time": time, "thrust": thrust * scale}))


def impulse_at(time: Array, thrust: Array, t: Array) -> Array:
    """Impulse delivered by a piecewise linear curve up to times (…,) [N s], exactly."""
    steps = np.diff(time)
    done = np.concatenate([[0.0], np.cumsum(steps * (thrust[1:] + thrust[:-1]) / 2)])
    at = np.clip(t, time[0], time[-1])
    k = np.clip(np.searchsorted(time, at, side="right") - 1, 0, time.size - 2)
    into = at - time[k]
    slope = (thrust[k + 1] - thrust[k]) / np.where(steps[k] > 0, steps[k], 1.0)
    return np.asarray(done[k] + into * (thrust[k] + slope * into / 2))


def _check_curve(name: str, time: Array, thrust: Array) -> None:
    motor = f"motor {name!r}"
    if time.ndim != 1 or time.shape != thrust.shape or time.size < 3:
        raise MotorError(f"{motor}: the thrust curve has {time.size} points; it needs 3 or more")
    if not (np.isfinite(time).all() and np.isfinite(thrust).all()):
        raise MotorError(f"{motor}: the thrust curve holds a number that is not finite")
    if time[0] != 0:
        raise MotorError(f"{motor}: the curve starts at {time[0]:g} s; times increase from 0")
    if not (np.diff(time) > 0).all():
        worst = int(np.argmax(np.diff(time) <= 0)) + 1
        raise MotorError(
            f"{motor}: time {time[worst]:g} s follows {time[worst - 1]:g} s;"
            " times must increase from point to point"
        )
    if time[-1] > LONGEST_BURN:
        raise MotorError(
            f"{motor}: burns {time[-1]:g} s; more than {LONGEST_BURN:g} s is no motor"
            " (times must be in seconds)"
        )
    if thrust.min() < 0:
        raise MotorError(f"{motor}: thrust {thrust.min():g} N is negative")
    if thrust.max() > LARGEST_THRUST:
        raise MotorError(f"{motor}: thrust {thrust.max():g} N; at most {LARGEST_THRUST:g} N")
    if thrust[-1] != 0:
        raise MotorError(
            f"{motor}: the thrust curve never ends: its last point is"
            f" {thrust[-1]:g} N at {time[-1]:g} s; it must end with a thrust of 0"
        )
    if thrust.max() == 0:
        raise MotorError(f"{motor}: no thrust anywhere")
