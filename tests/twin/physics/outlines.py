"""The shipped vehicles' outlines in closed form, from the dimensions their MJCF states."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Outline:
    """Tube with four fins, a half ellipsoid for a nose, and a motor that looks out behind [m].

    Fins are plates: from `fin_low` to `fin_full` their edge runs along the tube, `fin_tip` off the
    axis, and from there straight to `fin_root` off the axis at `fin_high`.
    """

    tail: float
    motor: float
    low: float
    radius: float
    shoulder: float
    tip: float
    fin_low: float
    fin_full: float
    fin_high: float
    fin_tip: float
    fin_root: float
    fin_thickness: float

    def width(self, z: Array | float) -> Array:
        """Width (…,) [m] at stations z [m], averaged over the roll angle: hull's perimeter / π."""
        z = np.asarray(z, dtype=float)
        nose = 1 - ((z - self.shoulder) / (self.tip - self.shoulder)) ** 2
        body = np.select(
            [z < self.tail, z < self.low, z <= self.shoulder, z <= self.tip],
            [0, self.motor, self.radius, self.radius * np.sqrt(np.maximum(nose, 0))],
        )
        taper = np.clip((z - self.fin_full) / (self.fin_high - self.fin_full), 0, 1)
        edge = self.fin_tip - taper * (self.fin_tip - self.fin_root)
        finned = (z >= self.fin_low) & (z < self.fin_high)
        return np.asarray(np.where(finned, self._cross(edge), 2 * body))

    def _cross(self, edge: Array) -> Array:
        """Of four plates that reach `edge` off the axis, and the tube: arcs, tangents, edges."""
        half = self.fin_thickness / 2
        corner, aside = np.hypot(edge, half), np.arctan2(half, edge)
        reach = np.arccos(np.minimum(self.radius / corner, 1.0))  # of the tangent from a corner
        tangent = np.sqrt(np.maximum(corner**2 - self.radius**2, 0.0))
        free = 2 * np.pi - 8 * (aside + reach)  # of the tube, between the tangents
        hull = 8 * half + 8 * tangent + self.radius * free
        hidden = 8 * half + 4 * np.sqrt(2) * (edge - half)  # fins so far out that no tube shows
        inside = corner <= self.radius
        return np.where(inside, 2 * np.pi * self.radius, np.where(free > 0, hull, hidden)) / np.pi

    @property
    def corners(self) -> list[float]:
        """Stations where the width jumps or kinks, ends included [m]."""
        half = self.fin_thickness / 2
        slope = (self.fin_high - self.fin_full) / (self.fin_tip - self.fin_root)
        # (edge² + half²) = (radius / cos(π/4 - aside))²: where the tube begins to show
        hidden = np.sqrt(2) * self.radius - half
        shown, gone = (
            self.fin_full + slope * (self.fin_tip - e)
            for e in (hidden, np.sqrt(self.radius**2 - half**2))
        )
        stations = {self.tail, self.low, self.fin_low, self.fin_full, shown, gone, self.fin_high}
        return sorted(stations | {self.shoulder, self.tip})


# mjcf/parts/airframe.xml and, for the motor's nozzle, mechanism.xml
REFERENCE = Outline(
    tail=-0.1774, motor=0.0145, low=-0.03, radius=0.027, shoulder=0.6726, tip=0.8226,
    fin_low=-0.03, fin_full=0.0, fin_high=0.03, fin_tip=0.0605, fin_root=0.026, fin_thickness=0.002,
)  # fmt: skip
# mjcf/examples/large_rocket.xml
LARGE = Outline(
    tail=-0.27, motor=0.027, low=-0.25, radius=0.049, shoulder=1.25, tip=1.6,
    fin_low=-0.25, fin_full=-0.15, fin_high=-0.05, fin_tip=0.129, fin_root=0.048,
    fin_thickness=0.003,
)  # fmt: skip
