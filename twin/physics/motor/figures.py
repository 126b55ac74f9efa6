"""Masses and sizes of a motor held against its impulse and against each other."""

import math
from typing import Final

from twin.errors import TwinError

GRAVITY: Final = 9.80665  # m/s², by which specific impulse is defined
# s: black powder 60 to 90, composite 160 to 280, hydrogen and oxygen 450
SPECIFIC_IMPULSE: Final = (10.0, 500.0)
DENSEST_PROPELLANT: Final = 2500.0  # kg/m³ of the casing's volume; composite propellant is 1700
# kg/m³ of the whole motor: an almost empty tube, and solid steel
DENSITY: Final = (50.0, 8000.0)
LARGEST_MASS: Final = 1e3  # kg
LARGEST_SIZE: Final = 10.0  # m
MISTAKEN_GRAMS: Final = 1.0  # s; below, grams were given as kilograms
MISTAKEN_KILOGRAMS: Final = 1e4  # s; above, kilograms were given as grams


class MotorError(TwinError):
    """A motor file or figure that cannot be flown."""


def check_figures(
    name: str, *, impulse: float, propellant: float, loaded: float, diameter: float, length: float
) -> None:
    """Refuse figures of a motor that contradict each other; SI units.

    Raises
    ------
    MotorError : the figure, its value and what would be right
    """
    motor = f"motor {name!r}"
    sizes = (("diameter", diameter, "m"), ("length", length, "m"))
    masses = (("propellant mass", propellant, "kg"), ("loaded mass", loaded, "kg"))
    for label, value, unit in (*masses, *sizes):
        if not 0 < value < math.inf:
            raise MotorError(f"{motor}: {label} {value:g} {unit}; must be positive")
    if propellant >= loaded:
        raise MotorError(
            f"{motor}: {propellant:g} kg of propellant in a loaded motor of {loaded:g} kg; the"
            " loaded mass includes propellant and casing"
        )
    _check_specific_impulse(motor, impulse, propellant)
    _check_density(motor, propellant, loaded, math.pi / 4 * diameter**2 * length)
    for limit, figures in ((LARGEST_MASS, masses), (LARGEST_SIZE, sizes)):
        for label, value, unit in figures:
            if value > limit:
                raise MotorError(f"{motor}: {label} {value:g} {unit}; at most {limit:g} {unit}")


def _check_specific_impulse(motor: str, impulse: float, propellant: float) -> None:
    weight = max(propellant * GRAVITY, math.ulp(0.0))
    specific, (low, high) = impulse / weight, SPECIFIC_IMPULSE
    if low <= specific <= high:
        return
    hint = ""
    if specific < MISTAKEN_GRAMS:
        hint = "; are its masses in grams? They are taken as kilograms here"
    if specific > MISTAKEN_KILOGRAMS:
        hint = "; are its masses in kilograms? They are taken as grams here"
    raise MotorError(
        f"{motor}: specific impulse of {specific:.2g} s ({impulse:.4g} N s from {propellant:g} kg"
        f" of propellant); must be {low:g} to {high:g} s{hint}"
    )


def _check_density(motor: str, propellant: float, loaded: float, volume: float) -> None:
    volume = max(volume, math.ulp(0.0))  # of sizes whose product vanishes
    inside, whole = propellant / volume, loaded / volume
    if inside > DENSEST_PROPELLANT:
        raise MotorError(
            f"{motor}: {propellant:g} kg of propellant in a casing of {volume * 1e6:.4g} cm³ is"
            f" {inside:.4g} kg/m³; at most {DENSEST_PROPELLANT:g} kg/m³, so its masses or its"
            " sizes are in other units"
        )
    low, high = DENSITY
    if not low <= whole <= high:
        raise MotorError(
            f"{motor}: {loaded:g} kg in {volume * 1e6:.4g} cm³ is {whole:.4g} kg/m³; must be"
            f" {low:g} to {high:g} kg/m³, so its masses or its sizes are in other units"
        )
