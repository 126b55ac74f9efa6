"""How propellant lies in its casing and how it goes: a cylinder that shortens or hollows out."""

import math
from dataclasses import dataclass
from typing import Literal

from analysis.compiled import njit
from twin.physics.motor.curve import Motor

Burn = Literal["core", "end"]

DENSITY = 1700.0  # kg/m³, composite propellant (Sutton & Biblarz, Rocket Propulsion Elements)
LINER = 2e-3  # m between grain and outside of the casing
BORE = 0.35  # core radius over grain radius before ignition; common for BATES grains
FASTEST_END = 0.015  # m/s; slow-burning composites end-burn at 5 to 15 mm/s
SMALLEST_MASS = 1e-6  # kg; MuJoCo wants something left


@dataclass(frozen=True)
class Grain:
    """A cylindrical grain, centred in its casing before ignition.

    Attributes
    ----------
    burn : `end`: burns from the nozzle's end forward; `core`: from a central bore outward
    length, radius : before ignition [m]
    mass : before ignition [kg]
    """

    burn: Burn
    length: float
    radius: float
    mass: float

    @classmethod
    def of(cls, motor: Motor, burn: Burn | None = None) -> "Grain":
        """Grain that gives a motor its propellant mass at the usual density.

        A `.eng` file does not say how the grain burns: unless given, it is an end burner if that
        means a face that moves no faster than 15 mm/s.
        """
        radius = max(motor.diameter / 2 - LINER, 0.25 * motor.diameter)
        solid = motor.propellant_mass / (DENSITY * math.pi * radius**2)
        if burn is None:
            burn = "end" if solid / motor.burn_time <= FASTEST_END else "core"
        length = solid if burn == "end" else solid / (1 - BORE**2)
        return cls(burn, min(length, motor.length), radius, motor.propellant_mass)

    def remaining(self, burnt: float) -> tuple[float, float, float, float]:
        """Mass [kg], centre ahead of the casing's middle [m], transverse and axial inertia [kg m²].

        `burnt` is the fraction of the propellant gone, 0 to 1.
        """
        left: tuple[float, float, float, float] = remaining(
            self.burn == "end", self.length, self.radius, self.mass, burnt
        )
        return left


@njit(nogil=True)
def remaining(
    end: bool, whole: float, radius: float, full: float, burnt: float
) -> tuple[float, float, float, float]:
    """`Grain.remaining` of an end or a core burner with these sizes and this mass."""
    left = 1.0 - burnt
    mass = max(full * left, SMALLEST_MASS)
    if end:
        length, bore = whole * left, 0.0
    else:
        bore = radius * math.sqrt(1.0 - (1.0 - BORE * BORE) * left)
        length = whole
    square = radius * radius + bore * bore
    transverse = mass * (3.0 * square + length * length) / 12.0
    return mass, (whole - length) / 2.0, transverse, mass * square / 2.0
