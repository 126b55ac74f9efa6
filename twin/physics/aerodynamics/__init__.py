"""Forces of the air on an axisymmetric body: each formula once, for NumPy and for compiled code.

The functions are plain Python over floats or arrays when called from Python, and are compiled
when called from numba (`register_jitable`). Body frame: z to the nose, stations z [m] from the
frame's origin. docs/aerodynamics.md derives and cites them.
"""

from twin.physics.aerodynamics.atmosphere import (
    DENSITY,
    TEMPERATURE,
    density,
    gust,
    gust_modes,
    mean_wind,
    profile_at,
    sound,
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
    "DENSITY",
    "TEMPERATURE",
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
    "profile_at",
    "roll_damping",
    "sound",
    "speed_of_sound",
    "wind",
]
