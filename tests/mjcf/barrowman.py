"""Barrowman's coefficients of a fin set from its dimensions."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Fins:
    """A set of equal trapezoidal fins.

    Attributes
    ----------
    count : 3, 4 or more
    root, tip : chords [m]
    span : from body to tip, of one fin [m]
    sweep : leading edge of the tip behind that of the root [m]
    radius : of the body at the fins [m]
    """

    count: int
    root: float
    tip: float
    span: float
    sweep: float
    radius: float

    def slope(self) -> float:
        """C_Nα of the set with body interference, referred to π radius² [1/rad].

        Source: Barrowman & Barrowman (1966), NARAM-8, and OpenRocket technical documentation
        (2013), section 3.2.2.
        """
        mid = np.hypot(self.span, self.sweep + (self.tip - self.root) / 2)
        ratio = 2 * mid / (self.root + self.tip)
        plain = 4 * self.count * (self.span / (2 * self.radius)) ** 2 / (1 + np.sqrt(1 + ratio**2))
        return float(plain * (1 + self.radius / (self.span + self.radius)))

    def behind(self) -> float:
        """Distance of the centre of pressure behind the root's leading edge [m]; same source."""
        a, b = self.root, self.tip
        return self.sweep / 3 * (a + 2 * b) / (a + b) + (a + b - a * b / (a + b)) / 6

    def roll_damping(self) -> float:
        """Moment against roll over ½ρ v ω: lift slope × Σ ∫ c y² dy [m⁴].

        The lift slope of a fin is its share of `slope` without interference over its area.
        Source: Barrowman (1967).
        """
        y = np.linspace(0.0, 1.0, 2001)
        chord = self.root + (self.tip - self.root) * y
        integral = np.trapezoid(chord * (self.radius + self.span * y) ** 2, y) * self.span
        plain = self.slope() / (1 + self.radius / (self.span + self.radius))
        area = self.span * (self.root + self.tip) / 2
        per_fin = plain * np.pi * self.radius**2 / (self.count / 2 * area)
        return float(self.count * per_fin * integral)
