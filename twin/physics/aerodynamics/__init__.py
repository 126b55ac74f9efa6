"""Forces of the air on an axisymmetric body: each formula once, for NumPy and for compiled code.

The functions are plain Python over floats or arrays when called from Python, and are compiled
when called from numba (`register_jitable`). Body frame: z to the nose, stations z [m] from the
frame's origin. docs/aerodynamics.md derives and cites them.
"""

from twin.physics.aerodynamics.atmosphere import (
    density,
    gust,
    gust_modes,
    mean_wind,
    speed_of_sound,
    wind,
)
from twin.physics.aerodynamics.body import (
    area_moments,
    axial_drag,
    crossflow,
    crossflow_area_moment,
    crossflow_by_moments,
    normal_force,
    roll_damping,
)

__all__ = [
    "area_moments",
    "axial_drag",
    "crossflow",
    "crossflow_area_moment",
    "crossflow_by_moments",
    "density",
    "gust",
    "gust_modes",
    "mean_wind",
    "normal_force",
    "roll_damping",
    "speed_of_sound",
    "wind",
]
