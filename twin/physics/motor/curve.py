"""A motor: its thrust curve and the few figures a flight needs."""

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from twin.errors import TwinError

Array = NDArray[np.float64]

# wide enough for the motors of any model or high-power vehicle, narrow enough to catch wrong units
LONGEST_BURN = 300.0  # s
LARGEST_THRUST = 1e5  # N
LARGEST_MASS = 1e3  # kg
LARGEST_SIZE = 10.0  # m


class MotorError(TwinError):
    """A motor file or figure that cannot be flown."""


@dataclass(frozen=True)
class Motor:
    """Thrust curve and figures of a solid motor.

    Attributes
    ----------
    name : as its file calls it
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
        for label, value, largest, unit in (
            ("propellant mass", self.propellant_mass, LARGEST_MASS, "kg"),
            ("loaded mass", self.loaded_mass, LARGEST_MASS, "kg"),
            ("diameter", self.diameter, LARGEST_SIZE, "m"),
            ("length", self.length, LARGEST_SIZE, "m"),
        ):
            if not 0 < value <= largest:
                raise MotorError(
                    f"motor {self.name!r}: {label} {value:g} {unit};"
                    f" must be positive, at most {largest:g} {unit}"
                )
        if self.propellant_mass >= self.loaded_mass:
            raise MotorError(
                f"motor {self.name!r}: {self.propellant_mass:g} kg of propellant in a loaded motor"
                f" of {self.loaded_mass:g} kg; the loaded mass includes propellant and casing"
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
        raise MotorError(f"{motor}: burns {time[-1]:g} s; more than {LONGEST_BURN:g} s is no motor")
    if thrust.min() < 0:
        raise MotorError(f"{motor}: thrust {thrust.min():g} N is negative")
    if thrust.max() > LARGEST_THRUST:
        raise MotorError(f"{motor}: thrust {thrust.max():g} N; at most {LARGEST_THRUST:g} N")
    if thrust[-1] != 0:
        raise MotorError(
            f"{motor}: the thrust curve never ends: its last point, at {time[-1]:g} s,"
            f" is {thrust[-1]:g} N and must be 0"
        )
    if thrust.max() == 0:
        raise MotorError(f"{motor}: no thrust anywhere")
