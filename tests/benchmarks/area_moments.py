"""How far the thesis's area-moment form is from the integral it stands for.

`python -m tests.benchmarks.area_moments` prints the tables of docs/aerodynamics.md.
"""

from importlib.resources import files

import mujoco
import numpy as np
from numpy.typing import NDArray

from twin.physics.aerodynamics.atmosphere import SEA_LEVEL_DENSITY
from twin.physics.aerodynamics.body import area_moments, crossflow, crossflow_area_moment

Array = NDArray[np.float64]

SPEEDS = (0.0, 1.0, 3.0, 10.0)  # m/s across the body
RATES = (0.2, 1.0, 3.0, 10.0)  # rad/s
CENTRE = 0.2726  # m, of mass, reference vehicle loaded


class Comparison:
    """Strip integral and area-moment form of one vehicle, in one plane."""

    def __init__(self, model: mujoco.MjModel, centre: float = CENTRE) -> None:
        def value(name: str) -> Array:
            return np.array(model.numeric(f"air_{name}").data)

        self.z, self.area = value("strip_z"), value("strip_area")
        self.coefficient = float(value("crossflow_drag")[0])
        self.r_ref, self.dv_ref = float(value("thesis_radius")[0]), float(value("thesis_offset")[0])
        self.centre = centre
        moments = area_moments(self.z, self.area, centre)
        self.moments = tuple(self.coefficient * a for a in moments)

    def exact(self, v0: float, w: float) -> float:
        """Moment of ∫ r ½ρ C (v0 - ω r)|v0 - ω r| b dr [N m]."""
        scale = 0.5 * SEA_LEVEL_DENSITY * self.coefficient
        # air passes at v0 - ω r: the body moves at -v0 and turns at ω about y
        return crossflow(-v0, 0.0, 0.0, w, scale, self.z, self.area, self.centre)[3]

    def form(self, v0: float, w: float) -> float:
        """Moment of the area-moment form [N m]."""
        return crossflow_area_moment(
            v0, w, SEA_LEVEL_DENSITY, self.moments, self.r_ref, self.dv_ref
        )[1]

    def table(self) -> str:
        """Markdown: both moments and the error over speed and rate."""
        lines = [
            "| v0 [m/s] | ω [rad/s] | integral [N m] | area-moment form [N m] | error |",
            "|---|---|---|---|---|",
        ]
        for v0 in SPEEDS:
            for w in RATES:
                exact, form = self.exact(v0, w), self.form(v0, w)
                error = f"{100 * (form - exact) / abs(exact):+.0f} %"
                sign = ", wrong sign" if form * exact < 0 else ""
                lines.append(f"| {v0:g} | {w:g} | {exact:.3g} | {form:.3g} | {error}{sign} |")
        return "\n".join(lines)

    def summary(self) -> str:
        """One sentence over 20 000 seeded states: median error, and how often the sign is wrong."""
        rng = np.random.default_rng(0)
        states = rng.uniform((-20.0, -10.0), (20.0, 10.0), (20_000, 2))
        exact = np.array([self.exact(v, w) for v, w in states])
        form = np.array([self.form(v, w) for v, w in states])
        error = np.median(np.abs(form - exact) / np.abs(exact))
        wrong = np.mean(form * exact < 0)
        return (
            f"Over v0 = ±20 m/s and ω = ±10 rad/s the median error of the moment is"
            f" {100 * error:.0f} %, and {100 * wrong:.1f} % of states have the wrong sign."
        )


def main() -> None:
    """Print table and sentence for the reference vehicle."""
    path = str(files("mjcf") / "vehicle.xml")
    comparison = Comparison(mujoco.MjModel.from_xml_path(path))
    print(comparison.table())
    print()
    print(comparison.summary())


if __name__ == "__main__":
    main()
